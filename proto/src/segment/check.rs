//! Whether a segment is the one that was asked for. Its bytes come from a worker, and what the plan knows is not asked of it: the surface,
//! the cell, the number of covered and gutter texels, the grid, the walk and the raw format of every tile, and the shape and size of probe
//! sums.
//!
//! Believed is what only baking again could tell: the light itself, that is kept samples, raw samples and probe sums within their bounds,
//! and which texels of the cell the masks name. The error statistics are measured again ([`check`]) where raw samples came along, at the
//! price of decoding the tile once; without them they are believed as far as they are possible and within the rule's bound.

use super::{ProbeSegment, Raw, Segment, SegmentError, TileSegment, expect, field, raw_name};
use crate::{
    codec::pwl::{ErrorStats, Order, Sample, decode_row},
    plan::{PROBE_TILE_TEXELS, Plan, PlannedTile, SurfacePlan},
    settings::{RawFormat, Rule},
    tile::{TILE_SIDE, TileIndex},
    units::radiance_to_byte,
    wire::message::Phase,
};

/// Checks bytes from outside: see [`open`]; and measures the errors again where raw samples came along. What was stored after that needs
/// [`open`] alone.
///
/// # Errors
/// See [`open`]; also error statistics that are not those of the samples.
pub fn check(bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<(), SegmentError> {
    match open(bytes, plan, phase, tile)? {
        Segment::Probe(_) => Ok(()),
        Segment::Tile(found) => check_errors(&found, plan),
    }
}

/// The worker coded the raw samples with the job's exposure and compared what it decoded; so does this.
fn check_errors(found: &TileSegment, plan: &Plan) -> Result<(), SegmentError> {
    let exposure = plan.probe.as_ref().map(|p| p.exposure).unwrap_or_default().factor();
    let original: Vec<Sample> = match &found.raw {
        Raw::None => return Ok(()),
        Raw::U8(bytes) => bytes.as_chunks().0.to_vec(),
        Raw::F32(values) => values.as_chunks::<3>().0.iter().map(|v| v.map(|c| radiance_to_byte(c, exposure))).collect(),
    };
    let order = Order::new(found.grid, found.walk);
    let mut decoded = vec![Sample::default(); order.len()];
    let mut errors = ErrorStats::default();
    let texels = found.mask.texels().zip(found.rows.iter()).zip(original.chunks_exact(order.len()));
    for (row, ((texel, kept), original)) in texels.enumerate() {
        if texel.covered {
            decode_row(kept, &order, &mut decoded)
                .map_err(|_| SegmentError::Row { row, reason: "its kept samples do not lead through the walk" })?;
            errors.measure(original, &decoded);
        }
    }
    let told = |e: &ErrorStats| format!("{} at most, {} in all", e.max(), e.sum());
    if errors == found.errors { Ok(()) } else { Err(field("error statistics", told(&found.errors), told(&errors))) }
}

/// Reads the segment of `tile` and checks that it is what the plan expects there: texels, directions, walk, raw format, probe sums of the
/// right shape, and with the bounded rule no claimed error above eps.
///
/// # Errors
/// Bytes that are no segment, or another one.
pub fn open(bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<Segment, SegmentError> {
    // The raw samples dominate; asking before parsing keeps a worker from making us read 128 MiB for a tile of a few texels.
    let most = most_bytes(plan, phase, tile);
    if bytes.len() > most {
        return Err(field("length", bytes.len().to_string(), format!("at most {most} bytes for this tile")));
    }
    let segment = Segment::from_bytes(bytes)?;
    expect("tile", &segment.tile().0, &tile.0)?;
    match (&segment, phase) {
        (Segment::Probe(probe), Phase::Probe) => check_probe(probe, plan, tile)?,
        (Segment::Tile(found), Phase::Bake) => {
            let (surface, planned) = plan.locate(tile).ok_or_else(|| field("tile", tile.to_string(), "a tile of the plan"))?;
            expect("surface", &found.surface, &(surface as u32))?;
            check_tile(found, plan, &plan.surfaces[surface], planned)?;
        }
        _ => return Err(field("phase", segment.phase().to_string(), phase.to_string())),
    }
    Ok(segment)
}

fn most_bytes(plan: &Plan, phase: Phase, tile: TileIndex) -> usize {
    match phase {
        Phase::Probe => (1 << 13) + plan.surfaces.len() * 32,
        Phase::Bake => {
            let raw = match plan.settings.raw {
                None => 0,
                Some(RawFormat::U8) => 3,
                Some(RawFormat::F32) => 12,
            };
            let samples = plan.tile_cost(phase, tile) as usize * plan.settings.directions.len() as usize;
            (1 << 12) + plan.tile_cost(phase, tile) as usize * 4 + samples * (5 + raw)
        }
    }
}

fn check_probe(probe: &ProbeSegment, plan: &Plan, tile: TileIndex) -> Result<(), SegmentError> {
    expect("directions", &probe.grid, &plan.settings.directions)?;
    if !probe.sums.fits(plan.surfaces.len()) {
        return Err(field("probe sums", "of another shape", format!("sums over {} surfaces", plan.surfaces.len())));
    }
    let counted = probe.sums.histogram.iter().fold(0u64, |all, n| all.saturating_add(*n));
    let most = PROBE_TILE_TEXELS * u64::from(probe.grid.len());
    if counted > most {
        return Err(field("probe histogram", format!("{counted} values"), format!("at most {most}")));
    }
    check_variation(probe, plan, tile)
}

/// Only surfaces that the tile looks at vary, and none by so much that the sum over all tiles overflows: one worker must not be able to
/// decide a walk that the others saw. Sums of
/// real light are far below it.
fn check_variation(probe: &ProbeSegment, plan: &Plan, tile: TileIndex) -> Result<(), SegmentError> {
    let most = u64::MAX / plan.tile_count(Phase::Probe).max(1);
    let mut first = 0;
    for (surface, (layout, (phi, theta))) in plan.surfaces.iter().zip(&probe.sums.variation).enumerate() {
        let own = first..first + layout.covered;
        first = own.end;
        let most = if plan.probe_ordinals(tile).any(|ordinal| own.contains(&ordinal)) { most } else { 0 };
        if *phi.max(theta) > most {
            return Err(field("probe variation", format!("{phi}, {theta} on surface {surface}"), format!("at most {most} there")));
        }
    }
    Ok(())
}

fn check_tile(found: &TileSegment, plan: &Plan, surface: &SurfacePlan, planned: PlannedTile) -> Result<(), SegmentError> {
    expect("cell", &found.cell, &planned.cell)?;
    expect("directions", &found.grid, &plan.settings.directions)?;
    let walk = plan.probe.as_ref().and_then(|p| p.walks.get(found.surface as usize)).copied();
    expect("walk", &Some(found.walk), &walk)?;
    expect("covered texels", &found.mask.covered(), &planned.covered.into())?;
    expect("gutter texels", &found.mask.gutter(), &planned.gutter.into())?;
    let inside = |low: u16, within: u32, side: u32| u32::from(low) * TILE_SIDE + within < side;
    let outside =
        found.mask.texels().find(|t| !inside(found.cell.x, t.x, surface.size.width) || !inside(found.cell.y, t.y, surface.size.height));
    if let Some(texel) = outside {
        return Err(field(
            "masks",
            format!("a texel at ({}, {}) of the cell", texel.x, texel.y),
            format!("texels within {}", surface.size),
        ));
    }
    expect("raw samples", &raw_name(found.raw.format()), &raw_name(plan.settings.raw))?;
    if let Rule::Bounded { eps } = plan.settings.rule
        && found.errors.max() > eps
    {
        return Err(field("largest error", found.errors.max().to_string(), format!("at most {eps}")));
    }
    Ok(())
}
