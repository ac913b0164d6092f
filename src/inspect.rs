//! `kiln inspect`: sizes, ratios and errors of a package as the thesis tabulates them; `--verify` measures every claim again.

mod verify;

use crate::{
    package::{Package, ToolError},
    table::{Table, thousands},
};
use kiln_proto::format::{Kind, PackageHash, Sha256Hex, manifest, manifest::SurfaceRecord, package_hash};
use serde::Serialize;
use std::{io::Write, path::PathBuf};

/// The thesis's megabyte.
const THESIS_MB: f64 = 1_024_000.0;

/// Sizes, ratios and errors of a package.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The package's folder.
    pub(crate) package: PathBuf,
    /// Hash every file, decode every texel and, where raw radiance was kept, measure every error again.
    #[arg(long)]
    pub(crate) verify: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    package_hash: PackageHash,
    /// Absent without `--verify`.
    #[serde(skip_serializing_if = "Option::is_none")]
    verification: Option<&'a verify::Verification>,
    /// Names of the author's cameras, the one to begin with first.
    cameras: Vec<&'a str>,
    manifest: &'a manifest::Manifest,
}

/// Prints the tables, or JSON, to `out`.
///
/// # Errors
/// A package that cannot be read; with `--verify`, one that does not hold what it claims.
pub(crate) fn run(args: &Args, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    let package = Package::open(&args.package)?;
    let verification = args.verify.then(|| verify::verify(&package)).transpose()?;
    let hash = hash(&package);
    if json {
        let cameras = package.scene.cameras.iter().map(|c| c.name.as_str()).collect();
        let report = Report { package_hash: hash, verification: verification.as_ref(), cameras, manifest: &package.manifest };
        serde_json::to_writer_pretty(&mut *out, &report).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else {
        print(&package, hash, verification.as_ref(), out)?;
    }
    match verification.as_ref().map(|v| (v.differences.len(), v.differences.first())) {
        Some((count, Some(first))) => Err(ToolError::Unverified { count, first: first.clone() }),
        _ => Ok(()),
    }
}

/// The hash of the package by its manifest.
fn hash(package: &Package) -> PackageHash {
    let listed = package.manifest.files.iter().map(|f| (f.path.as_str(), f.sha256));
    package_hash(listed.chain([(manifest::PATH, Sha256Hex::of(&package.manifest_bytes))]))
}

fn print(package: &Package, hash: PackageHash, verification: Option<&verify::Verification>, out: &mut dyn Write) -> std::io::Result<()> {
    let m = &package.manifest;
    writeln!(out, "scene    {}\npackage  {hash}", m.scene)?;
    writeln!(
        out,
        "coding   {}, {} directions, exposure {:+.3} EV, {} ppm clipped\n",
        m.settings.rule, m.settings.directions, m.exposure.stops, m.exposure.clipped_ppm
    )?;
    sizes(package, "MB", &|n| format!("{:.3}", n as f64 / THESIS_MB)).write(out)?;
    sizes(package, "bytes", &thousands).write(out)?;
    errors(package).write(out)?;
    let t = &m.totals;
    writeln!(
        out,
        "{} covered texels, raw {} bytes, coded {} bytes, ratio {:.3}",
        thousands(t.covered),
        thousands(t.raw_bytes),
        thousands(t.coded_bytes),
        t.ratio
    )?;
    writeln!(out, "1 MB is the thesis's 1,024,000 bytes; the ratio is 3 bytes x directions x covered texels over the four coded files.")?;
    if !package.scene.cameras.is_empty() {
        let names: Vec<&str> = package.scene.cameras.iter().map(|c| c.name.as_str()).collect();
        writeln!(out, "cameras: {}", names.join(", "))?;
    }
    for s in m.surfaces.iter().filter(|s| s.encoding.grew) {
        writeln!(out, "{} grew: its light is too varied for this rule.", s.name)?;
    }
    holes(package, out)?;
    if let Some(v) = verification {
        writeln!(out)?;
        v.differences.iter().try_for_each(|d| writeln!(out, "DIFFERS  {d}"))?;
        let errors = if v.errors_measured { "errors measured again from raw" } else { "errors not measured: no raw radiance was kept" };
        let verdict = if v.differences.is_empty() { "verified" } else { "NOT VERIFIED" };
        writeln!(out, "{verdict}: {} files hashed, {} texels decoded, {errors}", v.files, thousands(v.texels))?;
    }
    Ok(())
}

/// Lists the tiles that could not be baked.
fn holes(package: &Package, out: &mut dyn Write) -> std::io::Result<()> {
    for (surface, layout) in package.manifest.surfaces.iter().zip(&package.plan.surfaces) {
        for h in &surface.holes {
            let (right, top) = (h.x.saturating_add(h.width), h.y.saturating_add(h.height));
            writeln!(
                out,
                "hole     {} tile {}, columns {} to {right} and rows {} to {top} ({} covered texels): {}",
                surface.name,
                h.tile,
                h.x,
                h.y,
                thousands(h.covered.into()),
                h.reason
            )?;
        }
        if !surface.holes.is_empty() && surface.holes.len() == layout.tiles.len() {
            writeln!(out, "{} has no tile at all: it is black.", surface.name)?;
        }
    }
    Ok(())
}

fn sizes(package: &Package, unit: &str, show: &dyn Fn(u64) -> String) -> Table {
    let title = format!("surface ({unit})");
    let mut table = Table::new(&[&title, "texture", "raw", ".mtex", ".mtsp", ".mti", ".mtnc", ".mtm", "coded", "ratio"]);
    for s in &package.manifest.surfaces {
        let size = |kind: Kind| {
            let path = kind.path(&s.file_stem);
            package.manifest.files.iter().find(|f| f.path == path).map_or("-".into(), |f| show(f.bytes))
        };
        let raw = s.size.texels() * u64::from(s.grid.len()) * 3;
        let mut row = vec![s.name.clone(), s.size.to_string(), show(raw)];
        row.extend(Kind::ALL.map(size));
        row.extend([show(s.encoding.coded_bytes), format!("{:.3}", s.encoding.ratio)]);
        table.row(row);
    }
    table
}

fn errors(package: &Package) -> Table {
    let titles = ["surface (of 255)", "covered", "kept/texel", "colours", "walk", "average", "of differing", "p99.9", "max"];
    let mut table = Table::new(&titles);
    for s in &package.manifest.surfaces {
        table.row(error_row(s));
    }
    table
}

fn error_row(s: &SurfaceRecord) -> Vec<String> {
    let e = &s.encoding.errors;
    let colours = if s.encoding.colour_bits == 24 { "24 bits".into() } else { thousands(s.encoding.colours.into()) };
    vec![
        s.name.clone(),
        thousands(s.covered),
        format!("{:.1}", s.encoding.kept_samples as f64 / s.covered.max(1) as f64),
        colours,
        format!("{:?}", s.walk).to_lowercase(),
        format!("{:.4}", e.average),
        format!("{:.4}", e.average_differing),
        e.p99_9.to_string(),
        e.max.to_string(),
    ]
}

#[cfg(test)]
mod tests;
