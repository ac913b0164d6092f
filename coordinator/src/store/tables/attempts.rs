//! Lease attempts: rows around [`Attempt`].

use super::{locks, poison, shards, workers};
use crate::{
    lease::{self, Action, Attempt, Kind, shard_of},
    records::UnixMillis,
    store::{
        AttemptRow, Beat, Ending, FinishOutcome, StoreError,
        rows::{int, parse, phase as parse_phase, runs, runs_text, strange},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, Token, WorkerId},
    tile::{TileIndex, TileRun, TileRuns},
};
use std::collections::{BTreeMap, HashMap};

fn kind(row: &Row) -> Result<Kind, StoreError> {
    match (row.text("kind")?.as_str(), row.maybe_text("twin_of")?) {
        ("work", None) => Ok(Kind::Work),
        ("check", None) => Ok(Kind::Check),
        ("twin", Some(of)) => Ok(Kind::Twin(parse("a token", &of)?)),
        (other, _) => Err(strange("what an attempt is for", other)),
    }
}

pub(super) fn row(row: &Row) -> Result<AttemptRow, StoreError> {
    let state = match row.text("state")?.as_str() {
        "held" => Attempt::Held { deadline: row.int("deadline")?, cap: row.int("cap")?, remaining: runs(&row.text("remaining")?)? },
        "completed" => Attempt::Completed,
        "released" => Attempt::Released,
        "expired" => Attempt::Expired,
        "fenced" => Attempt::Fenced,
        other => return Err(strange("an attempt's state", other)),
    };
    Ok(AttemptRow {
        worker: parse("a worker id", &row.text("worker")?)?,
        job: parse("a job id", &row.text("job")?)?,
        phase: parse_phase(&row.text("phase")?)?,
        run: TileRun { start: row.count("first")?, end: row.count("past")? },
        kind: kind(row)?,
        cost: row.count("cost")?,
        state,
        granted_ms: row.int("granted")?,
        texels: row.count("texels")?,
    })
}

/// An attempt as it is just now.
pub(in super::super) async fn get(c: &mut Tx, token: Token) -> Result<Option<AttemptRow>, StoreError> {
    c.one(sql("SELECT * FROM attempts WHERE token = $1").bind(token.to_string())).await?.as_ref().map(row).transpose()
}

/// An attempt, locked.
pub(super) async fn lock(c: &mut Tx, token: Token) -> Result<Option<AttemptRow>, StoreError> {
    c.one(sql("SELECT * FROM attempts WHERE token = $1").locking().bind(token.to_string())).await?.as_ref().map(row).transpose()
}

/// Applies an event to an attempt and performs what follows. `reason` says what went wrong, where something did.
pub(super) async fn happen(
    c: &mut Tx,
    token: Token,
    row: &mut AttemptRow,
    event: lease::Event,
    reason: &str,
    now: UnixMillis,
) -> Result<Result<(), lease::Illegal>, StoreError> {
    let (state, actions) = match row.state.clone().apply(event, now) {
        Ok(next) => next,
        Err(illegal) => return Ok(Err(illegal)),
    };
    row.state = state;
    save(c, token, row, now).await?;
    for action in actions {
        match action {
            Action::Suspect(_) if row.kind == Kind::Check => poison::no_opinion(c, row).await?,
            Action::Suspect(tiles) => poison::suspect(c, row, &tiles, reason, now).await?,
            Action::Return(tiles) => hand_back(c, row, &tiles).await?,
        }
    }
    Ok(Ok(()))
}

/// Lets others have what an attempt owed: its tiles, or the opinion that it was asked for.
async fn hand_back(c: &mut Tx, of: &AttemptRow, tiles: &TileRuns) -> Result<(), StoreError> {
    let first = TileIndex(of.run.start);
    let Some(mut shard) = shards::lock(c, of.job, of.phase, shard_of(first)).await? else { return Ok(()) };
    match of.kind {
        Kind::Check => shard.checks.give_back(first),
        Kind::Work | Kind::Twin(_) => shard.give_back(tiles),
    }
    shards::save(c, of.job, of.phase, shard_of(first), &shard).await
}

async fn save(c: &mut Tx, token: Token, row: &AttemptRow, now: UnixMillis) -> Result<(), StoreError> {
    let (deadline, remaining, ended) = match &row.state {
        Attempt::Held { deadline, remaining, .. } => (Some(*deadline), runs_text(remaining), None),
        _ => (None, String::new(), Some(now)),
    };
    let query = sql("UPDATE attempts SET state = $1, remaining = $2, deadline = COALESCE($3, deadline), ended = COALESCE(ended, $4)
         WHERE token = $5");
    c.run(query.bind(row.state.name()).bind(remaining).bind(deadline).bind(ended).bind(token.to_string())).await?;
    Ok(())
}

/// Somebody else delivered these tiles of a shard: every held attempt that owes some of them is told.
pub(super) async fn overtake(c: &mut Tx, by: Token, of: &AttemptRow, tiles: &TileRuns, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT * FROM attempts WHERE job = $1 AND phase = $2 AND state = 'held' AND kind <> 'check' AND token <> $3
         AND first >= $4 AND first < $5
         ORDER BY token")
    .locking();
    let start = shard_of(TileIndex(of.run.start)) * lease::SHARD_TILES;
    let query = query.bind(of.job.to_string()).bind(of.phase.to_string()).bind(by.to_string());
    for found in c.all(query.bind(start).bind(start + lease::SHARD_TILES)).await? {
        let (token, mut other) = (parse("a token", &found.text("token")?)?, row(&found)?);
        let owes = matches!(&other.state, Attempt::Held { remaining, .. } if !remaining.intersection(tiles).is_empty());
        if !owes {
            continue;
        }
        if let Ok((state, _)) = other.state.clone().apply(lease::Event::Overtaken(tiles.clone()), now) {
            other.state = state;
            save(c, token, &other, now).await?;
            if other.state == Attempt::Fenced {
                workers::contribute(c, token, &other, None, now).await?;
            }
        }
    }
    Ok(())
}

/// Fences whatever a job's workers hold; what they owe waits again.
pub(super) async fn suspend(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT * FROM attempts WHERE job = $1 AND state = 'held' ORDER BY token").locking();
    let held = c.all(query.bind(job.to_string())).await?;
    fence(c, &held, now).await?;
    fence_all(c, job, now).await
}

/// Fences whatever a worker holds or might still deliver late, of any job; what it owes waits again.
pub(super) async fn dismiss(c: &mut Tx, worker: WorkerId, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT * FROM attempts WHERE worker = $1 AND state IN ('held', 'expired') ORDER BY token").locking();
    let open = c.all(query.bind(worker.to_string())).await?;
    fence(c, &open, now).await
}

async fn fence(c: &mut Tx, rows: &[Row], now: UnixMillis) -> Result<(), StoreError> {
    for found in rows {
        let (token, mut attempt) = (parse("a token", &found.text("token")?)?, row(found)?);
        let was_held = matches!(attempt.state, Attempt::Held { .. });
        let Ok((state, actions)) = attempt.state.clone().apply(lease::Event::Fence, now) else { continue };
        attempt.state = state;
        save(c, token, &attempt, now).await?;
        for action in actions {
            let (Action::Return(tiles) | Action::Suspect(tiles)) = action;
            hand_back(c, &attempt, &tiles).await?;
        }
        if was_held {
            workers::contribute(c, token, &attempt, None, now).await?;
        }
    }
    Ok(())
}

/// Heartbeats of many attempts at once. Those that are held are extended and answered with; the others must stop. An attempt whose time has
/// come is not: letting it expire is [`expire`]'s business. The rule is [`Attempt::apply`]'s, said in SQL, because ten thousand of these come
/// in a second; the conformance suite holds the two together.
pub(in super::super) async fn heartbeats(
    c: &mut Tx,
    beats: &[Beat],
    ttl: i64,
    now: UnixMillis,
) -> Result<HashMap<Token, AttemptRow>, StoreError> {
    if c.is_postgres() {
        let query = sql("WITH beats AS (SELECT * FROM unnest($1::TEXT[], $2::BIGINT[]) AS b (token, rays)),
             held AS (SELECT a.token FROM attempts a WHERE a.token = ANY($1) AND a.state = 'held' AND a.deadline > $3 AND a.cap > $3
                      ORDER BY a.token FOR NO KEY UPDATE)
             UPDATE attempts a SET deadline = $4, rays = GREATEST(a.rays, b.rays)
             FROM beats b JOIN held h ON h.token = b.token WHERE a.token = b.token RETURNING a.*");
        let (tokens, rays): (Vec<String>, Vec<i64>) = beats.iter().map(|b| (b.token.to_string(), int(b.rays))).unzip();
        let rows = c.all(query.bind(tokens).bind(rays).bind(now).bind(now.saturating_add(ttl))).await?;
        return rows.iter().map(|found| Ok((parse("a token", &found.text("token")?)?, row(found)?))).collect();
    }
    let mut held = HashMap::with_capacity(beats.len());
    for beat in beats {
        let query = sql("UPDATE attempts SET deadline = $1, rays = MAX(rays, $2)
             WHERE token = $3 AND state = 'held' AND deadline > $4 AND cap > $4 RETURNING *");
        let query = query.bind(now.saturating_add(ttl)).bind(beat.rays).bind(beat.token.to_string()).bind(now);
        if let Some(found) = c.one(query).await? {
            held.insert(beat.token, row(&found)?);
        }
    }
    Ok(held)
}

/// Ends several attempts: an answer for each, in order.
pub(in super::super) async fn finish_all(c: &mut Tx, endings: &[Ending], now: UnixMillis) -> Result<Vec<FinishOutcome>, StoreError> {
    locks::of_attempts(c, endings.iter().map(|e| e.token)).await?;
    let mut outcomes = Vec::with_capacity(endings.len());
    for ending in endings {
        outcomes.push(finish(c, ending, now).await?);
    }
    Ok(outcomes)
}

async fn finish(c: &mut Tx, ending: &Ending, now: UnixMillis) -> Result<FinishOutcome, StoreError> {
    let token = ending.token;
    let Some(mut row) = get(c, token).await? else { return Ok(FinishOutcome::Gone("unknown".into())) };
    let was_held = matches!(row.state, Attempt::Held { .. });
    if let (Attempt::Held { remaining, .. }, Kind::Work | Kind::Twin(_)) = (&mut row.state, row.kind) {
        // Tiles that somebody else delivered late are no debt of this attempt.
        if let Some(shard) = shards::lock(c, row.job, row.phase, shard_of(TileIndex(row.run.start))).await? {
            *remaining = remaining.minus(&shard.done);
        }
    }
    let reason = ending.finish.as_ref().and_then(|finish| finish.failure.clone());
    let reason = reason.unwrap_or_else(|| match ending.event {
        lease::Event::Refuse => "it sent what cannot be accepted".into(),
        _ => "it said that it was done and was not".into(),
    });
    if let Err(illegal) = happen(c, token, &mut row, ending.event.clone(), &reason, now).await? {
        return Ok(FinishOutcome::Gone(illegal.state.into()));
    }
    if was_held {
        workers::contribute(c, token, &row, ending.finish.as_ref(), now).await?;
    }
    Ok(FinishOutcome::Finished(row))
}

/// Fences whatever a job's workers hold. Its shards go with it, so nothing is given back.
pub(super) async fn fence_all(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    // Expired attempts too: a job that is over takes no late deliveries.
    let query = sql("SELECT token FROM attempts WHERE job = $1 AND state IN ('held', 'expired') ORDER BY token").locking();
    if c.is_postgres() {
        c.all(query.bind(job.to_string())).await?;
    }
    let query = sql("UPDATE attempts SET state = 'fenced', remaining = '', ended = COALESCE(ended, $1)
         WHERE job = $2 AND state IN ('held', 'expired')");
    c.run(query.bind(now).bind(job.to_string())).await?;
    Ok(())
}

/// Held attempts whose time has come, by job.
pub(in super::super) async fn due(c: &mut Tx, now: UnixMillis) -> Result<BTreeMap<JobId, Vec<Token>>, StoreError> {
    let query = sql("SELECT job, token FROM attempts WHERE state = 'held' AND (deadline <= $1 OR cap <= $1) ORDER BY job, token");
    let mut due: BTreeMap<JobId, Vec<Token>> = BTreeMap::new();
    for row in c.all(query.bind(now)).await? {
        due.entry(parse("a job id", &row.text("job")?)?).or_default().push(parse("a token", &row.text("token")?)?);
    }
    Ok(due)
}

/// Lets these attempts of one job expire, as far as their time has come. How many did.
pub(in super::super) async fn expire(c: &mut Tx, tokens: &[Token], now: UnixMillis) -> Result<u64, StoreError> {
    locks::of_attempts(c, tokens.iter().copied()).await?;
    let mut expired = 0;
    for token in tokens {
        let Some(mut row) = get(c, *token).await? else { continue };
        if !matches!(row.state, Attempt::Held { .. }) {
            continue;
        }
        if happen(c, *token, &mut row, lease::Event::Tick, "it fell silent", now).await?.is_ok() && row.state == Attempt::Expired {
            workers::contribute(c, *token, &row, None, now).await?;
            expired += 1;
        }
    }
    Ok(expired)
}

/// Forgets attempts that ended before a moment.
pub(in super::super) async fn forget(c: &mut Tx, before: UnixMillis) -> Result<(), StoreError> {
    // Expired attempts may still deliver while their job bakes; the others only answer repeated calls.
    c.run(sql("DELETE FROM attempts WHERE ended < $1 AND state <> 'expired'").bind(before)).await?;
    Ok(())
}
