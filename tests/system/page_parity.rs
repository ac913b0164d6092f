//! The page against the reference renderer: linear radiance of every pixel, for each scheme, on both software GPUs.
//!
//! Compared in levels of 1/255 as displayed. Pixels where page and reference see different charts are edges, where a triangle's border falls between
//! two roundings; they are counted, and are few. On a failure the figures of all schemes are in the message.

use crate::{
    browser::{GPUS, Script},
    harness::{View, bake_room},
};
use glam::Vec3;
use kiln_coordinator::preview::{Camera, Light, Mode, Origin, PackageFiles, PictureSize, render};
use kiln_proto::{
    format::{
        container,
        stream::{Fault, ReadAt, ReadError, Trust},
    },
    math,
    plan::Plan,
    scene::Scene,
};
use std::{fs, path::Path};
use tempfile::TempDir;

const SIZE: (u32, u32) = (320, 240);

/// From outside, along the walls, at grazing angles, and close to the glossy floor.
const CAMERAS: [(Vec3, Vec3); 5] = [
    (Vec3::new(16.3, 17.2, 16.3), Vec3::new(5.0, 3.7, 5.0)),
    (Vec3::new(9.0, 3.0, 9.0), Vec3::new(2.0, 1.5, 2.0)),
    (Vec3::new(5.0, 0.4, 9.5), Vec3::new(5.0, 0.0, 2.0)),
    (Vec3::new(1.5, 1.2, 8.0), Vec3::new(8.0, 2.0, 1.0)),
    (Vec3::new(0.3, 4.0, 9.0), Vec3::new(3.0, 1.0, 0.5)),
];
const FOV: f32 = 45.0;

/// A package's files in memory.
struct Files<'a>(&'a Path);

struct InMemory {
    name: String,
    bytes: Vec<u8>,
}

impl ReadAt for InMemory {
    fn name(&self) -> &str {
        &self.name
    }

    fn length(&self) -> u64 {
        self.bytes.len() as u64
    }

    fn read_exact_at(&self, at: u64, out: &mut [u8]) -> Result<(), Fault> {
        out.copy_from_slice(&self.bytes[at as usize..at as usize + out.len()]);
        Ok(())
    }
}

impl PackageFiles for Files<'_> {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        Ok(Box::new(InMemory { name: path.into(), bytes: fs::read(self.0.join(path)).unwrap() }))
    }
}

struct Reference {
    scene: Scene,
    plan: Plan,
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
}

impl Reference {
    fn open(package: &Path) -> Self {
        let (scene, plan) = container::parse(&fs::read(package.join(container::PATH)).unwrap()).unwrap();
        Self { scene, plan }
    }

    /// Compares the float32 RGBA rows of the page, bottom row first and radiance in units of 2^-stops, with the reference.
    fn compare(&self, package: &Path, origin: Origin, camera: usize, page: &[u8]) -> Difference {
        let size = PictureSize::new(SIZE.0, SIZE.1).unwrap();
        let (eye, target) = CAMERAS[camera];
        let files = Files(package);
        let mut light = Light::new(&files, &self.scene, &self.plan, origin, Trust::Hashed);
        let frame = render(&self.scene, &self.plan, &mut light, &Camera::new(eye, target, FOV, size).unwrap(), Mode::LightField).unwrap();
        let factor = self.plan.probe.as_ref().unwrap().exposure.factor();
        let level = |linear: f32| math::srgb_oetf(linear.clamp(0.0, 1.0)) * 255.0;
        let mut difference = Difference::default();
        for (k, pixel) in frame.pixels().iter().enumerate() {
            let (x, y) = (k % SIZE.0 as usize, k / SIZE.0 as usize);
            let at = ((SIZE.1 as usize - 1 - y) * SIZE.0 as usize + x) * 16;
            let shown: [f32; 4] = std::array::from_fn(|c| f32::from_le_bytes(page[at + c * 4..at + c * 4 + 4].try_into().unwrap()));
            if shown[3] as u32 != pixel.chart {
                difference.edges += 1;
            } else if pixel.chart > 0 {
                difference.compared += 1;
                for (page, reference) in shown.iter().zip(pixel.radiance.to_array()) {
                    let d = (level(*page) - level(reference * factor)).abs();
                    difference.max = difference.max.max(d);
                    difference.sum += f64::from(d);
                }
            }
        }
        difference
    }
}

/// Runs the page on `gpu` and compares every scheme; the largest differences allowed, levels, of exact and of hardware filtering.
fn compare_on(gpu: &str, raw: &str, exact: f32, hardware: f32) {
    let dir = TempDir::new().unwrap();
    let (package, out) = (dir.path().join("room"), dir.path().join("out"));
    fs::create_dir(&out).unwrap();
    bake_room(&package, &["--directions", "20x20", "--raw", raw]);
    let (view, reference) = (View::start(&package), Reference::open(&package));
    let cameras: Vec<_> =
        CAMERAS.iter().map(|(eye, target)| serde_json::json!({"eye": eye.to_array(), "target": target.to_array(), "fov": FOV})).collect();
    let cameras = serde_json::Value::from(cameras).to_string();
    let (width, height) = (SIZE.0.to_string(), SIZE.1.to_string());
    let script = Script::start("parity.mjs", [&view.url, gpu, out.to_str().unwrap(), &width, &height, &cameras]);
    let mut report = String::new();
    let mut bad = false;
    for said in script.finish() {
        let (scheme, filter) = (said["scheme"].as_str().unwrap(), said["filter"].as_str().unwrap());
        let origin = if scheme == "raw" { Origin::Raw } else { Origin::Codec };
        let allowed = if filter == "exact" { exact } else { hardware };
        for camera in 0..CAMERAS.len() {
            let page = fs::read(out.join(format!("{scheme}-{filter}-{camera}.f32"))).unwrap();
            let d = reference.compare(&package, origin, camera, &page);
            let mean = d.sum / (3 * d.compared.max(1)) as f64;
            let line = format!(
                "{gpu} {raw} {scheme} {filter} camera {camera}: {} pixels, largest difference {:.3}, mean {mean:.4}, {} at edges\n",
                d.compared, d.max, d.edges
            );
            print!("{line}");
            report += &line;
            // An eighth of the picture at least shows something, and under one in a hundred of its pixels is an edge.
            bad |= d.max > allowed || d.compared < (SIZE.0 * SIZE.1 / 8) as usize || d.edges > d.compared / 100;
        }
        println!("{said}");
    }
    assert_eq!(report.lines().count(), 5 * CAMERAS.len(), "{report}");
    assert!(!bad, "{report}");
}

#[test]
fn page_and_reference_agree_on_swiftshader() {
    compare_on(GPUS[0], "u8", 1.0, 2.0);
}

#[test]
fn page_and_reference_agree_on_llvmpipe() {
    compare_on(GPUS[1], "u8", 1.0, 2.0);
}

#[test]
fn page_and_reference_agree_on_linear_raw_radiance() {
    compare_on(GPUS[1], "f32", 1.0, 2.0);
}
