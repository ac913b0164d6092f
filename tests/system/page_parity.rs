//! The page against the reference: look-ups and pictures, for each scheme, on both software GPUs.
//!
//! *Look-ups*: the shader says for every pixel what it looks up (texture coordinate, direction) and what it finds; the Rust decoder looks up
//! the same. No pixel is left out. *Pictures*: the page's radiance against `kiln render`'s own ray casting. Pixels where the two see different
//! charts are edges, where a triangle's border falls between two roundings; they are counted, and are few. llvmpipe places what it draws to
//! 1/256 of a pixel, so that its pictures are held to the same bounds. SwiftShader snaps corners to 1/16, and noise is not the same a
//! sixteenth of a pixel further: there, a pixel must have a value that the reference has somewhere within it, give or take a level; one in a
//! thousand may not, where many texels fall into a pixel.
//!
//! Differences are in levels of 1/255 as displayed. On a failure the figures of all schemes are in the message.

use crate::{
    browser::{GPUS, Script},
    harness::{View, bake_room},
    made::{ball, make_package, square},
};
use glam::Vec3;
use kiln_coordinator::preview::{Camera, Light, Mode, Origin, PackageFiles, PictureSize, render};
use kiln_proto::{
    codec::pwl::Order,
    format::{
        Kind, container, header,
        stream::{InMemory, ReadAt, ReadError, Trust},
        surface::SurfaceFiles,
    },
    lookup, math,
    plan::Plan,
    scene::{Material, Scene},
    settings::RawFormat,
    units::{Rgb, byte_to_radiance},
};
use std::{collections::BTreeMap, fs, path::Path};
use tempfile::TempDir;

const SIZE: (u32, u32) = (320, 240);

/// Eye and target.
type Look = (Vec3, Vec3);

/// From outside, along the walls, at grazing angles, and close to the glossy floor.
const ROOM: [Look; 5] = [
    (Vec3::new(16.3, 17.2, 16.3), Vec3::new(5.0, 3.7, 5.0)),
    (Vec3::new(9.0, 3.0, 9.0), Vec3::new(2.0, 1.5, 2.0)),
    (Vec3::new(5.0, 0.4, 9.5), Vec3::new(5.0, 0.0, 2.0)),
    (Vec3::new(1.5, 1.2, 8.0), Vec3::new(8.0, 2.0, 1.0)),
    (Vec3::new(0.3, 4.0, 9.0), Vec3::new(3.0, 1.0, 0.5)),
];
/// A ball from three sides, and so near that its facets fill the view.
const BALL: [Look; 4] = [
    (Vec3::new(0.5, 1.0, 4.0), Vec3::ZERO),
    (Vec3::new(-3.0, -0.5, 0.2), Vec3::ZERO),
    (Vec3::new(0.3, 3.5, -0.4), Vec3::ZERO),
    (Vec3::new(0.9, 0.9, 0.9), Vec3::new(0.2, 0.1, 0.6)),
];
const FOV: f32 = 45.0;

/// The files of a package on disk, read whole.
struct Files<'a>(&'a Path);

impl PackageFiles for Files<'_> {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        Ok(Box::new(InMemory { name: path.into(), bytes: fs::read(self.0.join(path)).unwrap() }))
    }
}

/// What two pictures of one view differ by.
#[derive(Debug, Default)]
struct Difference {
    compared: usize,
    /// Pixels that see different charts.
    edges: usize,
    /// The largest difference of a channel, levels.
    max: f32,
    sum: f64,
    /// Pixels that are off by more than a level.
    off: usize,
}

impl Difference {
    /// Adds a pixel: by how many levels each channel is off.
    fn add(&mut self, channels: impl Iterator<Item = f32>) {
        self.compared += 1;
        let mut worst = 0.0f32;
        for d in channels {
            worst = worst.max(d);
            self.sum += f64::from(d);
        }
        self.max = self.max.max(worst);
        self.off += usize::from(worst > 1.0);
    }

    fn mean(&self) -> f64 {
        self.sum / (3 * self.compared.max(1)) as f64
    }
}

/// The decoded samples of a surface, in units of 2^-stops; `None` for texels that hold none.
type Samples = Vec<Option<Vec<Rgb>>>;

struct Reference {
    scene: Scene,
    plan: Plan,
    factor: f32,
    codec: Vec<Samples>,
    raw: Vec<Samples>,
}

impl Reference {
    fn open(package: &Path) -> Self {
        let (scene, plan) = container::parse(&fs::read(package.join(container::PATH)).unwrap()).unwrap();
        let factor = plan.probe.as_ref().unwrap().exposure.factor();
        let (codec, raw) = (0..scene.surfaces.len()).map(|surface| samples(package, &scene, &plan, surface, factor)).unzip();
        Self { scene, plan, factor, codec, raw }
    }

    /// The surface that a chart of the whole scene, counted from 1, belongs to.
    fn surface_of(&self, chart: u32) -> usize {
        let mut before = 0;
        let mut ends = self.plan.surfaces.iter().map(|s| {
            before += 1 + s.charts.iter().max().copied().unwrap_or(0);
            before
        });
        ends.position(|end| chart <= end).unwrap()
    }

    /// Compares what the page found with what the Rust decoder finds for the same look-ups.
    fn compare_lookups(&self, origin: Origin, found: &[[f32; 4]], lookups: &[[f32; 4]]) -> Difference {
        let mut difference = Difference::default();
        for (page, [u, v, x, y]) in found.iter().zip(lookups).filter(|(page, _)| page[3] > 0.0) {
            let surface = self.surface_of(page[3] as u32);
            let toward = Vec3::new(*x, *y, (1.0 - x * x - y * y).max(0.0).sqrt());
            let samples = match origin {
                Origin::Codec => &self.codec[surface],
                Origin::Raw => &self.raw[surface],
            };
            let (size, grid) = (self.plan.surfaces[surface].size, self.plan.settings.directions);
            let sample = |texel: u64, depth: u32| samples[texel as usize].as_ref().map(|all| all[depth as usize]);
            let reference = lookup::radiance([*u, *v], toward, size, grid, sample).unwrap_or_default().to_array();
            difference.add(page.iter().zip(reference).map(|(page, reference)| (level(*page) - level(reference)).abs()));
        }
        difference
    }

    /// What the renderer sees in each pixel: `within` x `within` rays.
    fn picture(&self, package: &Path, origin: Origin, (eye, target): Look, within: u32) -> Vec<Expected> {
        let size = PictureSize::new(SIZE.0 * within, SIZE.1 * within).unwrap();
        let files = Files(package);
        let mut light = Light::new(&files, &self.scene, &self.plan, origin, Trust::Hashed);
        let frame = render(&self.scene, &self.plan, &mut light, &Camera::new(eye, target, FOV, size).unwrap(), Mode::LightField).unwrap();
        let mut out = vec![Expected::default(); (SIZE.0 * SIZE.1) as usize];
        for (k, pixel) in frame.pixels().iter().enumerate() {
            let (x, y) = (k as u32 % size.width / within, k as u32 / size.width / within);
            out[(y * SIZE.0 + x) as usize].add(pixel.chart, (pixel.radiance * self.factor).to_array().map(level));
        }
        out
    }
}

/// What a pixel may show: the span of each channel, levels, and the charts that are seen in it.
#[derive(Debug, Clone, Default)]
struct Expected {
    charts: Vec<u32>,
    span: [Option<(f32, f32)>; 3],
}

impl Expected {
    fn add(&mut self, chart: u32, levels: [f32; 3]) {
        if !self.charts.contains(&chart) {
            self.charts.push(chart);
        }
        for (span, v) in self.span.iter_mut().zip(levels) {
            let (low, high) = span.unwrap_or((v, v));
            *span = Some((low.min(v), high.max(v)));
        }
    }
}

/// Compares a picture of the page with what its pixels may show.
fn compare_pictures(expected: &[Expected], page: &[[f32; 4]]) -> Difference {
    let mut difference = Difference::default();
    for (k, pixel) in expected.iter().enumerate() {
        let (x, y) = (k % SIZE.0 as usize, k / SIZE.0 as usize);
        let shown = &page[(SIZE.1 as usize - 1 - y) * SIZE.0 as usize + x];
        if pixel.charts != [shown[3] as u32] {
            difference.edges += 1;
        } else if shown[3] > 0.0 {
            let outside =
                |(v, span): (&f32, &Option<(f32, f32)>)| span.map_or(0.0, |(low, high)| (low - level(*v)).max(level(*v) - high).max(0.0));
            difference.add(shown.iter().zip(&pixel.span).map(outside));
        }
    }
    difference
}

/// As displayed, 0 to 255.
fn level(linear: f32) -> f32 {
    math::srgb_oetf(linear.clamp(0.0, 1.0)) * 255.0
}

/// All samples of a surface by the small reader: of the codec, and raw.
fn samples(package: &Path, scene: &Scene, plan: &Plan, surface: usize, factor: f32) -> (Samples, Samples) {
    let stem = &scene.surfaces[surface].file_stem;
    let file = |kind: Kind| fs::read(package.join(kind.path(stem))).unwrap();
    let (mtsp, mti, mtnc, mtm, mtex) = (file(Kind::Mtsp), file(Kind::Mti), file(Kind::Mtnc), file(Kind::Mtm), file(Kind::Mtex));
    let files = SurfaceFiles::parse(&mtsp, &mti, &mtnc, &mtm).unwrap();
    let grid = plan.settings.directions;
    let order = Order::new(grid, plan.probe.as_ref().unwrap().walks[surface]);
    let linear = |rgb: [u8; 3]| Rgb::from(rgb.map(|byte| byte_to_radiance(byte, 1.0)));
    let texels = plan.surfaces[surface].size.texels() as usize;
    let codec: Samples = (0..texels).map(|t| Some(files.decode(t, &order).unwrap()?.into_iter().map(linear).collect())).collect();
    let values = &mtex[header::BYTES..];
    let one = |k: usize| match plan.settings.raw {
        Some(RawFormat::U8) => linear(values.as_chunks::<3>().0[k]),
        _ => linear_at(values, k) * factor,
    };
    let directions = grid.len() as usize;
    let raw =
        codec.iter().enumerate().map(|(t, c)| c.as_ref().map(|_| (t * directions..(t + 1) * directions).map(one).collect())).collect();
    (codec, raw)
}

/// The k-th of little-endian f32 triples.
fn linear_at(values: &[u8], k: usize) -> Rgb {
    let triple = &values.as_chunks::<12>().0[k];
    Rgb::from(std::array::from_fn::<f32, 3, _>(|c| f32::from_le_bytes(triple.as_chunks::<4>().0[c])))
}

/// A file of float32 RGBA pixels.
fn floats(path: &Path) -> Vec<[f32; 4]> {
    let bytes = fs::read(path).unwrap();
    bytes.as_chunks::<16>().0.iter().map(|p| std::array::from_fn(|c| f32::from_le_bytes(p.as_chunks::<4>().0[c]))).collect()
}

/// Bakes the room and compares it.
fn compare_room(gpu: &str, raw: &str, within: u32) {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("room");
    bake_room(&package, &["--directions", "20x20", "--raw", raw]);
    compare_on(gpu, &package, &ROOM, within);
}

/// Runs the page on `gpu` and compares every scheme: at most one level with exact filtering, two where the GPU filters. Pictures are compared with
/// `within` x `within` rays a pixel: one where the GPU places exactly what it draws.
fn compare_on(gpu: &str, package: &Path, looks: &[Look], within: u32) {
    let dir = TempDir::new().unwrap();
    let out = dir.path();
    let (view, reference) = (View::start(package), Reference::open(package));
    let camera = |(eye, target): &Look| serde_json::json!({"eye": eye.to_array(), "target": target.to_array(), "fov": FOV});
    let cameras = serde_json::Value::from(looks.iter().map(camera).collect::<Vec<_>>()).to_string();
    let (width, height) = (SIZE.0.to_string(), SIZE.1.to_string());
    let script = Script::start("parity.mjs", [&view.url, gpu, out.to_str().unwrap(), &width, &height, &cameras]);
    let (mut report, mut bad, mut pictures) = (String::new(), false, BTreeMap::new());
    for said in script.finish() {
        println!("{gpu} {said}");
        let (scheme, filter) = (said["scheme"].as_str().unwrap(), said["filter"].as_str().unwrap());
        let origin = if scheme == "raw" { Origin::Raw } else { Origin::Codec };
        let allowed = if filter == "exact" { 1.0 } else { 2.0 };
        for (camera, look) in looks.iter().enumerate() {
            let file = |what: &str| floats(&out.join(format!("{scheme}-{filter}-{camera}.{what}")));
            let page = file("radiance");
            let found = reference.compare_lookups(origin, &page, &file("lookup"));
            let expected =
                pictures.entry((origin == Origin::Raw, camera)).or_insert_with(|| reference.picture(package, origin, *look, within));
            let shown = compare_pictures(expected, &page);
            let line = format!(
                "{gpu} {scheme} {filter} camera {camera}: look-ups: {} pixels, largest difference {:.3}, mean {:.4}; \
                 picture: largest {:.3}, mean {:.4}, {} off by more than one, {} of {} pixels at edges\n",
                found.compared,
                found.max,
                found.mean(),
                shown.max,
                shown.mean(),
                shown.off,
                shown.edges,
                shown.edges + shown.compared
            );
            print!("{line}");
            report += &line;
            bad |= found.max > allowed || found.compared < (SIZE.0 * SIZE.1 / 8) as usize;
            // Of all pixels few are edges: more where any of several rays makes one.
            // Where a pixel holds many texels, several rays do not find all that it may show.
            bad |= if within == 1 { shown.max > allowed } else { shown.off * 1_000 > shown.compared };
            bad |= shown.edges * 50 > (shown.edges + shown.compared) * within as usize;
        }
    }
    assert_eq!(report.lines().count(), 5 * looks.len(), "{report}");
    assert!(!bad, "{report}");
}

#[test]
fn page_and_reference_agree_on_swiftshader() {
    compare_room(GPUS[0], "u8", 5);
}

#[test]
fn page_and_reference_agree_on_llvmpipe() {
    compare_room(GPUS[1], "u8", 1);
}

#[test]
fn page_and_reference_agree_on_linear_raw_radiance() {
    compare_room(GPUS[1], "f32", 1);
}

/// Normals and tangents are interpolated in the shader as in the reference: highlights of a coarse ball show any difference.
#[test]
fn page_and_reference_agree_on_smooth_surfaces() {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("ball");
    let mut scene = Scene { materials: vec![Material::matt("gloss", Rgb::splat(0.5))], ..Scene::empty() };
    let (ball, wall) = (ball(&mut scene, "ball", 0, [0.0; 3], 1.0, 6), square(&mut scene, "wall", 0, [0.0, 0.0, -1.5], 2.0));
    scene.surfaces = vec![ball, wall];
    make_package(&package, &scene, "20x20", |_, texel, toward| {
        let gloss = (0..4).fold(1.0, |product: f32, _| product * toward.dot(Vec3::new(0.6, 0.64, 0.48)).max(0.0));
        [0.05 + gloss, 0.2 + 0.5 * texel.frame.normal.y, 0.4 + 0.3 * toward.x].map(|v| v.clamp(0.0, 1.0))
    });
    compare_on(GPUS[1], &package, &BALL, 1);
}
