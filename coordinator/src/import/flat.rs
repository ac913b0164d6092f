//! Surfaces whose normals are those of their triangles are flat: they need no normals, and are laid out polygon by polygon.
//!
//! Exporters write such normals for every flat cube. They are dropped once tangents are complete, which go over the edges of triangles that
//! share a normal. Cost: linear in corners.

use glam::{DVec3, Vec3};
use kiln_proto::scene::{Scene, Surface};

/// Cosine of the angle by which a normal may lean and still be that of its triangle: a twentieth of a degree and a little.
const SAME: f64 = 1.0 - 1e-6;

/// Takes the normals off flat surfaces; tangents stay.
pub(super) fn flatten(scene: &mut Scene) {
    let flat: Vec<bool> = scene.surfaces.iter().map(|s| !s.normals.is_empty() && is_flat(scene, s)).collect();
    if !flat.contains(&true) {
        return;
    }
    let lists = scene.surfaces.iter_mut().zip(flat);
    lists.filter(|(_, flat)| *flat).for_each(|(surface, _)| surface.normals = vec![]);
    let corners = scene.surfaces.iter_mut().flat_map(|s| s.normals.as_flattened_mut());
    scene.normals = used(&scene.normals, corners);
}

fn is_flat(scene: &Scene, surface: &Surface) -> bool {
    surface.triangles.iter().zip(&surface.normals).all(|(t, normals)| {
        let [a, b, c] = scene.corners(t);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let wide = |id: u32| -> DVec3 { Vec3::from_array(scene.normals[id as usize]).as_dvec3() };
        normals.iter().all(|id| wide(*id).dot(normal) > SAME)
    })
}

/// The values that corners still refer to, in order of first use, by which they are then called.
fn used<'s>(values: &[[f32; 3]], corners: impl Iterator<Item = &'s mut u32>) -> Vec<[f32; 3]> {
    let (mut kept, mut places) = (vec![], vec![u32::MAX; values.len()]);
    for id in corners {
        let place = &mut places[*id as usize];
        if *place == u32::MAX {
            *place = kept.len() as u32;
            kept.push(values[*id as usize]);
        }
        *id = *place;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::scene::Triangle;

    #[test]
    fn normals_of_the_triangles_are_none() {
        let mut scene = Scene::empty();
        let (up, tilted) = ([0.0, 0.0, 1.0], [0.0, 0.6, 0.8]);
        scene.normals = vec![up, tilted];
        scene.tangents = vec![[1.0, 0.0, 0.0, 1.0]];
        for (k, normals) in [[0; 3], [1, 0, 1]].into_iter().enumerate() {
            let x = k as f32 * 5.0;
            scene.positions.extend([[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]]);
            let corners = [0, 1, 2].map(|c| 3 * k as u32 + c);
            let triangles = vec![Triangle { corners, polygon: 0 }];
            scene.surfaces.push(Surface { triangles, normals: vec![normals], tangents: vec![[0; 3]], ..Surface::default() });
        }
        flatten(&mut scene);
        assert_eq!((scene.surfaces[0].normals.len(), scene.surfaces[0].tangents.len()), (0, 1));
        assert_eq!((scene.surfaces[1].normals[0], scene.normals), ([0, 1, 0], vec![tilted, up]), "in order of first use");
    }
}
