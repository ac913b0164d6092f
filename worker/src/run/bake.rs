//! The tiles of one lease, one after another, on the current thread pool.

use super::{Tally, chain};
use crate::{capture::Capture, client::stream::Packed, config::TileOrder, encode};
use kiln_proto::{
    tile::TileIndex,
    wire::message::{LeaseGrant, Phase},
};
use std::sync::{Arc, atomic::Ordering};
use tokio::sync::mpsc;

/// A tile's segment, ready to travel.
pub(super) type Baked = Packed;

/// A lease and what it takes to serve it.
pub(super) struct Lease {
    pub(super) capture: Arc<Capture>,
    pub(super) grant: LeaseGrant,
    pub(super) order: TileOrder,
}

/// Bakes every tile and sends its segment off. Stops between tiles when told to, or when nobody listens any more.
pub(super) fn bake(lease: &Lease, tally: &Tally, ready: &mpsc::Sender<Baked>) -> Result<(), String> {
    let run = lease.grant.tiles;
    let tiles: Box<dyn Iterator<Item = u64>> = match lease.order {
        TileOrder::Forward => Box::new(run.start..run.end),
        TileOrder::Reverse => Box::new((run.start..run.end).rev()),
    };
    for tile in tiles.map(TileIndex) {
        if tally.stop.load(Ordering::Relaxed) {
            break;
        }
        let segment = match lease.grant.phase {
            Phase::Probe => probe(lease, tile, tally),
            Phase::Bake => full(lease, tile, tally),
        }?;
        let packed = Packed::new(tile, &segment).map_err(|e| format!("tile {tile} cannot be packed: {e}"))?;
        if ready.blocking_send(packed).is_err() {
            break;
        }
    }
    Ok(())
}

fn probe(lease: &Lease, tile: TileIndex, tally: &Tally) -> Result<Vec<u8>, String> {
    let (sums, rays) = lease.capture.probe_tile(tile).map_err(|e| chain(&e))?;
    tally.rays.fetch_add(rays, Ordering::Relaxed);
    encode::encode_probe(lease.capture.plan(), tile, sums).map_err(|e| chain(&e))
}

fn full(lease: &Lease, tile: TileIndex, tally: &Tally) -> Result<Vec<u8>, String> {
    let lit = lease.capture.bake_tile(tile).map_err(|e| chain(&e))?;
    tally.rays.fetch_add(lit.rays, Ordering::Relaxed);
    let segment = encode::encode_tile(lease.capture.plan(), tile, &lit.rows, &lit.radiance).map_err(|e| chain(&e))?;
    tally.texels.fetch_add(lit.rows.len() as u64, Ordering::Relaxed);
    Ok(segment)
}
