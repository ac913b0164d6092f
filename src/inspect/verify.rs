//! Measuring a package again: files are hashed, every texel is decoded, and from what was found the manifest is written anew with the
//! coordinator's own function. Whatever differs from the manifest in the package is named by its JSON path, so a claim that is added to the
//! manifest later is verified without a line here.

mod files;

use crate::package::{Coded, Package, Raw, ToolError};
use kiln_coordinator::assemble::{Hole, Holes, SurfaceReport, describe};
use kiln_proto::{
    codec::pwl::{ErrorStats, Kept, Order, Sample, decode_row},
    format::{
        FileRecord, container,
        stream::{ReadError, Run, Trust, runs},
    },
    settings::{Footprint, Rule},
    texel::{Row, SurfaceRaster},
};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;

/// How far a mean may be off, relatively: the last digits of a number that was text in between.
const MEAN_TOLERANCE: f64 = 1e-12;

/// What a verification found.
#[derive(Debug, Serialize)]
pub(super) struct Verification {
    /// Files hashed.
    pub(super) files: usize,
    /// Texels decoded, gutters included.
    pub(super) texels: u64,
    /// Whether errors were measured, which takes raw radiance.
    pub(super) errors_measured: bool,
    /// What differs from the manifest, a sentence each.
    pub(super) differences: Vec<String>,
}

/// What the texels of a surface, or of a part of it, came to.
#[derive(Default)]
struct Measured {
    texels: u64,
    kept: u64,
    errors: ErrorStats,
    /// Gutter texels that do not hold the samples of the covered texel nearest to them.
    gutter: Strays,
    /// Texels of holes that do not hold the samples that fill them.
    holes: Strays,
}

impl Measured {
    fn add(mut self, other: &Measured) -> Self {
        self.errors.add(&other.errors);
        Self {
            texels: self.texels + other.texels,
            kept: self.kept + other.kept,
            errors: self.errors,
            gutter: self.gutter.add(other.gutter),
            holes: self.holes.add(other.holes),
        }
    }
}

/// Texels that do not hold what they borrow.
#[derive(Debug, Clone, Copy, Default)]
struct Strays {
    count: u64,
    /// The first of them: column, row.
    first: Option<(u32, u32)>,
}

impl Strays {
    fn add(self, other: Strays) -> Self {
        Self { count: self.count + other.count, first: self.first.or(other.first) }
    }

    fn note(&mut self, strays: bool, row: Row) {
        if strays {
            *self = self.add(Strays { count: 1, first: Some((row.x, row.y)) });
        }
    }
}

/// A surface whose texels are looked at.
struct Look<'a> {
    package: &'a Package,
    surface: usize,
    raster: SurfaceRaster,
    order: Order,
    coded: Coded,
    raw: Option<Raw>,
    holes: Option<Holes<'a>>,
}

/// Measures the package again. Differences are found, not errors; files that cannot be read at all are errors.
pub(super) fn verify(package: &Package) -> Result<Verification, ToolError> {
    let listing = files::list_faults(package);
    let found = package.manifest.files.par_iter().map(|f| files::hash_file(package, f)).collect::<Result<Vec<_>, _>>()?;
    let whole = listing.is_empty();
    let mut differences = [listing, files::unlisted(package)?].concat();
    differences.extend(found.iter().filter_map(|(_, fault)| fault.clone()));
    let files: Vec<FileRecord> = found.into_iter().map(|(record, _)| record).collect();
    let mut verification =
        Verification { files: files.len() + 1, texels: 0, errors_measured: package.plan.settings.raw.is_some(), differences: vec![] };
    let mut reports = vec![];
    // A damaged or missing file says nothing worth measuring; that it is so is the finding.
    let intact = whole && files == package.manifest.files;
    for surface in 0..package.scene.surfaces.len() {
        if !intact {
            break;
        }
        let (measured, coded) = measure(package, surface)?;
        verification.texels += measured.texels;
        differences.extend(faults(package, surface, &measured, &coded));
        reports.push(report(package, surface, &measured, &coded, &files));
    }
    if intact {
        differences.extend(compare(package, &reports, &files)?);
    } else {
        for (a, b) in package.manifest.files.iter().zip(&files).filter(|(a, b)| a != b) {
            differences
                .push(format!("{}: {} bytes with SHA-256 {}; the manifest says {} and {}", a.path, b.bytes, b.sha256, a.bytes, a.sha256));
        }
    }
    verification.differences = differences;
    Ok(verification)
}

fn measure(package: &Package, surface: usize) -> Result<(Measured, Coded), ToolError> {
    let coded = package.coded(surface, Trust::Hashed)?;
    let raw = package.plan.settings.raw.map(|_| package.raw(surface, Trust::Hashed)).transpose()?;
    let (mut raster, order) = (package.raster(surface), package.order(surface));
    if package.plan.settings.footprint == Footprint::Area {
        raster = raster.with_seams(&package.scene, &package.scene.surfaces[surface], &package.plan.surfaces[surface]);
    }
    let look = Look { package, surface, raster, order, coded, raw, holes: package.holes(&package.plan, surface)? };
    let parts = (0..package.plan.surfaces[surface].tiles.len()).into_par_iter().map(|tile| look.tile(tile));
    Ok((parts.try_reduce(Measured::default, |a, b| Ok(a.add(&b)))?, look.coded))
}

impl Look<'_> {
    fn tile(&self, tile: usize) -> Result<Measured, ToolError> {
        let layout = &self.package.plan.surfaces[self.surface];
        let rows = self.raster.tile(layout.tiles[tile].cell);
        let runs = runs(&rows, layout.size.width);
        let originals = self.raw.as_ref().map(|raw| raw.read_coded(&runs)).transpose()?;
        // In the order of the rows.
        let patches = self.holes.as_ref().filter(|holes| holes.contains(tile)).map(|holes| holes.patches(tile));
        let mut out = Measured { texels: rows.len() as u64, ..Measured::default() };
        let mut decoded = vec![Sample::default(); self.order.len()];
        let kept = runs.iter().map(|run| self.coded.read(*run)).collect::<Result<Vec<_>, _>>()?;
        for (k, (row, kept)) in rows.iter().zip(kept.iter().flat_map(|k| k.iter())).enumerate() {
            let name = || self.package.scene.surfaces[self.surface].name.clone();
            decode_row(kept, &self.order, &mut decoded).map_err(|source| ReadError::Texel {
                surface: name(),
                x: row.x,
                y: row.y,
                source,
            })?;
            out.kept += kept.len() as u64;
            if let Some(patch) = patches.as_ref().and_then(|patches| patches.get(k)) {
                let strays = match patch.from {
                    Some(from) => self.differs(*row, from, kept)?,
                    None => decoded.iter().any(|rgb| *rgb != [0; 3]),
                };
                out.holes.note(strays, *row);
            } else if row.is_covered() {
                if let Some(originals) = &originals {
                    out.errors.measure(&originals[k * self.order.len()..(k + 1) * self.order.len()], &decoded);
                }
            } else if self.raster.beyond(*row).is_none() && !self.is_hidden(row.source) {
                out.gutter.note(self.differs(*row, row.source, kept)?, *row);
            }
        }
        Ok(out)
    }

    /// Whether what a gutter texel borrows lies in a hole: it was baked with its own tile, and is right where its source is not.
    fn is_hidden(&self, source: (u32, u32)) -> bool {
        self.holes.as_ref().is_some_and(|holes| holes.hides(source))
    }

    /// Whether a texel, which keeps `kept`, differs from the covered texel that it borrows from.
    fn differs(&self, row: Row, source: (u32, u32), kept: &[Kept]) -> Result<bool, ToolError> {
        let width = u64::from(self.package.plan.surfaces[self.surface].size.width);
        let run = |(x, y): (u32, u32)| Run { first: u64::from(y) * width + u64::from(x), count: 1 };
        if self.coded.read(run(source))?.iter().any(|source| source != kept) {
            return Ok(true);
        }
        self.raw.as_ref().map_or(Ok(false), |raw| Ok(raw.read(&[run((row.x, row.y))])? != raw.read(&[run(source)])?))
    }
}

/// What a surface breaks beside the manifest's numbers: the bound of its rule, the form of its colour map, its gutter.
fn faults(package: &Package, surface: usize, measured: &Measured, coded: &Coded) -> Vec<String> {
    let claim = &package.manifest.surfaces[surface];
    // Without raw radiance the claim is all there is; it can still contradict the rule.
    let (found, max) = match package.plan.settings.raw {
        Some(_) => ("an error", measured.errors.max()),
        None => ("a claimed error", claim.encoding.errors.max),
    };
    let bound = bound(package.plan.settings.rule).filter(|most| max > *most);
    let bound = bound.map(|most| format!("{found} of {max} is above {most}, the bound of {}", package.plan.settings.rule));
    let map = (!coded.map_ascends()).then(|| ".mtm is not ascending with each colour once".to_owned());
    let gutter = measured.gutter.first.map(|(x, y)| {
        format!("{} gutter texels, ({x}, {y}) the first, do not hold the samples of their nearest covered texel", measured.gutter.count)
    });
    let holes = measured.holes.first.map(|(x, y)| {
        format!("{} texels of holes, ({x}, {y}) the first, do not hold the samples that should fill them", measured.holes.count)
    });
    [bound, map, gutter, holes].into_iter().flatten().map(|what| format!("surface `{}`: {what}", claim.name)).collect()
}

/// The largest error that a rule allows, where it bounds errors.
fn bound(rule: Rule) -> Option<u8> {
    match rule {
        Rule::Bounded { eps } => Some(eps),
        Rule::Thesis { threshold: 0 } | Rule::Cumulative { threshold: 0 } => Some(0),
        Rule::Thesis { .. } | Rule::Cumulative { .. } => None,
    }
}

/// The report that an assembly of these files would have given.
fn report(package: &Package, surface: usize, measured: &Measured, coded: &Coded, files: &[FileRecord]) -> SurfaceReport {
    let own: Vec<String> = files::required(package, &package.scene.surfaces[surface]).collect();
    let (colours, colour_bits) = coded.colour_map();
    let claims = &package.manifest.surfaces[surface].holes;
    let layout = &package.plan.surfaces[surface];
    let lost: u64 = claims.iter().filter_map(|hole| layout.tiles.get(hole.tile as usize)).map(|tile| u64::from(tile.covered)).sum();
    let samples = layout.covered.saturating_sub(lost) * u64::from(package.plan.settings.directions.len());
    // Without raw radiance there is nothing to compare with; `compare` then takes the manifest's word.
    let unmeasured = package.plan.settings.raw.is_none();
    let errors = if unmeasured { vec![(0, samples)] } else { measured.errors.counts().collect() };
    SurfaceReport {
        surface,
        kept_samples: measured.kept,
        colours,
        colour_bits,
        errors: errors.into_iter().filter(|(_, n)| *n > 0).collect(),
        error_sum: measured.errors.sum(),
        files: files.iter().filter(|f| own.contains(&f.path)).cloned().collect(),
        // Which tiles are holes and why nothing else can tell; where they lie follows from the plan.
        holes: claims.iter().map(|hole| Hole { tile: hole.tile as usize, reason: hole.reason.clone() }).collect(),
    }
}

/// Writes the manifest anew and names what differs.
fn compare(package: &Package, reports: &[SurfaceReport], files: &[FileRecord]) -> Result<Vec<String>, ToolError> {
    let scene_file = files.iter().find(|f| f.path == container::PATH);
    let scene_file = scene_file.ok_or_else(|| ToolError::Damaged("the manifest does not list scene.kiln".into()))?;
    let mut expected = describe(&package.scene, &package.plan, reports, scene_file.clone())?;
    if package.plan.settings.raw.is_none() {
        for (measured, claimed) in expected.surfaces.iter_mut().zip(&package.manifest.surfaces) {
            measured.encoding.errors = claimed.encoding.errors;
        }
    }
    let json = |m| serde_json::to_value(m).map_err(|e| ToolError::Output(e.into()));
    let mut differences = vec![];
    differ("manifest", &json(&package.manifest)?, &json(&expected)?, &mut differences);
    let kept: Vec<_> = reports.iter().map(|r| (package.scene.surfaces[r.surface].name.as_str(), r.kept_samples)).collect();
    for (name, found) in kept {
        let coded = package.coded(package.scene.surface(name).map_or(0, |(index, _)| index), Trust::Hashed)?;
        if coded.samples() != found {
            differences.push(format!("surface `{name}`: {} samples are stored, {found} belong to its texels", coded.samples()));
        }
    }
    Ok(differences)
}

fn differ(path: &str, claimed: &Value, found: &Value, out: &mut Vec<String>) {
    match (claimed, found) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            a.iter().for_each(|(key, value)| differ(&format!("{path}.{key}"), value, &b[key], out));
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(k, (a, b))| differ(&format!("{path}[{k}]"), a, b, out));
        }
        (Value::Number(a), Value::Number(b)) if close(a.as_f64(), b.as_f64(), a == b) => {}
        _ if claimed == found => {}
        _ => out.push(format!("{path} is {claimed}; measured: {found}")),
    }
}

fn close(a: Option<f64>, b: Option<f64>, equal: bool) -> bool {
    let whole = |v: f64| v.fract() == 0.0;
    match (a, b) {
        (Some(a), Some(b)) if !whole(a) && !whole(b) => (a - b).abs() <= MEAN_TOLERANCE * a.abs().max(b.abs()),
        _ => equal,
    }
}
