//! What failures put suspicion on: tiles that are quarantined, workers that are barred.

use super::{jobs, lies, shards, workers};
use crate::{
    job::{self, OnPoison},
    lease::{self, Refuted, Suspicion, shard_of},
    records::UnixMillis,
    store::{
        AttemptRow, StoreError,
        rows::{from_json, on_poison, parse},
        sql::{Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, WorkerId},
    tile::{TileIndex, TileRuns},
};

/// Puts back what an attempt left that failed or fell silent: in smaller leases, or charged. A tile that is quarantined by that is its job's
/// business.
pub(super) async fn suspect(c: &mut Tx, of: &AttemptRow, rest: &TileRuns, reason: &str, now: UnixMillis) -> Result<(), StoreError> {
    let index = shard_of(TileIndex(of.run.start));
    let Some(mut shard) = shards::lock(c, of.job, of.phase, index).await? else { return Ok(()) };
    let connected = workers::connected(c, Some(of.job), now).await?;
    let poison = shard.suspect(&Suspicion { leased: of.run, rest, worker: of.worker, connected });
    shards::save(c, of.job, of.phase, index, &shard).await?;
    let Some(tile) = poison else { return Ok(()) };
    let query = sql("SELECT on_poison, places FROM jobs WHERE id = $1").bind(of.job.to_string());
    let Some(row) = c.one(query).await? else { return Ok(()) };
    let on_poison = on_poison(&row.text("on_poison")?)?;
    let places: Vec<(u64, String)> = from_json("where surfaces begin", &row.text("places")?)?;
    let problem = lease::poisoned(&shard.charges, of.phase, tile, place(&places, tile), reason);
    // Boxed: what follows may end other attempts, which comes back here in type, though never in fact.
    let event = job::Event::Quarantined { phase: of.phase, on_poison, problem: problem.clone() };
    let happened = Box::pin(jobs::happen(c, of.job, &event, now)).await?;
    if matches!((happened, on_poison), (Some(Ok(())), OnPoison::Skip)) {
        Box::pin(jobs::add_problem(c, of.job, &problem, now)).await?;
    }
    Ok(())
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
