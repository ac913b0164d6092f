//! The files that make a package of its surfaces: `scene.kiln`, and last of all `manifest.json`.

use super::{
    AssembleError, Hole, SurfaceReport,
    output::{BINARY, io_fault},
};
use kiln_proto::{
    codec::pwl::ErrorStats,
    format::{
        FileRecord, Kind, Manifest, PackageHash, Sha256Hex, container,
        manifest::{
            self, Bounds, Encoding, ErrorSummary, ExposureRecord, HoleRecord, MaterialRecord, PartRecord, ReflectionRecord, SCHEMA_VERSION,
            SurfaceRecord, Totals, Units,
        },
        package_hash,
    },
    plan::{PhaseResults, Plan, SurfacePlan},
    scene::{Lobe, Material, Part, Reflection, Scene},
    tile::TILE_SIDE,
};
use sha2::{Digest as _, Sha256};
use std::{fs, path::Path};

/// A package whose manifest is written.
#[derive(Debug, Clone, PartialEq)]
pub struct Published {
    /// The manifest.
    pub manifest: Manifest,
    /// The hash of the package.
    pub hash: PackageHash,
    /// The files that this step wrote: `manifest.json` and `scene.kiln`.
    pub files: Vec<FileRecord>,
}

/// Writes `scene.kiln` and then `manifest.json` into `dir`. The surfaces' files need not be there: their reports, in the order of the
/// scene, say all that is asked.
///
/// # Errors
/// Scene, plan and reports that do not belong together, and a directory that cannot be written.
pub fn write_manifest(dir: &Path, scene_bytes: &[u8], plan: &Plan, reports: &[SurfaceReport]) -> Result<Published, AssembleError> {
    let scene = Scene::from_bytes(scene_bytes).map_err(|e| mismatch(format!("the scene cannot be read: {e}")))?;
    let plan_bytes = plan.to_bytes().map_err(|e| mismatch(format!("the plan cannot be written: {e}")))?;
    if Scene::hash_of(scene_bytes) != plan.scene {
        return Err(mismatch("the plan is made for another scene"));
    }
    let header = container::header(scene_bytes, &plan_bytes);
    let scene_file = write(dir, container::PATH, BINARY, &[&header, scene_bytes, &plan_bytes])?;
    let manifest = describe(&scene, plan, reports, scene_file.clone())?;
    let bytes = manifest.to_bytes().map_err(|e| mismatch(format!("the manifest cannot be written: {e}")))?;
    let manifest_file = write(dir, manifest::PATH, "application/json", &[&bytes])?;
    let all = manifest.files.iter().chain([&manifest_file]);
    let hash = package_hash(all.map(|f| (f.path.as_str(), f.sha256)));
    Ok(Published { manifest, hash, files: vec![manifest_file, scene_file] })
}

fn mismatch(reason: impl Into<String>) -> AssembleError {
    AssembleError::Mismatch { reason: reason.into() }
}

fn write(dir: &Path, name: &str, media_type: &str, parts: &[&[u8]]) -> Result<FileRecord, AssembleError> {
    let path = dir.join(name);
    let mut hash = Sha256::new();
    let mut file = fs::File::create(&path).map_err(io_fault(&path))?;
    for part in parts {
        hash.update(part);
        std::io::Write::write_all(&mut file, part).map_err(io_fault(&path))?;
    }
    let bytes = parts.iter().map(|p| p.len() as u64).sum();
    Ok(FileRecord { path: name.into(), media_type: media_type.into(), bytes, sha256: Sha256Hex(hash.finalize().into()) })
}

/// The manifest of a package with these reports, in the order of the scene, and this `scene.kiln`.
///
/// # Errors
/// Scene, plan and reports that do not belong together.
pub fn describe(scene: &Scene, plan: &Plan, reports: &[SurfaceReport], scene_file: FileRecord) -> Result<Manifest, AssembleError> {
    let probe = plan.probe.as_ref().ok_or_else(|| mismatch("the plan has no exposure yet"))?;
    let in_order = reports.iter().map(|r| r.surface).eq(0..scene.surfaces.len());
    if !in_order || [plan.surfaces.len(), probe.walks.len()] != [reports.len(); 2] {
        return Err(mismatch(format!("{} reports for {} surfaces, or out of order", reports.len(), scene.surfaces.len())));
    }
    let surfaces = reports.iter().map(|r| surface(scene, plan, probe, r)).collect::<Result<Vec<_>, _>>()?;
    let mut files: Vec<FileRecord> = reports.iter().flat_map(|r| r.files.iter().cloned()).chain([scene_file]).collect();
    files.sort_by(|a, b| a.path.cmp(&b.path));
    let (low, high) = scene.bounds();
    Ok(Manifest {
        schema: SCHEMA_VERSION,
        scene: plan.scene,
        bake_version: plan.bake_version,
        seed: plan.settings.seed,
        settings: plan.settings.clone(),
        units: Units::default(),
        exposure: ExposureRecord { stops: probe.exposure.stops(), clipped_ppm: probe.clipped_ppm },
        bounds: Bounds { low, high },
        totals: totals(&surfaces),
        surfaces,
        files,
    })
}

fn surface(scene: &Scene, plan: &Plan, probe: &PhaseResults, report: &SurfaceReport) -> Result<SurfaceRecord, AssembleError> {
    let (surface, layout) = (&scene.surfaces[report.surface], &plan.surfaces[report.surface]);
    Ok(SurfaceRecord {
        name: surface.name.clone(),
        file_stem: surface.file_stem.clone(),
        size: layout.size,
        charts: layout.source,
        covered: layout.covered,
        back_of: surface.back_of,
        parts: surface.parts.iter().map(|p| part(scene, p)).collect(),
        grid: plan.settings.directions,
        codec: plan.settings.codec,
        rule: plan.settings.rule,
        walk: probe.walks[report.surface],
        encoding: encoding(plan, report)?,
        holes: report.holes.iter().map(|h| hole(layout, h)).collect::<Result<_, _>>()?,
    })
}

fn hole(layout: &SurfacePlan, hole: &Hole) -> Result<HoleRecord, AssembleError> {
    let planned = layout.tiles.get(hole.tile).ok_or_else(|| mismatch(format!("a hole is tile {} of {}", hole.tile, layout.tiles.len())))?;
    let (x, y) = (u32::from(planned.cell.x) * TILE_SIDE, u32::from(planned.cell.y) * TILE_SIDE);
    let side = |of: u32, at: u32| of.saturating_sub(at).min(TILE_SIDE);
    Ok(HoleRecord {
        tile: hole.tile as u32, // surfaces have at most 65,536 tiles
        x,
        y,
        width: side(layout.size.width, x),
        height: side(layout.size.height, y),
        covered: planned.covered.into(),
        reason: hole.reason.clone(),
    })
}

fn encoding(plan: &Plan, report: &SurfaceReport) -> Result<Encoding, AssembleError> {
    let layout = &plan.surfaces[report.surface];
    let samples = layout.covered * u64::from(plan.settings.directions.len());
    let lost: u64 = report.holes.iter().filter_map(|h| layout.tiles.get(h.tile)).map(|t| u64::from(t.covered)).sum();
    let measured = layout.covered.saturating_sub(lost) * u64::from(plan.settings.directions.len());
    let errors = ErrorStats::from_parts(&report.errors, report.error_sum, measured)
        .map_err(|e| mismatch(format!("the report of surface {}: {e}", report.surface)))?;
    let raw_path = format!(".{}", Kind::Mtex.extension());
    let coded_bytes = report.files.iter().filter(|f| !f.path.ends_with(&raw_path)).map(|f| f.bytes).sum();
    let raw_bytes = 3 * samples;
    Ok(Encoding {
        kept_samples: report.kept_samples,
        colours: report.colours,
        colour_bits: report.colour_bits,
        raw_bytes,
        coded_bytes,
        ratio: ratio(raw_bytes, coded_bytes),
        grew: coded_bytes > raw_bytes,
        errors: ErrorSummary::from(&errors),
    })
}

fn totals(surfaces: &[SurfaceRecord]) -> Totals {
    let sum = |f: &dyn Fn(&SurfaceRecord) -> u64| surfaces.iter().map(f).sum();
    let (raw_bytes, coded_bytes) = (sum(&|s| s.encoding.raw_bytes), sum(&|s| s.encoding.coded_bytes));
    Totals { texels: sum(&|s| s.size.texels()), covered: sum(&|s| s.covered), raw_bytes, coded_bytes, ratio: ratio(raw_bytes, coded_bytes) }
}

fn ratio(raw: u64, coded: u64) -> f64 {
    raw as f64 / coded.max(1) as f64
}

fn part(scene: &Scene, part: &Part) -> PartRecord {
    PartRecord { name: part.name.clone(), triangles: part.triangles, material: material(scene, &scene.materials[part.material as usize]) }
}

fn material(scene: &Scene, m: &Material) -> MaterialRecord {
    let (reflection, layers) = match &m.reflection {
        Reflection::None => (ReflectionRecord::None, &[][..]),
        Reflection::Phong(p) => {
            let exponent = if let Lobe::Phong { exponent } = p.lobe { Some(exponent) } else { None };
            (ReflectionRecord::Phong { diffuse: p.diffuse.to_array(), specular: p.specular.to_array(), exponent }, p.layers.as_slice())
        }
        Reflection::MetallicRoughness(p) => {
            let (base_color, metallic, roughness) = (p.base_color.to_array(), p.metallic, p.roughness);
            let record = ReflectionRecord::MetallicRoughness { base_color, metallic, roughness, transmission: p.transmission };
            (record, p.layers.as_slice())
        }
    };
    let textures = layers.iter().map(|l| scene.textures[l.texture.texture as usize].name.clone()).collect();
    MaterialRecord { name: m.name.clone(), reflection, textures, emission: m.emission.to_array(), lets_through: m.lets_through() }
}
