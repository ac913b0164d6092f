//! From radiance to a segment: code to 8 bits, pick samples, decode again, measure, pack.
//!
//! Every row is decoded by the reference decoder before it leaves, so the errors of a segment are measured, not estimated, and with the
//! bounded rule a row beyond its bound is an error here rather than a claim in a manifest. That costs one more pass over each row.
//! Rows are independent: they run in parallel on the current rayon pool and are collected in order, so the bytes do not depend on threads.

pub mod pwl;

use kiln_proto::{
    codec::pwl::{ErrorStats, Kept, Order, Sample, decode_row},
    plan::{Plan, SurfacePlan},
    probe::ProbeSums,
    segment::{ProbeSegment, Raw, Rows, Segment, SegmentError, TexelMask, TileSegment},
    settings::{RawFormat, Rule},
    texel::Row,
    tile::{Cell, TILE_SIDE, TileIndex},
    units::radiance_to_byte,
};
use rayon::prelude::*;

/// Why a tile cannot be encoded.
#[derive(Debug, thiserror::Error)]
pub enum EncodeError {
    /// The plan has no such tile.
    #[error("the plan has no tile {tile}")]
    NoSuchTile {
        /// The tile.
        tile: TileIndex,
    },
    /// The plan was made before the Probe phase ended.
    #[error("the plan has no exposure yet: the Probe phase comes before the Bake phase")]
    NoExposure,
    /// Another number of rows or values than the plan expects.
    #[error("tile {tile} has {found} {what}; the plan expects {expected}")]
    Shape {
        /// The tile.
        tile: TileIndex,
        /// Rows, covered rows or values.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A row that lies in another tile, or out of order.
    #[error("texel ({x}, {y}) is not a row of tile {tile} at this place")]
    Misplaced {
        /// The tile.
        tile: TileIndex,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// NaN or infinite radiance.
    #[error("surface {surface}, texel ({x}, {y}), direction {depth}: the radiance is {value}, which is not finite")]
    NotFinite {
        /// Index of the surface.
        surface: usize,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// Depth of the direction.
        depth: usize,
        /// The value.
        value: f32,
    },
    /// The encoder broke its promise: a fault of this program.
    #[error("surface {surface}, texel ({x}, {y}): {rule} left an error of {found}")]
    Bound {
        /// Index of the surface.
        surface: usize,
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// The rule.
        rule: Rule,
        /// The largest error found by decoding.
        found: u8,
    },
    /// The segment cannot be written.
    #[error("the segment of tile {tile} cannot be written")]
    Segment {
        /// The tile.
        tile: TileIndex,
        /// Why.
        #[source]
        source: SegmentError,
    },
}

/// The 8-bit samples of a tile and what of them is kept uncompressed.
struct Coded {
    samples: Vec<Sample>,
    raw: Raw,
}

/// A tile of the plan with everything that its encoding depends on.
struct Target<'a> {
    tile: TileIndex,
    surface: usize,
    cell: Cell,
    plan: &'a SurfacePlan,
    order: Order,
    rule: Rule,
}

/// The segment of a Bake tile. `rows` are the tile's texels as [`SurfaceRaster::tile`](kiln_proto::texel::SurfaceRaster::tile) lists them;
/// `radiance` has rows x D x 3 values in depth order, W/(sr m²).
///
/// # Errors
/// A plan without exposure, rows that are not the tile's, radiance that is not finite, results above the limits.
pub fn encode_tile(plan: &Plan, tile: TileIndex, rows: &[Row], radiance: &[f32]) -> Result<Vec<u8>, EncodeError> {
    let exposure = plan.probe.as_ref().ok_or(EncodeError::NoExposure)?.exposure.factor();
    encode(plan, tile, rows, radiance.len(), |target| {
        check_finite(target, rows, radiance)?;
        let code = |rgb: &[f32; 3]| rgb.map(|v| radiance_to_byte(v, exposure));
        let samples: Vec<Sample> = radiance.as_chunks::<3>().0.par_iter().with_min_len(1 << 12).map(code).collect();
        let raw = match plan.settings.raw {
            None => Raw::None,
            Some(RawFormat::U8) => Raw::U8(samples.as_flattened().to_vec()),
            Some(RawFormat::F32) => Raw::F32(radiance.to_vec()),
        };
        Ok(Coded { samples, raw })
    })
}

/// The segment of a Bake tile whose samples are coded to 8 bits already: what [`encode_tile`] makes of the radiance that they were coded
/// from. A plan that keeps raw samples must keep them in 8 bits.
///
/// # Errors
/// See [`encode_tile`]; also a plan that wants raw radiance, which 8 bits no longer have.
pub fn encode_coded_tile(plan: &Plan, tile: TileIndex, rows: &[Row], samples: Vec<Sample>) -> Result<Vec<u8>, EncodeError> {
    encode(plan, tile, rows, samples.len() * 3, |_| {
        let raw = match plan.settings.raw {
            None => Raw::None,
            Some(RawFormat::U8) => Raw::U8(samples.as_flattened().to_vec()),
            Some(RawFormat::F32) => {
                return Err(EncodeError::Shape { tile, what: "values of linear radiance", found: 0, expected: samples.len() * 3 });
            }
        };
        Ok(Coded { samples, raw })
    })
}

/// The segment of a Probe tile.
///
/// # Errors
/// Sums above the limits.
pub fn encode_probe(plan: &Plan, tile: TileIndex, sums: ProbeSums) -> Result<Vec<u8>, EncodeError> {
    let segment = Segment::Probe(ProbeSegment { tile, grid: plan.settings.directions, sums });
    segment.to_bytes().map_err(|source| EncodeError::Segment { tile, source })
}

fn encode(
    plan: &Plan,
    tile: TileIndex,
    rows: &[Row],
    values: usize,
    code: impl FnOnce(&Target<'_>) -> Result<Coded, EncodeError>,
) -> Result<Vec<u8>, EncodeError> {
    let (surface, planned) = plan.locate(tile).ok_or(EncodeError::NoSuchTile { tile })?;
    let walks = &plan.probe.as_ref().ok_or(EncodeError::NoExposure)?.walks;
    let walk = *walks.get(surface).ok_or(EncodeError::NoExposure)?;
    let grid = plan.settings.directions;
    let shape = |what, found, expected| if found == expected { Ok(()) } else { Err(EncodeError::Shape { tile, what, found, expected }) };
    shape("rows", rows.len(), usize::from(planned.covered) + usize::from(planned.gutter))?;
    shape("covered rows", rows.iter().filter(|r| r.is_covered()).count(), planned.covered.into())?;
    shape("values", values, rows.len() * grid.len() as usize * 3)?;
    let target = Target {
        tile,
        surface,
        cell: planned.cell,
        plan: &plan.surfaces[surface],
        order: Order::new(grid, walk),
        rule: plan.settings.rule,
    };
    let mask = mask_of(&target, rows)?;
    let coded = code(&target)?;
    let (kept, errors) = encode_rows(&target, rows, &coded.samples)?;
    let segment = Segment::Tile(Box::new(TileSegment {
        tile,
        surface: surface as u32,
        cell: planned.cell,
        grid,
        walk,
        mask,
        errors,
        rows: kept,
        raw: coded.raw,
    }));
    segment.to_bytes().map_err(|source| EncodeError::Segment { tile, source })
}

/// Rows come in the order of the mask: a segment does not say where each lies, so a row out of order would land on another texel.
fn mask_of(target: &Target<'_>, rows: &[Row]) -> Result<TexelMask, EncodeError> {
    let (x0, y0) = (u32::from(target.cell.x) * TILE_SIDE, u32::from(target.cell.y) * TILE_SIDE);
    let size = target.plan.size;
    let mut mask = TexelMask::default();
    let mut last = None;
    for row in rows {
        let inside = (x0..(x0 + TILE_SIDE).min(size.width)).contains(&row.x) && (y0..(y0 + TILE_SIDE).min(size.height)).contains(&row.y);
        if !inside || last >= Some((row.y, row.x)) {
            return Err(EncodeError::Misplaced { tile: target.tile, x: row.x, y: row.y });
        }
        last = Some((row.y, row.x));
        mask.insert(row.x - x0, row.y - y0, row.is_covered());
    }
    Ok(mask)
}

fn check_finite(target: &Target<'_>, rows: &[Row], radiance: &[f32]) -> Result<(), EncodeError> {
    let Some(at) = radiance.iter().position(|v| !v.is_finite()) else { return Ok(()) };
    let directions = target.order.len();
    let row = rows[at / 3 / directions];
    Err(EncodeError::NotFinite { surface: target.surface, x: row.x, y: row.y, depth: at / 3 % directions, value: radiance[at] })
}

fn encode_rows(target: &Target<'_>, rows: &[Row], samples: &[Sample]) -> Result<(Rows, ErrorStats), EncodeError> {
    let each = rows.par_iter().zip(samples.par_chunks_exact(target.order.len()));
    let encoded: Vec<(Vec<Kept>, ErrorStats)> = each.map(|(row, x)| encode_row(target, *row, x)).collect::<Result<_, _>>()?;
    let (mut kept, mut errors) = (Rows::default(), ErrorStats::default());
    for (row, (samples, measured)) in rows.iter().zip(&encoded) {
        kept.push(samples);
        if row.is_covered() {
            errors.add(measured);
        }
    }
    Ok((kept, errors))
}

fn encode_row(target: &Target<'_>, row: Row, samples: &[Sample]) -> Result<(Vec<Kept>, ErrorStats), EncodeError> {
    let order = &target.order;
    let walked: Vec<Sample> = (0..order.len()).map(|step| samples[usize::from(order.depth(step))]).collect();
    let kept: Vec<Kept> = pwl::pick(&walked, target.rule).into_iter().map(|k| Kept { depth: order.depth(k.step), rgb: k.rgb }).collect();
    let mut decoded = vec![Sample::default(); order.len()];
    let mut errors = ErrorStats::default();
    let broken = |found| EncodeError::Bound { surface: target.surface, x: row.x, y: row.y, rule: target.rule, found };
    decode_row(&kept, order, &mut decoded).map_err(|_| broken(u8::MAX))?;
    errors.measure(samples, &decoded);
    match target.rule {
        Rule::Bounded { eps } if errors.max() > eps => Err(broken(errors.max())),
        _ => Ok((kept, errors)),
    }
}

#[cfg(test)]
mod tests;
