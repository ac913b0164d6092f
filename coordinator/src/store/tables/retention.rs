//! Forgets jobs and uploads that are long over.

use super::{jobs, scenes};
use crate::{
    records::{JobState, UnixMillis},
    store::{
        StoreError,
        rows::{from_json, parse},
        sql::{Tx, sql},
    },
};
use kiln_proto::{ids::JobId, wire::message::Phase};
use uuid::Uuid;

/// When a job ended, by its marks.
fn ended(marks: &[(JobState, Option<Phase>, UnixMillis)]) -> Option<UnixMillis> {
    marks.last().filter(|(state, ..)| state.is_final()).map(|(.., at)| *at)
}

pub(in super::super) async fn ended_jobs(c: &mut Tx, before: UnixMillis) -> Result<Vec<JobId>, StoreError> {
    // What is younger has not ended before either.
    let query = sql("SELECT id, marks FROM jobs WHERE public IN ('done', 'failed', 'cancelled') AND created <= $1 ORDER BY id");
    let mut found = Vec::new();
    for row in c.all(query.bind(before)).await? {
        let marks: Vec<_> = from_json("marks", &row.text("marks")?)?;
        if ended(&marks).is_some_and(|at| at <= before) {
            found.push(parse("a job id", &row.text("id")?)?);
        }
    }
    Ok(found)
}

pub(in super::super) async fn delete_job(c: &mut Tx, id: JobId, before: UnixMillis) -> Result<bool, StoreError> {
    let over = jobs::state(c, id).await?.is_some_and(|(_, marks)| ended(&marks).is_some_and(|at| at <= before));
    if over { jobs::delete(c, id).await } else { Ok(false) }
}

pub(in super::super) async fn unused_scenes(c: &mut Tx, before: UnixMillis) -> Result<Vec<Uuid>, StoreError> {
    let query = sql("SELECT id FROM scenes WHERE created <= $1 AND state IN ('ready', 'rejected')
         AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.scene = scenes.id) ORDER BY id");
    c.all(query.bind(before)).await?.iter().map(|row| parse("a scene id", &row.text("id")?)).collect()
}

pub(in super::super) async fn delete_scene(c: &mut Tx, id: Uuid, before: UnixMillis) -> Result<bool, StoreError> {
    // A job that is being created holds the lock, and is seen by the statement behind it.
    scenes::lock(c, id).await?;
    let query = sql("DELETE FROM scenes WHERE id = $1 AND created <= $2 AND state IN ('ready', 'rejected')
         AND NOT EXISTS (SELECT 1 FROM jobs WHERE jobs.scene = scenes.id)");
    Ok(c.run(query.bind(id.to_string()).bind(before)).await? > 0)
}
