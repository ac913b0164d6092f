//! Jobs: rows, and the one place where something happens to them.

use super::{
    attempts, events,
    rows::{count, from_json, int, job_state, json, parse, public},
    scenes, shards, tasks,
};
use crate::{
    job::{self, Action, Job},
    records::{EventKind, JobState, Problem, SceneState, UnixMillis},
    store::{JobFilter, JobRow, JobSpec, PlanRef, StoreError, Task},
};
use kiln_proto::{ids::JobId, wire::message::Phase};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

/// A state with the phase while baking, and when it was entered.
type Mark = (JobState, Option<Phase>, UnixMillis);

pub(super) async fn add(c: &mut SqliteConnection, spec: &JobSpec, now: UnixMillis) -> Result<(), StoreError> {
    let scene = scenes::get(c, spec.scene).await?;
    let marks: Vec<Mark> = vec![(JobState::Queued, None, now)];
    sqlx::query(
        "INSERT INTO jobs (id, scene, scene_hash, public, state, settings, priority, labels, bake_version, created, marks)
         VALUES (?, ?, ?, 'queued', ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(spec.id.to_string())
    .bind(spec.scene.to_string())
    .bind(scene.as_ref().and_then(|s| s.record.scene).map(|s| s.to_string()))
    .bind(json(&Job::Queued)?)
    .bind(json(&spec.settings)?)
    .bind(spec.priority)
    .bind(json(&spec.labels)?)
    .bind(spec.bake_version)
    .bind(now)
    .bind(json(&marks)?)
    .execute(&mut *c)
    .await?;
    events::append(c, spec.id, &EventKind::State { state: JobState::Queued, phase: None }, now).await?;
    let event = match scene.map(|s| s.record) {
        Some(scene) if scene.state == SceneState::Ready => Some(job::Event::SceneReady),
        Some(scene) if scene.state == SceneState::Rejected => Some(job::Event::Fail(scenes::rejected(&scene.problems))),
        _ => None,
    };
    if let Some(event) = event {
        happen(c, spec.id, &event, now).await?;
    }
    Ok(())
}

/// Applies an event to a job and performs what follows. `None` where there is no such job; the inner error where it does not fit.
pub(super) async fn happen(
    c: &mut SqliteConnection,
    id: JobId,
    event: &job::Event,
    now: UnixMillis,
) -> Result<Option<Result<(), job::Illegal>>, StoreError> {
    let Some((old, mut marks)) = state(c, id).await? else { return Ok(None) };
    let (new, actions) = match job::apply(&old, event) {
        Ok(next) => next,
        Err(illegal) => return Ok(Some(Err(illegal))),
    };
    let changed = (old.public(), old.phase()) != (new.public(), new.phase());
    if changed {
        marks.push((new.public(), new.phase(), now));
    }
    sqlx::query("UPDATE jobs SET state = ?, public = ?, marks = ? WHERE id = ?")
        .bind(json(&new)?)
        .bind(public(new.public()))
        .bind(json(&marks)?)
        .bind(id.to_string())
        .execute(&mut *c)
        .await?;
    if let Job::Failed { problem } = &new {
        events::append(c, id, &EventKind::Problem { problem: problem.clone() }, now).await?;
    }
    if changed {
        events::append(c, id, &EventKind::State { state: new.public(), phase: new.phase() }, now).await?;
    }
    for action in &actions {
        perform(c, id, action, now).await?;
    }
    Ok(Some(Ok(())))
}

async fn perform(c: &mut SqliteConnection, id: JobId, action: &Action, now: UnixMillis) -> Result<(), StoreError> {
    match action {
        Action::Enqueue(task) => tasks::enqueue(c, &Task::Job(id, *task)).await,
        Action::OpenPhase { phase, tiles } => {
            sqlx::query("UPDATE jobs SET tiles = ?, tiles_done = 0, cost_done = 0 WHERE id = ?")
                .bind(int(*tiles))
                .bind(id.to_string())
                .execute(&mut *c)
                .await?;
            shards::open(c, id, *phase, *tiles).await
        }
        Action::Recall => tasks::drop_all(c, id).await,
        Action::Withdraw => {
            attempts::fence_all(c, id, now).await?;
            tasks::drop_all(c, id).await
        }
        Action::Retire => {
            attempts::fence_all(c, id, now).await?;
            for table in ["DELETE FROM shards WHERE job = ?", "DELETE FROM chunks WHERE job = ?"] {
                sqlx::query(table).bind(id.to_string()).execute(&mut *c).await?;
            }
            Ok(())
        }
    }
}

/// Only what the state machine needs of a job.
pub(super) async fn state(c: &mut SqliteConnection, id: JobId) -> Result<Option<(Job, Vec<Mark>)>, StoreError> {
    let query = sqlx::query_as("SELECT state, marks FROM jobs WHERE id = ?").bind(id.to_string());
    let row: Option<(String, String)> = query.fetch_optional(c).await?;
    row.map(|(state, marks)| Ok((job_state(&state)?, from_json("marks", &marks)?))).transpose()
}

/// A job with what its held attempts add.
const SELECT: &str = "SELECT jobs.*,
    (SELECT COUNT(DISTINCT worker) FROM attempts a WHERE a.job = jobs.id AND a.state = 'held') AS workers,
    (SELECT COALESCE(SUM(rays), 0) FROM attempts a WHERE a.job = jobs.id AND a.state = 'held') AS rays_held,
    (SELECT why FROM tasks t WHERE t.job = jobs.id AND t.why IS NOT NULL LIMIT 1) AS why
    FROM jobs";

fn row(row: &SqliteRow) -> Result<JobRow, StoreError> {
    let text = |column: &str| row.try_get::<String, _>(column);
    let maybe = |column: &str| row.try_get::<Option<String>, _>(column);
    let number = |column: &str| row.try_get::<i64, _>(column).map(count);
    let plan = match (maybe("plan")?, maybe("plan_blob")?) {
        (Some(digest), Some(blob)) => Some(PlanRef { digest: parse("a digest", &digest)?, blob: parse("a blob name", &blob)? }),
        _ => None,
    };
    Ok(JobRow {
        spec: JobSpec {
            id: parse("a job id", &text("id")?)?,
            scene: parse("a scene id", &text("scene")?)?,
            settings: from_json("settings", &text("settings")?)?,
            priority: row.try_get("priority")?,
            labels: from_json("labels", &text("labels")?)?,
            bake_version: row.try_get("bake_version")?,
        },
        scene_hash: maybe("scene_hash")?.map(|t| parse("a scene hash", &t)).transpose()?,
        state: job_state(&text("state")?)?,
        plan,
        tiles: (number("tiles")?, number("tiles_done")?),
        cost: (number("cost")?, number("cost_done")?),
        texels: number("texels")?,
        rays: number("rays")? + number("rays_held")?,
        workers: row.try_get("workers")?,
        put_off: maybe("why")?,
        created_ms: row.try_get("created")?,
        marks: from_json("marks", &text("marks")?)?,
        seq: row.try_get("seq")?,
    })
}

pub(super) async fn get(c: &mut SqliteConnection, id: JobId) -> Result<Option<JobRow>, StoreError> {
    let mut query = sqlx::QueryBuilder::new(SELECT);
    query.push(" WHERE id = ").push_bind(id.to_string());
    query.build().fetch_optional(c).await?.as_ref().map(row).transpose()
}

pub(super) async fn list(c: &mut SqliteConnection, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
    let mut query = sqlx::QueryBuilder::new(SELECT);
    query.push(" WHERE TRUE");
    if let Some(state) = filter.state {
        query.push(" AND public = ").push_bind(public(state));
    }
    if let Some((name, value)) = &filter.label {
        query.push(" AND EXISTS (SELECT 1 FROM json_each(labels) l WHERE l.key = ").push_bind(name.clone());
        query.push(" AND l.value = ").push_bind(value.clone()).push(")");
    }
    if let Some(cursor) = filter.cursor {
        query.push(" AND id < ").push_bind(cursor.to_string());
    }
    let limit = if filter.limit == 0 { 100 } else { filter.limit };
    query.push(" ORDER BY id DESC LIMIT ").push_bind(limit);
    query.build().fetch_all(c).await?.iter().map(row).collect()
}

/// Makes a plan the job's present one; workers may still ask for earlier ones by their digests.
pub(super) async fn set_plan(c: &mut SqliteConnection, id: JobId, plan: &PlanRef, cost: u64) -> Result<(), StoreError> {
    let (digest, blob) = (plan.digest.to_string(), plan.blob.to_string());
    sqlx::query("UPDATE jobs SET plan = ?, plan_blob = ?, cost = ? WHERE id = ?")
        .bind(&digest)
        .bind(&blob)
        .bind(int(cost))
        .bind(id.to_string())
        .execute(&mut *c)
        .await?;
    sqlx::query("INSERT OR REPLACE INTO plans (digest, job, blob) VALUES (?, ?, ?)")
        .bind(digest)
        .bind(id.to_string())
        .bind(blob)
        .execute(c)
        .await?;
    Ok(())
}

pub(super) async fn add_problem(c: &mut SqliteConnection, id: JobId, problem: &Problem, now: UnixMillis) -> Result<(), StoreError> {
    if state(c, id).await?.is_some() {
        events::append(c, id, &EventKind::Problem { problem: problem.clone() }, now).await?;
    }
    Ok(())
}

pub(super) async fn delete(c: &mut SqliteConnection, id: JobId) -> Result<bool, StoreError> {
    const TABLES: [&str; 10] = [
        "DELETE FROM plans WHERE job = ?",
        "DELETE FROM shards WHERE job = ?",
        "DELETE FROM attempts WHERE job = ?",
        "DELETE FROM chunks WHERE job = ?",
        "DELETE FROM tasks WHERE job = ?",
        "DELETE FROM reports WHERE job = ?",
        "DELETE FROM package_files WHERE job = ?",
        "DELETE FROM events WHERE job = ?",
        "DELETE FROM contributions WHERE job = ?",
        "DELETE FROM jobs WHERE id = ?",
    ];
    let mut removed = 0;
    for table in TABLES {
        removed = sqlx::query(table).bind(id.to_string()).execute(&mut *c).await?.rows_affected();
    }
    Ok(removed > 0)
}
