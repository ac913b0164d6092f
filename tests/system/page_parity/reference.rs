//! What the reference sees: the renderer's pictures, and the small reader's samples for single look-ups.

use super::{
    FOV, Look, SIZE,
    difference::{Difference, Expected, level},
};
use glam::Vec3;
use kiln_coordinator::preview::{BACKGROUND, Camera, Light, Mode, Origin, PackageFiles, PictureSize, render};
use kiln_proto::{
    codec::pwl::Order,
    format::{
        Kind, container, header,
        stream::{InMemory, ReadAt, ReadError, Trust},
        surface::SurfaceFiles,
    },
    lookup,
    plan::Plan,
    scene::Scene,
    settings::RawFormat,
    units::{Rgb, byte_to_radiance},
};
use std::{fs, path::Path};

/// The files of a package on disk, read whole.
struct Files<'a>(&'a Path);

impl PackageFiles for Files<'_> {
    fn open(&self, path: &str) -> Result<Box<dyn ReadAt>, ReadError> {
        Ok(Box::new(InMemory { name: path.into(), bytes: fs::read(self.0.join(path)).unwrap() }))
    }
}

/// The decoded samples of a surface, in units of 2^-stops; `None` for texels that hold none.
type Samples = Vec<Option<Vec<Rgb>>>;

pub(super) struct Reference {
    scene: Scene,
    plan: Plan,
    factor: f32,
    codec: Vec<Samples>,
    raw: Vec<Samples>,
}

impl Reference {
    pub(super) fn open(package: &Path) -> Self {
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
    pub(super) fn compare_lookups(&self, origin: Origin, found: &[[f32; 4]], lookups: &[[f32; 4]]) -> Difference {
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
            difference.add(page.iter().zip(reference).map(|(page, reference)| (level(*page) - level(reference)).abs()), 1.0);
        }
        difference
    }

    /// What the renderer sees in each pixel: `within` x `within` rays.
    pub(super) fn picture(&self, package: &Path, origin: Origin, (eye, target): Look, within: u32) -> Vec<Expected> {
        let size = PictureSize::new(SIZE.0 * within, SIZE.1 * within).unwrap();
        let files = Files(package);
        let mut light = Light::new(&files, &self.scene, &self.plan, origin, Trust::Hashed);
        let frame = render(&self.scene, &self.plan, &mut light, &Camera::new(eye, target, FOV, size).unwrap(), Mode::LightField).unwrap();
        let mut out = vec![Expected::default(); (SIZE.0 * SIZE.1) as usize];
        for (k, pixel) in frame.pixels().iter().enumerate() {
            let (x, y) = (k as u32 % size.width / within, k as u32 / size.width / within);
            // The page's floats hold light of the scene alone.
            let own = pixel.radiance + BACKGROUND * pixel.background * -1.0;
            out[(y * SIZE.0 + x) as usize].add(pixel.chart, (own * self.factor).to_array().map(level));
        }
        out
    }
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
