//! The event stream of each job. A number is allocated in the transaction of what it reports, so that the stream has neither gaps nor
//! events of things that did not happen.

use super::rows::{from_json, json};
use crate::{
    records::{EventKind, JobEvent, UnixMillis},
    store::{EventPage, StoreError},
};
use kiln_proto::ids::JobId;
use sqlx::SqliteConnection;

/// Events kept of each job.
pub(super) const KEPT: i64 = 10_000;

pub(super) async fn append(c: &mut SqliteConnection, job: JobId, kind: &EventKind, now: UnixMillis) -> Result<(), StoreError> {
    let id = job.to_string();
    let next = sqlx::query_scalar("UPDATE jobs SET seq = seq + 1 WHERE id = ? RETURNING seq").bind(&id);
    let seq: i64 = next.fetch_one(&mut *c).await?;
    sqlx::query("INSERT INTO events (job, seq, at, kind) VALUES (?, ?, ?, ?)")
        .bind(&id)
        .bind(seq)
        .bind(now)
        .bind(json(kind)?)
        .execute(&mut *c)
        .await?;
    sqlx::query("DELETE FROM events WHERE job = ? AND seq <= ?").bind(&id).bind(seq - KEPT).execute(c).await?;
    Ok(())
}

pub(super) async fn page(c: &mut SqliteConnection, job: JobId, after: i64, limit: u32) -> Result<Option<EventPage>, StoreError> {
    let id = job.to_string();
    let last: Option<i64> = sqlx::query_scalar("SELECT seq FROM jobs WHERE id = ?").bind(&id).fetch_optional(&mut *c).await?;
    let Some(last) = last else { return Ok(None) };
    let query = sqlx::query_as("SELECT seq, at, kind FROM events WHERE job = ? AND seq > ? ORDER BY seq LIMIT ?");
    let rows: Vec<(i64, UnixMillis, String)> = query.bind(&id).bind(after).bind(limit).fetch_all(c).await?;
    let events = rows.into_iter().map(|(seq, at_ms, kind)| Ok(JobEvent { seq, at_ms, kind: from_json("an event", &kind)? }));
    let events = events.collect::<Result<Vec<_>, StoreError>>()?;
    // A number from the future (another data folder, perhaps) is as useless to its client as one that was dropped.
    let dropped = after > last || after < last - KEPT;
    Ok(Some(EventPage { events, dropped }))
}
