//! Measuring a package again: files are hashed, every texel is decoded, and from what was found the manifest is written anew with the
//! coordinator's own function. Whatever differs from the manifest in the package is named by its JSON path, so a claim that is added to the
//! manifest later is verified without a line here.

use crate::package::{CodedFiles, Package, RawFiles, ToolError, Trust, io_fault, runs};
use kiln_coordinator::assemble::{SurfaceReport, describe};
use kiln_proto::{
    codec::pwl::{ErrorStats, Order, Sample, decode_row},
    format::{FileRecord, Sha256Hex, container, header},
    plan::PlannedTile,
    settings::Rule,
    texel::SurfaceRaster,
};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use std::{fs::File, io::Read};

/// Bytes read at once when a file is hashed.
const BLOCK: usize = 1 << 18;
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
    covered: u64,
    kept: u64,
    errors: ErrorStats,
}

/// Measures the package again. Differences are found, not errors; files that cannot be read at all are errors.
pub(super) fn verify(package: &Package) -> Result<Verification, ToolError> {
    let found = package.manifest.files.par_iter().map(|f| hash_file(package, f)).collect::<Result<Vec<_>, _>>()?;
    let mut differences: Vec<String> = found.iter().filter_map(|(_, fault)| fault.clone()).collect();
    let files: Vec<FileRecord> = found.into_iter().map(|(record, _)| record).collect();
    let mut verification =
        Verification { files: files.len() + 1, texels: 0, errors_measured: package.plan.settings.raw.is_some(), differences: vec![] };
    let mut reports = vec![];
    // A damaged file says nothing worth measuring; its hash is the finding.
    let intact = files == package.manifest.files;
    for surface in 0..package.scene.surfaces.len() {
        if !intact {
            break;
        }
        let (measured, coded) = measure(package, surface)?;
        verification.texels += measured.texels;
        differences.extend(bound_broken(package, surface, &measured));
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

/// The file as it is, and what is wrong with its checksum where it has one.
fn hash_file(package: &Package, claim: &FileRecord) -> Result<(FileRecord, Option<String>), ToolError> {
    let path = package.dir.join(&claim.path);
    let mut file = File::open(&path).map_err(io_fault(&path))?;
    let (mut hash, mut crc, mut bytes) = (Sha256::new(), 0, 0u64);
    let mut head = [0; header::BYTES];
    let mut block = vec![0; BLOCK];
    loop {
        let n = file.read(&mut block).map_err(io_fault(&path))?;
        if n == 0 {
            break;
        }
        hash.update(&block[..n]);
        // Reads may be short, but files under two headers are damaged anyway and fail by their hash.
        let payload = if bytes == 0 { n.min(header::BYTES) } else { 0 };
        if bytes == 0 {
            head[..payload].copy_from_slice(&block[..payload]);
        }
        crc = crc32c::crc32c_append(crc, &block[payload..n]);
        bytes += n as u64;
    }
    let claimed = u32::from_le_bytes([head[28], head[29], head[30], head[31]]);
    let fault = (claim.path.starts_with("surfaces/") && claimed != crc)
        .then(|| format!("{}: its header's checksum is {claimed:08x}; the payload gives {crc:08x}", claim.path));
    Ok((FileRecord { bytes, sha256: Sha256Hex(hash.finalize().into()), ..claim.clone() }, fault))
}

fn measure(package: &Package, surface: usize) -> Result<(Measured, CodedFiles), ToolError> {
    let coded = package.coded(surface, Trust::Hashed)?;
    let raw = package.plan.settings.raw.map(|_| package.raw(surface, Trust::Hashed)).transpose()?;
    let (raster, order) = (package.raster(surface), package.order(surface));
    let tiles = &package.plan.surfaces[surface].tiles;
    let parts = tiles.par_iter().map(|tile| measure_tile(package, surface, *tile, (&raster, &order), &coded, raw.as_ref()));
    let sum = |mut a: Measured, b: Measured| {
        a.errors.add(&b.errors);
        Measured { texels: a.texels + b.texels, covered: a.covered + b.covered, kept: a.kept + b.kept, errors: a.errors }
    };
    Ok((parts.try_reduce(Measured::default, |a, b| Ok(sum(a, b)))?, coded))
}

fn measure_tile(
    package: &Package,
    surface: usize,
    tile: PlannedTile,
    (raster, order): (&SurfaceRaster, &Order),
    coded: &CodedFiles,
    raw: Option<&RawFiles>,
) -> Result<Measured, ToolError> {
    let rows = raster.tile(tile.cell);
    let runs = runs(&rows, package.plan.surfaces[surface].size.width);
    let originals = raw.map(|raw| raw.read_coded(&runs)).transpose()?;
    let mut out = Measured { texels: rows.len() as u64, ..Measured::default() };
    let mut decoded = vec![Sample::default(); order.len()];
    let kept = runs.iter().map(|run| coded.read(*run)).collect::<Result<Vec<_>, _>>()?;
    for (k, (row, kept)) in rows.iter().zip(kept.iter().flatten()).enumerate() {
        let name = || package.scene.surfaces[surface].name.clone();
        decode_row(kept, order, &mut decoded).map_err(|source| ToolError::Texel { surface: name(), x: row.x, y: row.y, source })?;
        out.kept += kept.len() as u64;
        if row.is_covered() {
            out.covered += 1;
            if let Some(originals) = &originals {
                out.errors.measure(&originals[k * order.len()..(k + 1) * order.len()], &decoded);
            }
        }
    }
    Ok(out)
}

fn bound_broken(package: &Package, surface: usize, measured: &Measured) -> Option<String> {
    let name = &package.scene.surfaces[surface].name;
    match package.manifest.surfaces[surface].rule {
        Rule::Bounded { eps } if measured.errors.max() > eps => {
            Some(format!("surface `{name}`: an error of {} is above eps = {eps}", measured.errors.max()))
        }
        _ => None,
    }
}

/// The report that an assembly of these files would have given.
fn report(package: &Package, surface: usize, measured: &Measured, coded: &CodedFiles, files: &[FileRecord]) -> SurfaceReport {
    let prefix = format!("surfaces/{}.", package.scene.surfaces[surface].file_stem);
    // Stems may hold dots: what follows the prefix must be an extension.
    let own = |f: &&FileRecord| f.path.strip_prefix(&prefix).is_some_and(|rest| !rest.contains('.'));
    let (colours, colour_bits) = coded.colour_map();
    let samples = package.plan.surfaces[surface].covered * u64::from(package.plan.settings.directions.len());
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
        files: files.iter().filter(own).cloned().collect(),
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
        if coded.samples != found {
            differences.push(format!("surface `{name}`: {} samples are stored, {found} belong to its texels", coded.samples));
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
