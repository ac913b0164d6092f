//! What failures put suspicion on: tiles that are quarantined, workers that are barred.

use super::{jobs, lies, shards, workers};
use crate::{
    job::{self, OnPoison},
    lease::{self, Charges, Refuted, Suspicion, shard_of},
    records::UnixMillis,
    store::{
        AttemptRow, StoreError,
        rows::{from_json, on_poison, parse, runs},
        sql::{Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, WorkerId},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};
use std::collections::BTreeMap;

/// Puts back what an attempt left that failed or fell silent: in smaller leases, or charged. A tile that is quarantined by that is its job's
/// business.
pub(super) async fn suspect(c: &mut Tx, of: &AttemptRow, rest: &TileRuns, reason: &str, now: UnixMillis) -> Result<(), StoreError> {
    let index = shard_of(TileIndex(of.run.start));
    let Some(mut shard) = shards::lock(c, of.job, of.phase, index).await? else { return Ok(()) };
    let connected = workers::connected(c, of.job, now).await?;
    let poison = shard.suspect(&Suspicion { leased: of.run, rest, worker: of.worker, connected });
    if let Some(tile) = poison {
        shard.charges.explain(tile, reason);
    }
    shards::save(c, of.job, of.phase, index, &shard).await?;
    let Some(tile) = poison else { return Ok(()) };
    let query = sql("SELECT on_poison, places FROM jobs WHERE id = $1").bind(of.job.to_string());
    let Some(row) = c.one(query).await? else { return Ok(()) };
    let on_poison = on_poison(&row.text("on_poison")?)?;
    let places: Vec<(u64, String)> = from_json("where surfaces begin", &row.text("places")?)?;
    let problem = lease::poisoned(&shard.charges, of.phase, tile, place(&places, tile), on_poison);
    // Boxed: what follows may end other attempts, which comes back here in type, though never in fact.
    let event = job::Event::Quarantined { phase: of.phase, on_poison, problem: problem.clone() };
    let happened = Box::pin(jobs::happen(c, of.job, &event, now)).await?;
    if matches!((happened, on_poison), (Some(Ok(())), OnPoison::Skip)) {
        Box::pin(jobs::add_problem(c, of.job, &problem, now)).await?;
    }
    Ok(())
}

/// The tiles of a run that are in quarantine, each with how it failed.
pub(in super::super) async fn holes(c: &mut Tx, job: JobId, phase: Phase, run: TileRun) -> Result<BTreeMap<TileIndex, String>, StoreError> {
    let query = sql("SELECT quarantined, charges FROM shards WHERE job = $1 AND phase = $2 AND shard >= $3 AND shard <= $4
         AND quarantined <> '' ORDER BY shard");
    let (first, last) = (shard_of(TileIndex(run.start)), shard_of(TileIndex(run.end)));
    let mut found = BTreeMap::new();
    for row in c.all(query.bind(job.to_string()).bind(phase.to_string()).bind(first).bind(last)).await? {
        let charges: Charges = parse("charges of tiles", &row.text("charges")?)?;
        let tiles = runs(&row.text("quarantined")?)?.intersection(&TileRuns::from_run(run));
        found.extend(tiles.iter().map(|tile| (tile, lease::failures(&charges, tile))));
    }
    Ok(found)
}

/// A worker could not say what it was asked about a tile: another is asked.
pub(super) async fn no_opinion(c: &mut Tx, of: &AttemptRow) -> Result<(), StoreError> {
    let tile = TileIndex(of.run.start);
    let Some(mut shard) = shards::lock(c, of.job, of.phase, shard_of(tile)).await? else { return Ok(()) };
    shard.checks.fail(tile, of.worker);
    shards::save(c, of.job, of.phase, shard_of(tile), &shard).await
}

/// The surface of a tile and its number among the tiles of that surface; nothing before the surfaces are laid out.
fn place(places: &[(u64, String)], tile: TileIndex) -> Option<(&str, u64)> {
    let (first, name) = places.iter().rev().find(|(first, _)| *first <= tile.0)?;
    Some((name, tile.0 - first))
}

/// Another worker managed a tile that this one had failed; one too many of them bars it.
pub(super) async fn refute(c: &mut Tx, worker: WorkerId, by: &AttemptRow, tile: TileIndex, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT refuted FROM workers WHERE id = $1").locking().bind(worker.to_string());
    let Some(row) = c.one(query).await? else { return Ok(()) };
    let mut refuted: Refuted = parse("refuted failures", &row.text("refuted")?)?;
    refuted.note(by.job, by.phase, tile);
    let query = sql("UPDATE workers SET refuted = $1 WHERE id = $2");
    c.run(query.bind(refuted.to_string()).bind(worker.to_string())).await?;
    if refuted.bars() {
        lies::bar(c, worker, "it failed tiles that other workers then managed", by.job, now).await?;
    }
    Ok(())
}

/// Where surfaces begin among the tiles of a phase.
pub(super) async fn set_places(c: &mut Tx, job: JobId, places: &[(u64, String)]) -> Result<(), StoreError> {
    let query = sql("UPDATE jobs SET places = $1 WHERE id = $2").bind(crate::store::rows::json(&places)?).bind(job.to_string());
    c.run(query).await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarantined_tile_is_named_by_its_surface() {
        let places = [(0, "floor".to_owned()), (20, "lamp".to_owned())];
        assert_eq!(place(&places, TileIndex(19)), Some(("floor", 19)));
        assert_eq!(place(&places, TileIndex(22)), Some(("lamp", 2)));
        assert_eq!(place(&[], TileIndex(1)), None);
    }
}
