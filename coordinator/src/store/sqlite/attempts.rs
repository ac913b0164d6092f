//! Lease attempts: rows around [`Attempt`].

use super::{
    rows::{int, parse, phase as parse_phase, runs, runs_text, strange},
    shards, workers,
};
use crate::{
    lease::{self, Action, Attempt, shard_of},
    records::UnixMillis,
    store::{AttemptRow, FinishOutcome, Grant, StoreError},
};
use kiln_proto::{
    ids::{JobId, Token},
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::{Finish, Heartbeat},
};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

pub(super) async fn grant(c: &mut SqliteConnection, grant: &Grant, now: UnixMillis) -> Result<bool, StoreError> {
    let index = shard_of(TileIndex(grant.run.start));
    let Some(mut shard) = shards::load(c, grant.job, grant.phase, index).await? else { return Ok(false) };
    if shard.take(TileIndex(grant.run.start), grant.run.len()) != Some(grant.run) {
        return Ok(false);
    }
    shards::save(c, grant.job, grant.phase, index, &shard).await?;
    sqlx::query(
        "INSERT INTO attempts (token, worker, job, phase, first, past, state, remaining, granted, deadline, cap)
         VALUES (?, ?, ?, ?, ?, ?, 'held', ?, ?, ?, ?)",
    )
    .bind(grant.token.to_string())
    .bind(grant.worker.to_string())
    .bind(grant.job.to_string())
    .bind(grant.phase.to_string())
    .bind(int(grant.run.start))
    .bind(int(grant.run.end))
    .bind(runs_text(&TileRuns::from_run(grant.run)))
    .bind(now)
    .bind(grant.deadline)
    .bind(grant.cap)
    .execute(c)
    .await?;
    Ok(true)
}

fn row(row: &SqliteRow) -> Result<AttemptRow, StoreError> {
    let text = |column: &str| row.try_get::<String, _>(column);
    let state = match text("state")?.as_str() {
        "held" => Attempt::Held { deadline: row.try_get("deadline")?, cap: row.try_get("cap")?, remaining: runs(&text("remaining")?)? },
        "completed" => Attempt::Completed,
        "released" => Attempt::Released,
        "expired" => Attempt::Expired,
        "fenced" => Attempt::Fenced,
        other => return Err(strange("an attempt's state", other)),
    };
    let number = |column: &str| row.try_get::<i64, _>(column).map(super::rows::count);
    Ok(AttemptRow {
        worker: parse("a worker id", &text("worker")?)?,
        job: parse("a job id", &text("job")?)?,
        phase: parse_phase(&text("phase")?)?,
        run: TileRun { start: number("first")?, end: number("past")? },
        state,
        granted_ms: row.try_get("granted")?,
        texels: number("texels")?,
    })
}

pub(super) async fn get(c: &mut SqliteConnection, token: Token) -> Result<Option<AttemptRow>, StoreError> {
    let found = sqlx::query("SELECT * FROM attempts WHERE token = ?").bind(token.to_string()).fetch_optional(c).await?;
    found.as_ref().map(row).transpose()
}

/// Applies an event to an attempt and performs what follows.
pub(super) async fn happen(
    c: &mut SqliteConnection,
    token: Token,
    row: &mut AttemptRow,
    event: lease::Event,
    now: UnixMillis,
) -> Result<Result<(), lease::Illegal>, StoreError> {
    let (state, actions) = match row.state.clone().apply(event, now) {
        Ok(next) => next,
        Err(illegal) => return Ok(Err(illegal)),
    };
    row.state = state;
    let (deadline, remaining, ended) = match &row.state {
        Attempt::Held { deadline, remaining, .. } => (Some(*deadline), runs_text(remaining), None),
        _ => (None, String::new(), Some(now)),
    };
    sqlx::query(
        "UPDATE attempts SET state = ?, remaining = ?, deadline = COALESCE(?, deadline), ended = COALESCE(ended, ?) WHERE token = ?",
    )
    .bind(row.state.name())
    .bind(remaining)
    .bind(deadline)
    .bind(ended)
    .bind(token.to_string())
    .execute(&mut *c)
    .await?;
    for Action::Return(tiles) in actions {
        shards::give_back(c, row.job, row.phase, shard_of(TileIndex(row.run.start)), &tiles).await?;
    }
    Ok(Ok(()))
}

pub(super) async fn heartbeat(
    c: &mut SqliteConnection,
    token: Token,
    beat: &Heartbeat,
    ttl: i64,
    now: UnixMillis,
) -> Result<Option<AttemptRow>, StoreError> {
    let Some(mut row) = get(c, token).await? else { return Ok(None) };
    let outcome = happen(c, token, &mut row, lease::Event::Heartbeat { ttl }, now).await?;
    sqlx::query("UPDATE attempts SET rays = MAX(rays, ?) WHERE token = ?")
        .bind(int(beat.rays))
        .bind(token.to_string())
        .execute(&mut *c)
        .await?;
    workers::seen(c, row.worker, now).await?;
    Ok((outcome.is_ok() && matches!(row.state, Attempt::Held { .. })).then_some(row))
}

pub(super) async fn finish(
    c: &mut SqliteConnection,
    token: Token,
    event: lease::Event,
    finish: Option<&Finish>,
    now: UnixMillis,
) -> Result<FinishOutcome, StoreError> {
    let Some(mut row) = get(c, token).await? else { return Ok(FinishOutcome::Gone("unknown".into())) };
    let was_held = matches!(row.state, Attempt::Held { .. });
    if let Attempt::Held { remaining, .. } = &mut row.state {
        // Tiles that somebody else delivered late are no debt of this attempt.
        if let Some(shard) = shards::load(c, row.job, row.phase, shard_of(TileIndex(row.run.start))).await? {
            *remaining = remaining.minus(&shard.done);
        }
    }
    if let Err(illegal) = happen(c, token, &mut row, event, now).await? {
        return Ok(FinishOutcome::Gone(illegal.state.into()));
    }
    if was_held {
        workers::contribute(c, token, &row, finish, now).await?;
    }
    Ok(FinishOutcome::Finished(row))
}

/// Fences whatever a job's workers hold. Its shards go with it, so nothing is given back.
pub(super) async fn fence_all(c: &mut SqliteConnection, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    // Expired attempts too: a job that is over takes no late deliveries.
    sqlx::query(
        "UPDATE attempts SET state = 'fenced', remaining = '', ended = COALESCE(ended, ?)
         WHERE job = ? AND state IN ('held', 'expired')",
    )
    .bind(now)
    .bind(job.to_string())
    .execute(c)
    .await?;
    Ok(())
}

pub(super) async fn expire(c: &mut SqliteConnection, now: UnixMillis) -> Result<u64, StoreError> {
    let query = sqlx::query_scalar("SELECT token FROM attempts WHERE state = 'held' AND (deadline <= ? OR cap <= ?)");
    let due: Vec<String> = query.bind(now).bind(now).fetch_all(&mut *c).await?;
    let mut expired = 0;
    for token in due {
        let token = parse("a token", &token)?;
        let Some(mut row) = get(c, token).await? else { continue };
        if happen(c, token, &mut row, lease::Event::Tick, now).await?.is_ok() && row.state == Attempt::Expired {
            workers::contribute(c, token, &row, None, now).await?;
            expired += 1;
        }
    }
    Ok(expired)
}
