//! `kiln decode`: the light field as numbers, for comparison with other renderers.

use crate::{
    bake_settings::word,
    package::{Coded, Package, Raw, ToolError, io_fault},
};
use kiln_coordinator::preview::Origin;
use kiln_proto::{
    codec::pwl::{Order, Sample, decode_row},
    format::stream::{RawTexels, ReadError, Run, Trust},
    texel::Texel,
    units::byte_to_radiance,
};
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

/// Linear radiance of texels toward all directions, as CSV.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The package's folder.
    pub(crate) package: PathBuf,
    /// The CSV file to write; `-` for standard output.
    #[arg(long)]
    pub(crate) out: PathBuf,
    /// Only this surface; without it, all that emit no light. May be given several times.
    #[arg(long)]
    pub(crate) surface: Vec<String>,
    /// This many random covered texels per surface; without it, all.
    #[arg(long)]
    pub(crate) texels: Option<u64>,
    /// Seed of the choice.
    #[arg(long, default_value_t = 0)]
    pub(crate) seed: u64,
    /// Where radiance comes from: raw for the kept samples, codec for the decoded files.
    #[arg(long, value_parser = word::<Origin>, default_value = "codec")]
    pub(crate) from: Origin,
}

const COLUMNS: [&str; 17] = ["surface", "tx", "ty", "i", "j", "px", "py", "pz", "nx", "ny", "nz", "dx", "dy", "dz", "r", "g", "b"];

/// Writes the CSV; what it came to is told on `out` where the CSV itself does not go there.
///
/// # Errors
/// A package that cannot be read, a surface that it does not have, raw radiance that it did not keep.
pub(crate) fn run(args: &Args, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    let package = Package::open(&args.package)?;
    let surfaces = chosen(&package, &args.surface)?;
    if args.out == Path::new("-") {
        return write(&package, args, &surfaces, &mut *out).map(drop);
    }
    let file = File::create(&args.out).map_err(io_fault(&args.out))?;
    let texels = write(&package, args, &surfaces, BufWriter::new(file))?;
    if json {
        writeln!(out, "{}", serde_json::json!({ "file": args.out, "surfaces": surfaces.len(), "texels": texels }))?;
    } else {
        writeln!(out, "{}: {texels} texels of {} surfaces", args.out.display(), surfaces.len())?;
    }
    Ok(())
}

fn chosen(package: &Package, names: &[String]) -> Result<Vec<usize>, ToolError> {
    if names.is_empty() {
        let dark = |(_, s): &(usize, &kiln_proto::scene::Surface)| !package.scene.is_emissive(s);
        return Ok(package.scene.surfaces.iter().enumerate().filter(dark).map(|(index, _)| index).collect());
    }
    let known = || package.scene.surfaces.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ");
    let index = |name: &String| {
        let found = package.scene.surface(name).map(|(index, _)| index);
        found.ok_or_else(|| ToolError::Usage(format!("the package has no surface `{name}`; it has {}", known())))
    };
    names.iter().map(index).collect()
}

/// Where the radiance of one surface is read from.
enum Source {
    Raw(Raw),
    Codec(Coded, Order),
}

impl Source {
    fn open(package: &Package, surface: usize, from: Origin) -> Result<Self, ToolError> {
        Ok(match from {
            Origin::Raw => Source::Raw(package.raw(surface, Trust::Checksum)?),
            Origin::Codec => Source::Codec(package.coded(surface, Trust::Checksum)?, package.order(surface)),
        })
    }

    /// The radiance of a texel in depth order, W/(sr m²).
    fn radiance(&self, package: &Package, surface: usize, texel: &Texel) -> Result<Vec<[f32; 3]>, ToolError> {
        let width = u64::from(package.plan.surfaces[surface].size.width);
        let run = Run { first: u64::from(texel.y) * width + u64::from(texel.x), count: 1 };
        let exposure = package.plan.exposure().factor();
        let linear = |samples: &[Sample]| samples.iter().map(|rgb| rgb.map(|v| byte_to_radiance(v, exposure))).collect();
        match self {
            Source::Raw(raw) => Ok(match raw.read(&[run])? {
                RawTexels::Coded(samples) => linear(&samples),
                RawTexels::Linear(values) => values.as_chunks().0.to_vec(),
            }),
            Source::Codec(files, order) => {
                let mut samples = vec![Sample::default(); order.len()];
                let name = || package.scene.surfaces[surface].name.clone();
                for kept in files.read(run)?.iter() {
                    decode_row(kept, order, &mut samples).map_err(|source| ReadError::Texel {
                        surface: name(),
                        x: texel.x,
                        y: texel.y,
                        source,
                    })?;
                }
                Ok(linear(&samples))
            }
        }
    }
}

fn write(package: &Package, args: &Args, surfaces: &[usize], out: impl Write) -> Result<u64, ToolError> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(COLUMNS)?;
    let mut written = 0;
    for surface in surfaces {
        written += write_surface(package, args, *surface, &mut csv)?;
    }
    csv.flush()?;
    Ok(written)
}

fn write_surface(package: &Package, args: &Args, surface: usize, csv: &mut csv::Writer<impl Write>) -> Result<u64, ToolError> {
    let (source, raster) = (Source::open(package, surface, args.from)?, package.raster(surface));
    let layout = &package.plan.surfaces[surface];
    let mut pick = Pick::new(args.seed, surface, args.texels.unwrap_or(layout.covered), layout.covered);
    let mut written = 0;
    for (y, x) in (0..layout.size.height).flat_map(|y| (0..layout.size.width).map(move |x| (y, x))) {
        let Some(texel) = raster.texel(x, y) else { continue };
        if pick.next() {
            let radiance = source.radiance(package, surface, &texel)?;
            write_texel(package, surface, &texel, &radiance, csv)?;
            written += 1;
        }
    }
    Ok(written)
}

fn write_texel(
    package: &Package,
    surface: usize,
    texel: &Texel,
    radiance: &[[f32; 3]],
    csv: &mut csv::Writer<impl Write>,
) -> Result<(), ToolError> {
    let grid = package.plan.settings.directions;
    for (depth, rgb) in (0..grid.len()).zip(radiance) {
        let toward = texel.frame.to_world(grid.direction(depth));
        let whole = [texel.x, texel.y, depth / grid.n_phi(), depth % grid.n_phi()];
        let real = [texel.position.to_array(), texel.frame.normal.to_array(), toward.to_array(), *rgb];
        csv.write_field(&package.scene.surfaces[surface].name)?;
        whole.iter().try_for_each(|v| csv.write_field(v.to_string()))?;
        real.as_flattened().iter().try_for_each(|v| csv.write_field(v.to_string()))?;
        csv.write_record(None::<&[u8]>)?;
    }
    Ok(())
}

/// Chooses `wanted` of `left` things, each set of them equally likely, while they go by (Knuth, TAOCP 3.4.2, algorithm S).
struct Pick {
    state: u64,
    wanted: u64,
    left: u64,
}

impl Pick {
    fn new(seed: u64, surface: usize, wanted: u64, all: u64) -> Self {
        // Surfaces have choices of their own: mixed, so that neighbouring seeds have nothing in common.
        let mut pick = Self { state: seed, wanted, left: all };
        pick.state = pick.roll() ^ surface as u64;
        pick
    }

    fn next(&mut self) -> bool {
        let chance = (u128::from(self.roll()) * u128::from(self.left)) >> 64;
        let chosen = chance < u128::from(self.wanted);
        self.left = self.left.saturating_sub(1);
        self.wanted -= u64::from(chosen);
        chosen
    }

    /// splitmix64 (Steele et al. 2014).
    fn roll(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

#[cfg(test)]
mod tests;
