//! `kiln encode`: another encoding of a package that kept its raw radiance, without baking again.
//!
//! It runs the worker's encoder on the kept samples and the coordinator's assembler on the segments, one tile at a time, so the files are
//! those that a bake with these settings and the same exposure would have made, byte for byte, and memory does not grow with the package.

use crate::{
    bake_settings::{RuleArgs, word},
    fetch::{OutputFolder, check_target},
    package::{Package, Raw, ToolError, io_fault},
};
use kiln_coordinator::{
    assemble::{Published, SourceError, SurfaceReport, assemble_around, assemble_surface, write_manifest},
    blob::publish,
};
use kiln_proto::{
    format::{
        manifest,
        stream::{RawTexels, Trust, runs},
    },
    plan::Plan,
    settings::{Codec, RawFormat, SettingsPatch},
    texel::SurfaceRaster,
    tile::TileIndex,
};
use kiln_worker::encode::{encode_coded_tile, encode_tile};
use std::{
    io::Write,
    path::{Path, PathBuf},
};
use tempfile::TempPath;

/// Another encoding of a package that kept its raw radiance. What is not said stays as it is in the package, defaults of a bake or not;
/// but `--rule`, `--eps` and `--threshold` make a whole new rule together.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The package's folder.
    pub(crate) package: PathBuf,
    /// The new package's folder, which must not exist or be empty.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// The codec: pwl.
    #[arg(long, value_parser = word::<Codec>)]
    pub(crate) codec: Option<Codec>,
    #[command(flatten)]
    pub(crate) rule: RuleArgs,
    /// Keep raw radiance in the new package, too: u8 or f32.
    #[arg(long, value_parser = word::<RawFormat>)]
    pub(crate) raw: Option<RawFormat>,
}

/// Writes the new package and prints its hash to `out`.
///
/// # Errors
/// A package without raw radiance or with less than asked for, a folder that is not empty, settings that contradict each other.
pub(crate) fn run(args: &Args, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    let package = Package::open(&args.package)?;
    let plan = new_plan(&package, args)?;
    let published = write_package(&package, &plan, &args.output)?;
    if json {
        let report = serde_json::json!({ "package": args.output, "package_hash": published.hash, "totals": published.manifest.totals });
        writeln!(out, "{report}")?;
    } else {
        let t = published.manifest.totals;
        writeln!(out, "{}: {}, ratio {:.3}\npackage {}", args.output.display(), plan.settings.rule, t.ratio, published.hash)?;
    }
    Ok(())
}

/// The plan that a bake with the new settings would have made of the same scene.
fn new_plan(package: &Package, args: &Args) -> Result<Plan, ToolError> {
    let mut plan = package.plan.clone();
    let kept = plan.settings.raw.ok_or_else(|| ToolError::NoRaw { path: package.dir.clone() })?;
    if (kept, args.raw) == (RawFormat::U8, Some(RawFormat::F32)) {
        return Err(ToolError::Usage("the package keeps raw radiance in 8 bits only; --raw f32 cannot be made of it".into()));
    }
    plan.settings.raw = args.raw;
    plan.settings.codec = args.codec.unwrap_or(plan.settings.codec);
    let RuleArgs { rule, eps, threshold, walk } = args.rule;
    if rule.is_some() || eps.is_some() || threshold.is_some() {
        let patch = SettingsPatch { rule, eps, threshold, ..SettingsPatch::default() };
        plan.settings.rule = patch.rule()?;
    }
    match walk {
        None => {}
        Some(mode) if mode == plan.settings.walk => {}
        Some(mode) => {
            let walk = mode.fixed().ok_or_else(|| {
                ToolError::Usage(
                    "the package was baked with a fixed walk, so that `--walk auto` has nothing to choose by; say theta or phi".into(),
                )
            })?;
            plan.settings.walk = mode;
            plan.probe.iter_mut().flat_map(|p| &mut p.walks).for_each(|w| *w = walk);
        }
    }
    Ok(plan)
}

/// Writes everything into a hidden folder inside `to` and moves it into place when it is whole and on the disk, the manifest last: a
/// folder with a manifest holds a whole package, also after a power cut.
fn write_package(package: &Package, plan: &Plan, to: &Path) -> Result<Published, ToolError> {
    check_target(to)?;
    let folder = OutputFolder::create(to)?;
    let staging = folder.scratch(".kiln-encode-")?;
    let from = staging.path();
    let surfaces = 0..package.scene.surfaces.len();
    let reports = surfaces.map(|s| encode_surface(package, plan, s, from)).collect::<Result<Vec<_>, _>>()?;
    let published = write_manifest(from, &package.scene_bytes, plan, &reports)?;
    for name in published.manifest.files.iter().map(|f| f.path.as_str()).chain([manifest::PATH]) {
        let to = to.join(name);
        TempPath::try_from_path(from.join(name)).and_then(|staged| publish(staged, &to)).map_err(io_fault(&to))?;
    }
    Ok(published)
}

fn encode_surface(package: &Package, plan: &Plan, surface: usize, out: &Path) -> Result<SurfaceReport, ToolError> {
    let (raw, raster) = (package.raw(surface, Trust::Checksum)?, package.raster(surface));
    let first = plan.first_tile(surface).0;
    let mut source = |index: usize| -> Result<Vec<u8>, SourceError> {
        Ok(segment(plan, surface, TileIndex(first + index as u64), &plan.surfaces[surface].tiles[index], &raster, &raw)?)
    };
    let stem = &package.scene.surfaces[surface].file_stem;
    Ok(match package.holes(plan, surface)? {
        Some(holes) => assemble_around(&holes, stem, &mut source, out)?,
        None => assemble_surface(plan, surface, stem, &mut source, out)?,
    })
}

fn segment(
    plan: &Plan,
    surface: usize,
    tile: TileIndex,
    planned: &kiln_proto::plan::PlannedTile,
    raster: &SurfaceRaster,
    raw: &Raw,
) -> Result<Vec<u8>, ToolError> {
    let rows = raster.tile(planned.cell);
    let bytes = match raw.read(&runs(&rows, plan.surfaces[surface].size.width))? {
        RawTexels::Coded(samples) => encode_coded_tile(plan, tile, &rows, samples),
        RawTexels::Linear(radiance) => encode_tile(plan, tile, &rows, &radiance),
    };
    Ok(bytes?)
}

#[cfg(test)]
mod tests;
