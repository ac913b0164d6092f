//! A small package made the way a farm makes one, with light that is a formula: a wall that fills part of its texture, so that it has
//! gutters and empty cells, and a lamp.

use kiln_coordinator::assemble::{Hole, Holes, SourceError, assemble_around, assemble_surface, write_manifest};
use kiln_proto::{
    format::PackageHash,
    frame::FrameRule,
    grid::Walk,
    plan::{ChartSource, PLAN_VERSION, PhaseResults, Plan, PlannedTile, SurfacePlan},
    scene::{Lobe, Material, Phong, Reflection, Scene, Surface, Triangle},
    settings::{RawFormat, Rule, SettingsPatch, TextureSize},
    texel::{Row, SurfaceRaster, Texel},
    tile::{Cell, TileIndex},
    units::{Exposure, Rgb},
};
use kiln_worker::encode::encode_tile;
use std::path::Path;

/// Settings that tests vary.
pub(crate) fn settings(rule: Rule, raw: Option<RawFormat>) -> kiln_proto::settings::BakeSettings {
    let patch = SettingsPatch { directions: Some("4x6".parse().unwrap()), raw, ..SettingsPatch::default() };
    kiln_proto::settings::BakeSettings { rule, ..patch.resolve().unwrap() }
}

/// Flips one bit in the middle of a file's payload.
pub(crate) fn flip(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    let middle = 32 + (bytes.len() - 32) / 2;
    bytes[middle] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

/// The radiance of a texel toward one direction: a gloss that no rule keeps without loss.
pub(crate) fn radiance(texel: &Texel, toward: glam::Vec3) -> [f32; 3] {
    let cosine = toward.dot(glam::Vec3::new(0.6, 0.64, 0.48)).max(0.0);
    let gloss = (0..6).fold(1.0, |product, _| product * cosine);
    let p = texel.position;
    [0.1 + gloss, 0.2 + 0.5 * gloss * p.x, 0.3 + 0.25 * p.y + 0.125 * toward.x]
}

fn scene() -> Scene {
    let quad = |name: &str, material, z: u32, scale: f32| {
        let uv = [[0.0, 0.0], [scale, 0.0], [scale, scale], [0.0, scale]];
        let triangle = |c: [usize; 3]| (Triangle { corners: c.map(|k| z * 4 + k as u32), polygon: 0 }, Some(c.map(|k| uv[k])));
        Surface::plain(name, material, vec![triangle([0, 1, 2]), triangle([0, 2, 3])])
    };
    let gloss = Phong { specular: Rgb::splat(0.25), lobe: Lobe::Phong { exponent: 20.0 }, ..Phong::matt(Rgb::splat(0.5)) };
    let material = |name: &str, emission| Material::new(name, Reflection::Phong(gloss.clone())).emitting(Rgb::splat(emission));
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    Scene {
        positions: (0..2u8).flat_map(|z| corners.map(|[x, y]| [x, y, f32::from(z)])).collect(),
        surfaces: vec![quad("wall", 0, 0, 0.5), quad("lamp", 1, 1, 1.0)],
        materials: vec![material("paint", 0.0), material("light", 4.0)],
        ..Scene::empty()
    }
}

fn lay_out(scene: &Scene, surface: usize, size: &str) -> SurfacePlan {
    let size: TextureSize = size.parse().unwrap();
    let uv = scene.surfaces[surface].uv_sets[0].iter().map(|uv| uv.unwrap()).collect();
    let mut plan = SurfacePlan { size, source: ChartSource::Author, uv, charts: vec![0, 0], covered: 0, tiles: vec![] };
    let raster = SurfaceRaster::new(scene, &scene.surfaces[surface], &plan, FrameRule::Texture);
    let mut cells: Vec<Cell> =
        (0..raster.rows()).flat_map(|y| (0..raster.columns()).map(move |x| Cell { x: x as u16, y: y as u16 })).collect();
    cells.sort_by_key(|c| c.morton());
    for cell in cells {
        let rows = raster.tile(cell);
        let covered = rows.iter().filter(|r| r.is_covered()).count();
        plan.covered += covered as u64;
        if !rows.is_empty() {
            plan.tiles.push(PlannedTile { cell, covered: covered as u16, gutter: (rows.len() - covered) as u16 });
        }
    }
    plan
}

fn light(plan: &Plan, raster: &SurfaceRaster, rows: &[Row]) -> Vec<f32> {
    let directions = plan.settings.directions.directions();
    let texel = |row: &Row| raster.texel(row.source.0, row.source.1).unwrap();
    rows.iter().map(texel).flat_map(|t| directions.iter().flat_map(|d| radiance(&t, t.frame.to_world(*d))).collect::<Vec<_>>()).collect()
}

/// Bakes the package into `dir`.
pub(crate) fn bake(dir: &Path, settings: kiln_proto::settings::BakeSettings) -> PackageHash {
    bake_around(dir, settings, [&[], &[]])
}

/// Bakes the package without these tiles of the wall and of the lamp.
pub(crate) fn bake_around(dir: &Path, settings: kiln_proto::settings::BakeSettings, holes: [&[usize]; 2]) -> PackageHash {
    let scene = scene();
    let scene_bytes = scene.to_bytes().unwrap();
    let fixed = settings.walk.fixed();
    let walks = [Walk::Theta, Walk::Phi].map(|found| fixed.unwrap_or(found)).to_vec();
    let plan = Plan {
        version: PLAN_VERSION,
        bake_version: 1,
        scene: Scene::hash_of(&scene_bytes),
        surfaces: vec![lay_out(&scene, 0, "70x66"), lay_out(&scene, 1, "8x5")],
        probe: Some(PhaseResults { exposure: Exposure { eighths: -3 }, walks, clipped_ppm: 7 }),
        settings,
    };
    let reports: Vec<_> = (0..2)
        .map(|surface| {
            let raster = SurfaceRaster::new(&scene, &scene.surfaces[surface], &plan.surfaces[surface], plan.settings.frame);
            let mut source = |index: usize| -> Result<Vec<u8>, SourceError> {
                let tile = TileIndex(plan.first_tile(surface).0 + index as u64);
                let rows = raster.tile(plan.surfaces[surface].tiles[index].cell);
                Ok(encode_tile(&plan, tile, &rows, &light(&plan, &raster, &rows))?)
            };
            let stem = &scene.surfaces[surface].file_stem;
            if holes[surface].is_empty() {
                return assemble_surface(&plan, surface, stem, &mut source, dir).unwrap();
            }
            let list = holes[surface].iter().map(|tile| Hole { tile: *tile, reason: "failed 3 times on 2 workers".into() }).collect();
            assemble_around(&Holes::new(&scene, &plan, surface, list).unwrap(), stem, &mut source, dir).unwrap()
        })
        .collect();
    write_manifest(dir, &scene_bytes, &plan, &reports).unwrap().hash
}
