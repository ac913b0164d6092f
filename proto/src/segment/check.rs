//! Whether a segment is the one that was asked for. Its bytes come from a worker, and nothing that a worker says is believed: the plan
//! knows the surface, the cell, the number of texels, the grid, the walk and the raw format of every tile.

use super::{ProbeSegment, Segment, SegmentError, TileSegment, expect, field, raw_name};
use crate::{
    plan::{PROBE_TILE_TEXELS, Plan, PlannedTile, SurfacePlan},
    settings::{RawFormat, Rule},
    tile::{TILE_SIDE, TileIndex},
    wire::message::Phase,
};

/// Checks bytes from outside: see [`open`].
///
/// # Errors
/// See [`open`].
pub fn check(bytes: &[u8], plan: &Plan, phase: Phase, tile: TileIndex) -> Result<(), SegmentError> {
    open(bytes, plan, phase, tile).map(drop)
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
        (Segment::Probe(probe), Phase::Probe) => check_probe(probe, plan)?,
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

fn check_probe(probe: &ProbeSegment, plan: &Plan) -> Result<(), SegmentError> {
    expect("directions", &probe.grid, &plan.settings.directions)?;
    if !probe.sums.fits(plan.surfaces.len()) {
        return Err(field("probe sums", "of another shape", format!("sums over {} surfaces", plan.surfaces.len())));
    }
    let counted = probe.sums.histogram.iter().fold(0u64, |all, n| all.saturating_add(*n));
    let most = PROBE_TILE_TEXELS * u64::from(probe.grid.len());
    if counted > most {
        return Err(field("probe histogram", format!("{counted} values"), format!("at most {most}")));
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
