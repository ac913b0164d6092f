//! Packages whose light is a formula: scenes of any kind for tests of what shows them, made in a moment and known at every point.

use kiln_coordinator::{
    assemble::{SourceError, assemble_surface, write_manifest},
    split::make_plan,
};
use kiln_proto::{
    grid::Walk,
    plan::{PhaseResults, Plan},
    scene::{Scene, Surface, Triangle},
    settings::{RawFormat, SettingsPatch},
    texel::{Row, SurfaceRaster, Texel},
    tile::TileIndex,
    units::Exposure,
};
use kiln_worker::encode::encode_tile;
use std::{fs, path::Path};

/// Radiance of a texel of a surface toward a world direction.
pub(crate) type Formula = fn(&Surface, &Texel, glam::Vec3) -> [f32; 3];

/// Writes the package of a scene into `dir`, with raw samples; exposure 0.
pub(crate) fn make_package(dir: &Path, scene: &Scene, directions: &str, formula: Formula) {
    let bytes = scene.to_bytes().unwrap();
    let patch = SettingsPatch { directions: Some(directions.parse().unwrap()), raw: Some(RawFormat::U8), ..SettingsPatch::default() };
    let (mut plan, _) = make_plan(scene, Scene::hash_of(&bytes), &patch.resolve().unwrap()).unwrap();
    let walks = vec![Walk::Phi; scene.surfaces.len()];
    plan.probe = Some(PhaseResults { exposure: Exposure { eighths: 0 }, walks, clipped_ppm: 0 });
    fs::create_dir_all(dir).unwrap();
    let reports: Vec<_> = (0..scene.surfaces.len())
        .map(|index| {
            let surface = &scene.surfaces[index];
            let raster = SurfaceRaster::new(scene, surface, &plan.surfaces[index], plan.settings.frame);
            let mut source = |tile: usize| -> Result<Vec<u8>, SourceError> {
                let rows = raster.tile(plan.surfaces[index].tiles[tile].cell);
                let number = TileIndex(plan.first_tile(index).0 + tile as u64);
                Ok(encode_tile(&plan, number, &rows, &light(&plan, surface, &raster, &rows, formula))?)
            };
            assemble_surface(&plan, index, &surface.file_stem, &mut source, dir).unwrap()
        })
        .collect();
    write_manifest(dir, &bytes, &plan, &reports).unwrap();
}

fn light(plan: &Plan, surface: &Surface, raster: &SurfaceRaster, rows: &[Row], formula: Formula) -> Vec<f32> {
    let directions = plan.settings.directions.directions();
    let texel = |row: &Row| raster.texel(row.source.0, row.source.1).unwrap();
    rows.iter()
        .map(texel)
        .flat_map(|t| directions.iter().flat_map(|d| formula(surface, &t, t.frame.to_world(*d))).collect::<Vec<_>>())
        .collect()
}

/// An upright square of side `2 half` about `centre` that faces +z, with texture coordinates over all of the unit square.
pub(crate) fn square(scene: &mut Scene, name: &str, material: u32, centre: [f32; 3], half: f32) -> Surface {
    let first = scene.positions.len() as u32;
    let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    scene.positions.extend(uv.map(|[u, v]| [centre[0] + (2.0 * u - 1.0) * half, centre[1] + (2.0 * v - 1.0) * half, centre[2]]));
    let triangle = |c: [usize; 3]| (Triangle { corners: c.map(|k| first + k as u32), polygon: 0 }, Some(c.map(|k| uv[k])));
    Surface::plain(name, material, vec![triangle([0, 1, 2]), triangle([0, 2, 3])])
}

/// A ball of `2 n` x `n` quads with the normals of a sphere.
pub(crate) fn ball(scene: &mut Scene, name: &str, material: u32, centre: [f32; 3], radius: f32, n: u32) -> Surface {
    let first = scene.positions.len() as u32;
    let columns = 2 * n;
    for i in 0..=n {
        let (across, up) = kiln_proto::math::sin_cos_degrees(180.0 - 180.0 * f64::from(i) / f64::from(n));
        for j in 0..columns {
            let (z, x) = kiln_proto::math::sin_cos_degrees(360.0 * f64::from(j) / f64::from(columns));
            let normal = [across * x, up, -across * z].map(|v| v as f32);
            scene.normals.push(normal);
            scene.positions.push(std::array::from_fn(|axis| centre[axis] + radius * normal[axis]));
        }
    }
    let at = |i: u32, j: u32| (first + i * columns + j % columns, [j as f32 / columns as f32, i as f32 / n as f32]);
    let mut triangles = vec![];
    for (i, j) in (0..n).flat_map(|i| (0..columns).map(move |j| (i, j))) {
        let quad = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        // At the poles one side of the quad has no length.
        let halves = [(i > 0).then_some([0, 1, 2]), (i + 1 < n).then_some([0, 2, 3])];
        for c in halves.into_iter().flatten() {
            triangles.push((Triangle { corners: c.map(|k| quad[k].0), polygon: i * columns + j }, Some(c.map(|k| quad[k].1))));
        }
    }
    let normal_of = scene.normals.len() as u32 - (n + 1) * columns;
    let mut surface = Surface::plain(name, material, triangles);
    surface.normals = surface.triangles.iter().map(|t| t.corners.map(|c| c - first + normal_of)).collect();
    surface
}

/// The back of a surface whose index is `front`.
pub(crate) fn back(front: &Surface, index: u32) -> Surface {
    let name = format!("{}~back", front.name);
    let turned = |t: &Triangle| Triangle { corners: [t.corners[0], t.corners[2], t.corners[1]], ..*t };
    let uv_sets = front.uv_sets.iter().map(|set| set.iter().map(|uv| uv.map(|[a, b, c]| [a, c, b])).collect()).collect();
    let triangles = front.triangles.iter().map(turned).collect();
    Surface { file_stem: name.clone(), name, back_of: Some(index), triangles, uv_sets, ..front.clone() }
}
