//! Grants: leases are recorded, each of what there still is of what was asked for.

use super::{attempts, shards, workers};
use crate::{
    lease::{Attempt, Kind, shard_of},
    records::UnixMillis,
    store::{
        Grant, StoreError,
        rows::runs_text,
        sql::{Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};
use std::collections::{BTreeMap, BTreeSet, btree_map::Entry};

/// Records leases. Tiles that wait: of each what is pending of its run, or of the first run of its shard where that is gone, so that
/// coordinators that look at the same shard send nobody away. A twin: the run, where the late attempt still owes all of it. A check: any
/// tile of the phase that the worker may check. For each the run that it got. Workers
/// that are barred get nothing.
pub(in super::super) async fn grant(c: &mut Tx, grants: &[Grant], now: UnixMillis) -> Result<Vec<Option<TileRun>>, StoreError> {
    let (mut granted, barred) = (vec![None; grants.len()], workers::barred(c).await?);
    for (at, grant) in grants.iter().enumerate().filter(|(_, grant)| !barred.contains(&grant.worker)) {
        match grant.kind {
            Kind::Work => {}
            Kind::Twin(of) => granted[at] = twin(c, grant, of).await?,
            Kind::Check => granted[at] = check(c, grant).await?,
        }
    }
    work(c, grants, &barred, &mut granted, now).await?;
    for (grant, run) in grants.iter().zip(&granted) {
        if let Some(run) = run {
            insert(c, grant, *run, now).await?;
        }
    }
    Ok(granted)
}

/// Takes pending tiles, shard by shard.
async fn work(
    c: &mut Tx,
    grants: &[Grant],
    barred: &BTreeSet<WorkerId>,
    granted: &mut [Option<TileRun>],
    now: UnixMillis,
) -> Result<(), StoreError> {
    let mut of_shard: BTreeMap<(JobId, Phase, u64), Vec<usize>> = BTreeMap::new();
    for (at, grant) in grants.iter().enumerate().filter(|(_, g)| g.kind == Kind::Work && !barred.contains(&g.worker)) {
        of_shard.entry((grant.job, grant.phase, shard_of(TileIndex(grant.run.start)))).or_default().push(at);
    }
    let mut connected = BTreeMap::new();
    for ((job, phase, index), wanted) in of_shard {
        let Some(mut shard) = shards::lock(c, job, phase, index).await? else { continue };
        let connected = match connected.entry(job) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(unknown) => *unknown.insert(workers::connected(c, job, now).await?),
        };
        for &at in &wanted {
            let Grant { worker, run, .. } = grants[at];
            granted[at] = shard.take(TileIndex(run.start), run.len(), &shard.charges.avoided(worker, connected));
        }
        if wanted.iter().any(|at| granted[*at].is_some()) {
            shards::save(c, job, phase, index, &shard).await?;
        }
    }
    Ok(())
}

async fn twin(c: &mut Tx, grant: &Grant, of: Token) -> Result<Option<TileRun>, StoreError> {
    let Some(late) = attempts::lock(c, of).await? else { return Ok(None) };
    let owes = |remaining: &TileRuns| TileRuns::from_run(grant.run).minus(remaining).is_empty();
    if late.worker == grant.worker || !matches!(&late.state, Attempt::Held { remaining, .. } if owes(remaining)) {
        return Ok(None);
    }
    let index = shard_of(TileIndex(grant.run.start));
    let Some(mut shard) = shards::lock(c, grant.job, grant.phase, index).await? else { return Ok(None) };
    if !shard.twin(grant.run) {
        return Ok(None);
    }
    shards::save(c, grant.job, grant.phase, index, &shard).await?;
    Ok(Some(grant.run))
}

async fn check(c: &mut Tx, grant: &Grant) -> Result<Option<TileRun>, StoreError> {
    for (index, mut shard) in shards::unasked(c, grant.job, grant.phase).await? {
        if let Some(TileIndex(tile)) = shard.checks.take(grant.worker) {
            shards::save(c, grant.job, grant.phase, index, &shard).await?;
            return Ok(Some(TileRun { start: tile, end: tile + 1 }));
        }
    }
    Ok(None)
}

async fn insert(c: &mut Tx, grant: &Grant, run: TileRun, now: UnixMillis) -> Result<(), StoreError> {
    let query =
        sql("INSERT INTO attempts (token, worker, job, phase, first, past, state, remaining, granted, deadline, cap, kind, twin_of, cost)
         VALUES ($1, $2, $3, $4, $5, $6, 'held', $7, $8, $9, $10, $11, $12, $13)");
    let query = query.bind(grant.token.to_string()).bind(grant.worker.to_string()).bind(grant.job.to_string());
    let query = query.bind(grant.phase.to_string()).bind(run.start).bind(run.end).bind(runs_text(&TileRuns::from_run(run)));
    let query = query.bind(now).bind(grant.deadline).bind(grant.cap).bind(grant.kind.name());
    c.run(query.bind(grant.kind.twin_of().map(|of| of.to_string())).bind(grant.cost)).await?;
    Ok(())
}
