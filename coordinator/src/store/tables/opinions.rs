//! Tiles that are baked twice: which they are, what another worker says of them, and what becomes of a tile that was wrong.

use super::{attempts, chunks, events, jobs, lies, shards};
use crate::{
    lease::{self, Shard, Verdict, is_checked, shard_of},
    records::{EventKind, Problem, UnixMillis},
    store::{
        AttemptRow, ChunkOutcome, ChunkRow, NewChunk, StoreError,
        rows::{runs, runs_text},
        sql::{Tx, sql},
    },
};
use kiln_proto::{
    ids::{Token, WorkerId},
    tile::{TileIndex, TileRuns},
};
use std::collections::BTreeSet;

/// Which tiles of a job are baked twice.
pub(super) struct Sample {
    share: f64,
    secret: String,
}

impl Sample {
    pub(super) fn takes(&self, of: &AttemptRow, tile: TileIndex) -> bool {
        self.share > 0.0 && is_checked(&self.secret, of.job, of.phase, tile, self.share)
    }
}

/// An attempt, with what decides which of its tiles are checked.
pub(super) async fn sampled(c: &mut Tx, token: Token) -> Result<Option<(AttemptRow, Sample)>, StoreError> {
    let query = sql("SELECT a.*, j.verify, j.secret FROM attempts a JOIN jobs j ON j.id = a.job WHERE a.token = $1");
    let Some(found) = c.one(query.bind(token.to_string())).await? else { return Ok(None) };
    Ok(Some((attempts::row(&found)?, Sample { share: found.real("verify")?, secret: found.text("secret")? })))
}

/// What came of the tiles of a chunk that checks.
#[derive(Default)]
struct Heard {
    /// Tiles that count now.
    counted: u64,
    /// Tiles whose accepted segment was wrong.
    wrong: TileRuns,
    /// Tiles of which this worker has other bytes than the first one.
    other: TileRuns,
    /// Tiles of which no two of many workers agree.
    unsettled: TileRuns,
    liars: BTreeSet<WorkerId>,
}

/// A chunk of an attempt that checks: nothing of it is kept but what it says of others.
pub(super) async fn hear(
    c: &mut Tx,
    chunk: &NewChunk,
    mut attempt: AttemptRow,
    mut shard: Shard,
    now: UnixMillis,
) -> Result<ChunkOutcome, StoreError> {
    if let Err(illegal) = attempts::happen(c, chunk.token, &mut attempt, lease::Event::Deliver(chunk.set()), "", now).await? {
        return Ok(ChunkOutcome::Gone(illegal.state.into()));
    }
    let heard = compare(&mut shard, chunk, attempt.worker);
    shards::save(c, attempt.job, attempt.phase, shard_of(TileIndex(attempt.run.start)), &shard).await?;
    let row = ChunkRow {
        blob: chunk.blob,
        trailer_at: chunk.trailer_at,
        length: chunk.length,
        accepted: TileRuns::new(),
        conflicts: heard.other.clone(),
    };
    chunks::insert(c, chunk, &attempt, &row, 0).await?;
    retract(c, &attempt, &heard.wrong).await?;
    tell(c, &attempt, &heard, now).await?;
    chunks::count(c, attempt.job, attempt.phase, heard.counted, now).await?;
    for liar in heard.liars {
        lies::expel(c, liar, attempt.job, now).await?;
    }
    Ok(ChunkOutcome::Recorded(row))
}

fn compare(shard: &mut Shard, chunk: &NewChunk, worker: WorkerId) -> Heard {
    let mut heard = Heard::default();
    for t in &chunk.tiles {
        if shard.checks.accepted(t.tile).is_some_and(|digest| digest != t.digest) {
            heard.other.insert_tile(t.tile);
        }
        match shard.checks.hear(t.tile, worker, t.digest) {
            Verdict::Open => {}
            Verdict::Right(liars) => {
                heard.counted += 1;
                heard.liars.extend(liars);
            }
            Verdict::Wrong(liars) => {
                heard.wrong.insert_tile(t.tile);
                heard.liars.extend(liars);
            }
            Verdict::Unsettled => {
                heard.counted += 1;
                heard.unsettled.insert_tile(t.tile);
            }
        }
    }
    shard.lose(&heard.wrong);
    heard
}

/// Takes accepted segments out of their chunks: they were wrong, and their tiles had not counted yet.
async fn retract(c: &mut Tx, of: &AttemptRow, tiles: &TileRuns) -> Result<(), StoreError> {
    let (Some(first), Some(last)) = (tiles.runs().first(), tiles.runs().last()) else { return Ok(()) };
    let query = sql("SELECT token, n, accepted, cost FROM chunks WHERE job = $1 AND phase = $2 AND accepted <> '' AND first >= $3
         AND first < $4 AND last >= $5");
    let query = query.bind(of.job.to_string()).bind(of.phase.to_string());
    let earliest = first.start.saturating_sub(lease::SHARD_TILES);
    for row in c.all(query.bind(earliest).bind(last.end).bind(first.start)).await? {
        let accepted = runs(&row.text("accepted")?)?;
        let wrong = accepted.intersection(tiles).len();
        if wrong == 0 {
            continue;
        }
        // What a tile cost is not stored; the mean is near enough for a measure of progress.
        let lost = row.count("cost")? * wrong / accepted.len().max(1);
        let query = sql("UPDATE chunks SET accepted = $1, cost = cost - $2 WHERE token = $3 AND n = $4");
        let query = query.bind(runs_text(&accepted.minus(tiles))).bind(lost).bind(row.text("token")?);
        c.run(query.bind(row.count("n")?)).await?;
        jobs::undo(c, of.job, wrong, lost).await?;
    }
    Ok(())
}

/// Tells the job's followers that bytes differed.
async fn tell(c: &mut Tx, by: &AttemptRow, heard: &Heard, now: UnixMillis) -> Result<(), StoreError> {
    let (worker, phase) = (by.worker, by.phase);
    let mut messages = Vec::new();
    if !heard.other.is_empty() {
        messages.push(format!("verify: worker {worker} baked other bytes for tiles {} of {phase}", runs_text(&heard.other)));
    }
    if !heard.wrong.is_empty() {
        messages.push(format!("verify: tiles {} of {phase} were wrong, and are baked again", runs_text(&heard.wrong)));
    }
    if !heard.unsettled.is_empty() {
        let tiles = runs_text(&heard.unsettled);
        messages.push(format!("verify: no two workers agree on tiles {tiles} of {phase}; the first bytes were kept"));
    }
    for message in messages {
        events::append(c, by.job, &EventKind::Problem { problem: Problem::new(message) }, now).await?;
    }
    Ok(())
}
