//! `kiln encode`: another encoding of a package that kept its raw radiance, without baking again.
//!
//! It runs the worker's encoder on the kept samples and the coordinator's assembler on the segments, one tile at a time, so the files are
//! those that a bake with these settings and the same exposure would have made, byte for byte, and memory does not grow with the package.

use crate::package::{Package, RawFiles, RawTexels, ToolError, Trust, io_fault, runs};
use kiln_coordinator::assemble::{SourceError, SurfaceReport, assemble_surface, write_manifest};
use kiln_proto::{
    plan::Plan,
    settings::{Codec, RawFormat, RuleName, SettingsPatch, WalkMode},
    texel::SurfaceRaster,
    tile::TileIndex,
};
use kiln_worker::encode::{encode_coded_tile, encode_tile};
use serde::de::DeserializeOwned;
use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

/// Another encoding of a package that kept its raw radiance.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The package's folder.
    pub(crate) package: PathBuf,
    /// The new package's folder, which must not exist or be empty.
    #[arg(short, long)]
    pub(crate) out: PathBuf,
    /// The codec: pwl.
    #[arg(long, value_parser = word::<Codec>)]
    pub(crate) codec: Option<Codec>,
    /// How samples are picked: bounded, cumulative or thesis. Without rule, eps and threshold: as in the package.
    #[arg(long, value_parser = word::<RuleName>)]
    pub(crate) rule: Option<RuleName>,
    /// The largest error of the bounded rule, in levels of 1/255.
    #[arg(long)]
    pub(crate) eps: Option<u8>,
    /// T of the thesis and cumulative rules.
    #[arg(long)]
    pub(crate) threshold: Option<u16>,
    /// The order that directions are walked in: theta or phi (fastest), or auto: as the Probe phase chose.
    #[arg(long, value_parser = word::<WalkMode>)]
    pub(crate) walk: Option<WalkMode>,
    /// Keep raw radiance in the new package, too: u8 or f32.
    #[arg(long, value_parser = word::<RawFormat>)]
    pub(crate) raw: Option<RawFormat>,
}

/// One of the words that settings files use.
fn word<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_value(text.into()).map_err(|e| e.to_string())
}

/// Writes the new package and prints its hash to `out`.
///
/// # Errors
/// A package without raw radiance or with less than asked for, a folder that is not empty, settings that contradict each other.
pub(crate) fn run(args: &Args, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    let package = Package::open(&args.package)?;
    let plan = new_plan(&package, args)?;
    let existed = prepare(&args.out)?;
    let published = write_package(&package, &plan, &args.out).inspect_err(|_| clean(&args.out, existed))?;
    if json {
        let report = serde_json::json!({ "package": args.out, "package_hash": published.hash, "totals": published.manifest.totals });
        writeln!(out, "{report}")?;
    } else {
        let t = published.manifest.totals;
        writeln!(out, "{}: {}, ratio {:.3}\npackage {}", args.out.display(), plan.settings.rule, t.ratio, published.hash)?;
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
    if args.rule.is_some() || args.eps.is_some() || args.threshold.is_some() {
        let patch = SettingsPatch { rule: args.rule, eps: args.eps, threshold: args.threshold, ..SettingsPatch::default() };
        plan.settings.rule = patch.rule()?;
    }
    match args.walk {
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

/// Makes sure that the folder is there and empty; tells whether it was there.
fn prepare(dir: &Path) -> Result<bool, ToolError> {
    let Ok(mut entries) = fs::read_dir(dir) else {
        return fs::create_dir_all(dir).map(|()| false).map_err(io_fault(dir));
    };
    if entries.next().is_some() {
        return Err(ToolError::Usage(format!("{} is not empty; name a folder that is, or that does not exist", dir.display())));
    }
    Ok(true)
}

/// Half a package is of no use. Failing to remove it must not hide why it is only half: the results are dropped on purpose.
fn clean(dir: &Path, existed: bool) {
    drop(fs::remove_dir_all(dir));
    if existed {
        drop(fs::create_dir(dir));
    }
}

fn write_package(package: &Package, plan: &Plan, out: &Path) -> Result<kiln_coordinator::assemble::Published, ToolError> {
    let reports = (0..package.scene.surfaces.len()).map(|s| encode_surface(package, plan, s, out)).collect::<Result<Vec<_>, _>>()?;
    Ok(write_manifest(out, &package.scene_bytes, plan, &reports)?)
}

fn encode_surface(package: &Package, plan: &Plan, surface: usize, out: &Path) -> Result<SurfaceReport, ToolError> {
    let (raw, raster) = (package.raw(surface, Trust::Checksum)?, package.raster(surface));
    let first = plan.first_tile(surface).0;
    let mut source = |index: usize| -> Result<Vec<u8>, SourceError> {
        Ok(segment(plan, surface, TileIndex(first + index as u64), &plan.surfaces[surface].tiles[index], &raster, &raw)?)
    };
    Ok(assemble_surface(plan, surface, &package.scene.surfaces[surface].file_stem, &mut source, out)?)
}

fn segment(
    plan: &Plan,
    surface: usize,
    tile: TileIndex,
    planned: &kiln_proto::plan::PlannedTile,
    raster: &SurfaceRaster,
    raw: &RawFiles,
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
