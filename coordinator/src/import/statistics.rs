//! What a scene consists of, in numbers: for whoever wants to see whether the import understood the file.

use crate::records::{LightCounts, SceneStatistics};
use kiln_proto::scene::{LightShape, Material, Reflection, Scene, Surface};

/// Counts of a scene. Cost: linear in surfaces and vertices.
#[must_use]
pub fn statistics(scene: &Scene) -> SceneStatistics {
    let (low, high) = scene.bounds();
    let surfaces = |is: fn(&Surface) -> bool| scene.surfaces.iter().filter(|s| is(s)).count() as u64;
    SceneStatistics {
        triangles: scene.triangle_count() as u64,
        surfaces: scene.surfaces.iter().map(|s| s.name.clone()).collect(),
        materials: scene.materials.len() as u64,
        textures: scene.textures.len() as u64,
        emissive_triangles: triangles(scene, Material::is_emissive),
        parts: scene.surfaces.iter().map(|s| s.parts.len() as u64).sum(),
        backs: surfaces(|s| s.back_of.is_some()),
        smooth_surfaces: surfaces(|s| !s.normals.is_empty()),
        colored_surfaces: surfaces(|s| !s.colors.is_empty()),
        mapped_surfaces: surfaces(|s| s.uv_sets.iter().flatten().any(Option::is_some)),
        uv_sets: scene.surfaces.iter().map(|s| s.uv_sets.len() as u64).max().unwrap_or_default(),
        transparent_triangles: triangles(scene, lets_light_through),
        lights: lights(scene),
        environment: scene.environment.as_ref().map(|e| [e.width, e.height]),
        cameras: scene.cameras.len() as u64,
        projectors: scene.projectors.len() as u64,
        low,
        high,
    }
}

/// Triangles of materials of a kind.
fn triangles(scene: &Scene, is: fn(&Material) -> bool) -> u64 {
    let parts = scene.surfaces.iter().flat_map(|s| &s.parts);
    parts.filter(|p| is(&scene.materials[p.material as usize])).map(|p| u64::from(p.triangles)).sum()
}

fn lets_light_through(material: &Material) -> bool {
    let transmits = matches!(&material.reflection, Reflection::MetallicRoughness(m) if m.transmission > 0.0);
    material.lets_through() || transmits
}

fn lights(scene: &Scene) -> LightCounts {
    let mut counts = LightCounts::default();
    for light in &scene.lights {
        match light.shape {
            LightShape::Point { .. } => counts.point += 1,
            LightShape::Spot { .. } => counts.spot += 1,
            LightShape::Directional { .. } => counts.directional += 1,
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::{Bundle, Content, Part, import_bundle};
    use kiln_proto::options::ImportOptions;

    #[test]
    fn everything_is_counted_by_its_kind() {
        let text = b"#X3D V3.3 utf8
PointLight { } SpotLight { } SpotLight { } DirectionalLight { } Viewpoint { }
Shape { appearance Appearance { material Material { transparency 0.5 } } geometry Sphere { } }
Shape { appearance Appearance { material Material { emissiveColor 1 1 1 } }
  geometry IndexedFaceSet { solid FALSE coord Coordinate { point [ 0 0 5, 1 0 5, 0 1 5 ] } coordIndex [ 0 1 2 -1 ]
    color Color { color [ 1 0 0, 0 1 0, 0 0 1 ] } } }";
        let parts = vec![Part { name: "a.x3dv".into(), content: Content::Bytes(text.to_vec()) }];
        let bundle = Bundle::from_parts(parts, None, &std::env::temp_dir()).unwrap();
        let s = import_bundle(&bundle, &ImportOptions::default()).unwrap().statistics;
        assert_eq!(s.lights, LightCounts { point: 1, spot: 2, directional: 1 });
        assert_eq!((s.cameras, s.environment, s.emissive_triangles, s.backs), (1, None, 2, 1));
        assert_eq!((s.colored_surfaces, s.smooth_surfaces, s.parts), (2, 1, 3));
        assert_eq!(s.transparent_triangles, s.triangles - 2);
        assert_eq!((s.mapped_surfaces, s.uv_sets), (3, 1));
    }
}
