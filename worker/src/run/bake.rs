//! The tiles of one lease, one after another, on the current thread pool.

use crate::{
    capture::Capture,
    client::{attempt::Attempt, stream::Packed},
    config::TileOrder,
    encode,
};
use kiln_proto::{
    chain,
    tile::TileIndex,
    wire::message::{LeaseGrant, Phase},
};
use std::sync::Arc;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

/// A lease and what it takes to serve it.
pub(super) struct Lease {
    pub(super) capture: Arc<Capture>,
    pub(super) grant: LeaseGrant,
    pub(super) order: TileOrder,
    pub(super) attempt: Arc<Attempt>,
    pub(super) drain: CancellationToken,
}

/// Bakes every tile and sends its segment off. Stops between tiles when told to, or when nobody listens any more. Whether it was every tile.
pub(super) fn bake(lease: &Lease, ready: &mpsc::Sender<Packed>) -> Result<bool, String> {
    let run = lease.grant.tiles;
    let tiles: Box<dyn Iterator<Item = u64>> = match lease.order {
        TileOrder::Forward => Box::new(run.start..run.end),
        TileOrder::Reverse => Box::new((run.start..run.end).rev()),
    };
    for tile in tiles.map(TileIndex) {
        if lease.drain.is_cancelled() || lease.attempt.is_over() {
            return Ok(false);
        }
        let segment = match lease.grant.phase {
            Phase::Probe => probe(lease, tile),
            Phase::Bake => full(lease, tile),
        }?;
        let packed = Packed::new(tile, &segment).map_err(|e| format!("tile {tile} cannot be packed: {e}"))?;
        if ready.blocking_send(packed).is_err() {
            return Ok(false);
        }
    }
    Ok(true)
}

fn probe(lease: &Lease, tile: TileIndex) -> Result<Vec<u8>, String> {
    let (sums, rays) = lease.capture.probe_tile(tile).map_err(|e| chain(&e))?;
    lease.attempt.did(0, rays);
    encode::encode_probe(lease.capture.plan(), tile, sums).map_err(|e| chain(&e))
}

fn full(lease: &Lease, tile: TileIndex) -> Result<Vec<u8>, String> {
    let lit = lease.capture.bake_tile(tile).map_err(|e| chain(&e))?;
    let segment = encode::encode_tile(lease.capture.plan(), tile, &lit.rows, &lit.radiance).map_err(|e| chain(&e))?;
    lease.attempt.did(lit.rows.len() as u64, lit.rays);
    Ok(segment)
}
