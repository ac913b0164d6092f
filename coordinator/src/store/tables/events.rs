//! The event stream of each job. A number is allocated in the transaction of what it reports, so that the stream has neither gaps nor
//! events of things that did not happen.

use crate::{
    records::{EventKind, JobEvent, UnixMillis},
    store::{
        EventPage, StoreError,
        rows::{from_json, json, strange},
        sql::{Tx, sql},
    },
};
use kiln_proto::ids::JobId;

/// Events kept of each job.
const KEPT: i64 = 10_000;

pub(super) async fn append(c: &mut Tx, job: JobId, kind: &EventKind, now: UnixMillis) -> Result<(), StoreError> {
    let id = job.to_string();
    let next = c.one(sql("UPDATE jobs SET seq = seq + 1 WHERE id = $1 RETURNING seq").bind(&id)).await?;
    let seq = next.ok_or_else(|| strange("the job of an event", "nothing"))?.int("seq")?;
    let insert = sql("INSERT INTO events (job, seq, at, kind) VALUES ($1, $2, $3, $4)");
    c.run(insert.bind(&id).bind(seq).bind(now).bind(json(kind)?)).await?;
    if seq > KEPT {
        c.run(sql("DELETE FROM events WHERE job = $1 AND seq <= $2").bind(&id).bind(seq - KEPT)).await?;
    }
    Ok(())
}

pub(in super::super) async fn page(c: &mut Tx, job: JobId, after: i64, limit: u32) -> Result<Option<EventPage>, StoreError> {
    let id = job.to_string();
    let Some(row) = c.one(sql("SELECT seq FROM jobs WHERE id = $1").bind(&id)).await? else { return Ok(None) };
    let last = row.int("seq")?;
    let query = sql("SELECT seq, at, kind FROM events WHERE job = $1 AND seq > $2 ORDER BY seq LIMIT $3");
    let rows = c.all(query.bind(&id).bind(after).bind(limit)).await?;
    let event = |row: &crate::store::sql::Row| {
        Ok(JobEvent { seq: row.int("seq")?, at_ms: row.int("at")?, kind: from_json("an event", &row.text("kind")?)? })
    };
    let events = rows.iter().map(event).collect::<Result<Vec<_>, StoreError>>()?;
    // A number from the future (another data folder, perhaps) is as useless to its client as one that was dropped.
    let dropped = after > last || after < last - KEPT;
    Ok(Some(EventPage { events, dropped }))
}
