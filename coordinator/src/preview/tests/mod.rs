//! A small package in memory, its light a formula, and the renderer held against the reference lookup and against geometry done by hand.

mod camera;
mod picture;
mod veil;
mod visibility;

use super::visibility::{Looked, Seen};
use super::*;
use glam::Vec3;
use kiln_proto::{
    codec::pwl::Sample,
    format::{
        Header, Kind,
        stream::{InMemory, ReadAt},
    },
    frame::FrameRule,
    plan::{ChartSource, PLAN_VERSION, PhaseResults, SurfacePlan},
    scene::{Material, Surface, Triangle},
    settings::{RawFormat, SettingsPatch},
    texel::SurfaceRaster,
    tile::Cell,
    units::{Exposure, Rgb},
};
use std::collections::BTreeMap;

/// Quads by their corners, counter-clockwise from the front; each is a surface whose one chart fills its texture up to `fill`.
fn scene_of(quads: &[[[f32; 3]; 4]], fill: f32) -> Scene {
    let uv = [[0.0, 0.0], [fill, 0.0], [fill, fill], [0.0, fill]];
    let surface = |n: usize| {
        let triangle = |c: [usize; 3]| (Triangle { corners: c.map(|k| (4 * n + k) as u32), polygon: 0 }, Some(c.map(|k| uv[k])));
        Surface::plain(format!("s{n}"), 0, vec![triangle([0, 1, 2]), triangle([0, 2, 3])])
    };
    let material = Material::matt("m", Rgb::splat(0.5));
    Scene {
        positions: quads.iter().flatten().copied().collect(),
        surfaces: (0..quads.len()).map(surface).collect(),
        materials: vec![material],
        ..Scene::empty()
    }
}

fn plan_of(scene: &Scene, size: &str, directions: &str) -> Plan {
    let layout = |s: &Surface| SurfacePlan {
        size: size.parse().unwrap(),
        source: ChartSource::Author,
        uv: s.uv_sets[0].iter().map(|uv| uv.unwrap()).collect(),
        charts: vec![0; s.triangles.len()],
        covered: 0,
        tiles: vec![],
    };
    let patch = SettingsPatch { directions: Some(directions.parse().unwrap()), raw: Some(RawFormat::U8), ..SettingsPatch::default() };
    Plan {
        version: PLAN_VERSION,
        bake_version: 1,
        scene: Scene::hash_of(b""),
        settings: patch.resolve().unwrap(),
        surfaces: scene.surfaces.iter().map(layout).collect(),
        probe: Some(PhaseResults {
            exposure: Exposure { eighths: 4 },
            walks: vec![kiln_proto::grid::Walk::Theta; scene.surfaces.len()],
            clipped_ppm: 0,
        }),
    }
}

/// The files of a package by path.
struct Files(BTreeMap<String, Vec<u8>>);

impl PackageFiles for Files {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        let found = self.0.get(path).ok_or_else(|| ReadError::Io { name: path.into(), source: "no such file".into() })?;
        Ok(Box::new(InMemory { name: path.into(), bytes: found.clone() }))
    }
}

/// The byte values of a texel at a depth: every texel and direction has its own.
fn value(surface: usize, texel: u64, depth: u32) -> Sample {
    [(texel * 7 + u64::from(depth) * 31) as u8, (texel * 13 + surface as u64 * 90) as u8, (255 - depth * 9 % 256) as u8]
}

/// A package with `value` in every texel that its charts cover or border on and that `holds` lets through, losslessly.
fn files_of(scene: &Scene, plan: &Plan, holds: impl Fn(usize, u64) -> bool) -> Files {
    let mut files = BTreeMap::new();
    for (n, (surface, layout)) in scene.surfaces.iter().zip(&plan.surfaces).enumerate() {
        let (width, order) = (layout.size.width, plan.order(n));
        let raster = SurfaceRaster::new(scene, surface, layout, FrameRule::Texture);
        let cells = (0..raster.rows()).flat_map(|y| (0..raster.columns()).map(move |x| Cell { x: x as u16, y: y as u16 }));
        let rows = cells.flat_map(|cell| raster.tile(cell)).map(|row| u64::from(row.y) * u64::from(width) + u64::from(row.x));
        let held: std::collections::BTreeSet<u64> = rows.filter(|t| holds(n, *t)).collect();
        let (mut starts, mut depths, mut colours, mut raw) = (vec![0u32], vec![], vec![], vec![]);
        for texel in 0..layout.size.texels() {
            for step in (0..order.len()).filter(|_| held.contains(&texel)) {
                depths.extend(order.depth(step).to_le_bytes());
                colours.extend(value(n, texel, u32::from(order.depth(step))));
            }
            let sample = |depth: usize| if held.contains(&texel) { value(n, texel, depth as u32) } else { [0; 3] };
            raw.extend((0..order.len()).flat_map(sample));
            starts.push((depths.len() / 2) as u32);
        }
        let starts: Vec<u8> = starts.iter().flat_map(|s| s.to_le_bytes()).collect();
        for (kind, bits, element, payload) in [
            (Kind::Mtsp, 32, 4, starts),
            (Kind::Mti, 16, 2, depths),
            (Kind::Mtnc, 24, 3, colours),
            (Kind::Mtm, 8, 3, vec![]),
            (Kind::Mtex, 8, 3, raw),
        ] {
            let count = (payload.len() / element) as u64;
            let header = Header { kind, bits, size: layout.size, depth: order.len() as u32, count, crc: crc32c::crc32c(&payload) };
            files.insert(kind.path(&surface.file_stem), [&header.to_bytes()[..], &payload].concat());
        }
    }
    Files(files)
}

/// A floor of 4 x 4 m at y = 0 and a wall at z = -2, which face up and toward +z.
fn corner() -> Scene {
    scene_of(
        &[
            [[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]],
            [[-2.0, 0.0, -2.0], [2.0, 0.0, -2.0], [2.0, 3.0, -2.0], [-2.0, 3.0, -2.0]],
        ],
        0.75,
    )
}

/// The first layers that the rays of a camera see.
fn look(scene: &Scene, plan: &Plan, camera: &Camera, stop: &Stop) -> Result<Looked, Stopped> {
    let PictureSize { width, height } = camera.size();
    Stage::new(scene, plan, camera).look(camera, 0..height, &vec![Walk::Eye; (width * height) as usize], stop)
}

/// The nearest that each ray sees.
fn nearest(looked: &Looked) -> Vec<Option<Seen>> {
    let mut from = 0;
    let first = |count: &u8| {
        from += usize::from(*count);
        (*count > 0).then(|| looked.layers[from - usize::from(*count)])
    };
    looked.counts.iter().map(first).collect()
}

fn size(width: u32, height: u32) -> PictureSize {
    PictureSize::new(width, height).unwrap()
}

fn camera_at(eye: [f32; 3], target: [f32; 3], size: PictureSize) -> Camera {
    Camera::new(Vec3::from_array(eye), Vec3::from_array(target), 45.0, size).unwrap()
}
