//! Jobs: rows, and the one place where something happens to them.

use super::{attempts, events, scenes, shards, tasks, tokens};
use crate::{
    job::{self, Action, Job},
    records::{EventKind, JobState, Problem, SceneState, UnixMillis},
    store::{
        JobFilter, JobRow, JobSpec, PlanRef, StoreError, Task,
        rows::{from_json, job_state, json, on_poison, parse, public, strange},
        sql::{Row, Tx, either, sql},
    },
};
use kiln_proto::{ids::JobId, wire::message::Phase};

/// A state with the phase while baking, and when it was entered.
type Mark = (JobState, Option<Phase>, UnixMillis);

/// Locks a job's row before anything of it is touched, so that two coordinators never wait for each other in a circle.
pub(super) async fn lock(c: &mut Tx, id: JobId) -> Result<(), StoreError> {
    if c.is_postgres() {
        c.all(sql("SELECT id FROM jobs WHERE id = $1").locking().bind(id.to_string())).await?;
    }
    Ok(())
}

pub(in super::super) async fn add(c: &mut Tx, spec: &JobSpec, now: UnixMillis) -> Result<(), StoreError> {
    // Locked, or its import could end between this look and the new row, and nobody would wake the job.
    let scene = scenes::lock(c, spec.scene).await?;
    let marks: Vec<Mark> = vec![(JobState::Queued, None, now)];
    let query = sql("INSERT INTO jobs (id, scene, scene_hash, public, state, settings, priority, labels, bake_version, created, marks, on_poison, owner,
         verify, secret, webhook) VALUES ($1, $2, $3, 'queued', $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15)");
    let query = query.bind(spec.id.to_string()).bind(spec.scene.to_string());
    let query = query.bind(scene.as_ref().and_then(|s| s.record.scene).map(|s| s.to_string())).bind(json(&Job::Queued)?);
    let query = query.bind(json(&spec.settings)?).bind(spec.priority).bind(json(&spec.labels)?).bind(spec.bake_version);
    let query = query.bind(now).bind(json(&marks)?).bind(spec.on_poison.name()).bind(spec.owner.map(|id| id.to_string()));
    c.run(query.bind(spec.verify).bind(&spec.secret).bind(spec.webhook.clone())).await?;
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
pub(in super::super) async fn happen(
    c: &mut Tx,
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
    let query = sql("UPDATE jobs SET state = $1, public = $2, marks = $3 WHERE id = $4");
    c.run(query.bind(json(&new)?).bind(public(new.public())).bind(json(&marks)?).bind(id.to_string())).await?;
    if let Job::Failed { problem, .. } = &new {
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

async fn perform(c: &mut Tx, id: JobId, action: &Action, now: UnixMillis) -> Result<(), StoreError> {
    match action {
        Action::Enqueue(task) => tasks::enqueue(c, &Task::Job(id, *task)).await,
        Action::OpenPhase { phase, tiles } => {
            let query = sql("UPDATE jobs SET tiles = $1, tiles_done = 0, cost_done = 0 WHERE id = $2");
            c.run(query.bind(*tiles).bind(id.to_string())).await?;
            shards::open(c, id, *phase, *tiles).await
        }
        Action::Recall => tasks::drop_all(c, id).await,
        Action::Suspend => attempts::suspend(c, id, now).await,
        Action::Reopen { phase } => shards::reopen(c, id, *phase).await,
        Action::Withdraw => {
            tasks::drop_all(c, id).await?;
            attempts::fence_all(c, id, now).await
        }
        Action::Retire => {
            attempts::fence_all(c, id, now).await?;
            shards::delete(c, id).await?;
            c.run(sql("DELETE FROM chunks WHERE job = $1").bind(id.to_string())).await?;
            Ok(())
        }
        Action::Announce => tasks::announce(c, id, now).await,
    }
}

/// Only what the state machine needs of a job, locked.
pub(super) async fn state(c: &mut Tx, id: JobId) -> Result<Option<(Job, Vec<Mark>)>, StoreError> {
    let row = c.one(sql("SELECT state, marks FROM jobs WHERE id = $1").locking().bind(id.to_string())).await?;
    row.map(|row| Ok((job_state(&row.text("state")?)?, from_json("marks", &row.text("marks")?)?))).transpose()
}

/// A job with what its held attempts add.
macro_rules! select {
    ($rest:literal) => {
        concat!(
            "SELECT jobs.*,
             (SELECT COUNT(DISTINCT worker) FROM attempts a WHERE a.job = jobs.id AND a.state = 'held') AS workers,
             (SELECT CAST(COALESCE(SUM(rays), 0) AS BIGINT) FROM attempts a WHERE a.job = jobs.id AND a.state = 'held') AS rays_held,
             (SELECT CAST(COALESCE(SUM(waiting), 0) AS BIGINT) FROM shards s WHERE s.job = jobs.id AND s.waiting > 0) AS pending,
             (SELECT CAST(COALESCE(SUM(unchecked), 0) AS BIGINT) FROM shards s WHERE s.job = jobs.id AND s.unchecked > 0) AS unchecked,
             (SELECT why FROM tasks t WHERE t.job = jobs.id AND t.why IS NOT NULL LIMIT 1) AS why
             FROM jobs ",
            $rest
        )
    };
}

fn row(row: &Row) -> Result<JobRow, StoreError> {
    let plan = match (row.maybe_text("plan")?, row.maybe_text("plan_blob")?) {
        (Some(digest), Some(blob)) => Some(PlanRef { digest: parse("a digest", &digest)?, blob: parse("a blob name", &blob)? }),
        _ => None,
    };
    let priority = row.int("priority")?;
    Ok(JobRow {
        spec: JobSpec {
            id: parse("a job id", &row.text("id")?)?,
            scene: parse("a scene id", &row.text("scene")?)?,
            settings: from_json("settings", &row.text("settings")?)?,
            priority: i32::try_from(priority).map_err(|_| strange("a priority", priority.to_string()))?,
            labels: from_json("labels", &row.text("labels")?)?,
            bake_version: row.small("bake_version")?,
            on_poison: on_poison(&row.text("on_poison")?)?,
            owner: tokens::owner(row)?,
            verify: row.real("verify")?,
            secret: row.text("secret")?,
            webhook: row.maybe_text("webhook")?,
        },
        scene_hash: row.maybe_text("scene_hash")?.map(|t| parse("a scene hash", &t)).transpose()?,
        state: job_state(&row.text("state")?)?,
        plan,
        tiles: (row.count("tiles")?, row.count("tiles_done")?),
        cost: (row.count("cost")?, row.count("cost_done")?),
        texels: row.count("texels")?,
        rays: row.count("rays")?.saturating_add(row.count("rays_held")?),
        workers: row.small("workers")?,
        pending: row.count("pending")?,
        unchecked: row.count("unchecked")?,
        put_off: row.maybe_text("why")?,
        created_ms: row.int("created")?,
        marks: from_json("marks", &row.text("marks")?)?,
        seq: row.int("seq")?,
    })
}

pub(in super::super) async fn get(c: &mut Tx, id: JobId) -> Result<Option<JobRow>, StoreError> {
    c.one(sql(select!("WHERE id = $1")).bind(id.to_string())).await?.as_ref().map(row).transpose()
}

/// Jobs asked for at once unless a limit is given.
const PAGE: u32 = 100;

pub(in super::super) async fn list(c: &mut Tx, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
    let query = either(
        select!(
            "WHERE ($1 IS NULL OR public = $1) AND ($2 IS NULL OR id < $2) AND ($3 IS NULL OR EXISTS
             (SELECT 1 FROM json_each(labels) l WHERE l.key = $3 AND l.value = $4)) AND ($6 IS NULL OR owner = $6) ORDER BY id DESC LIMIT $5"
        ),
        select!(
            "WHERE (CAST($1 AS TEXT) IS NULL OR public = $1) AND (CAST($2 AS TEXT) IS NULL OR id < $2)
             AND (CAST($3 AS TEXT) IS NULL OR labels::JSONB ->> $3 = CAST($4 AS TEXT))
             AND (CAST($6 AS TEXT) IS NULL OR owner = $6) ORDER BY id DESC LIMIT $5"
        ),
    );
    let (name, value) = filter.label.clone().unzip();
    let limit = if filter.limit == 0 { PAGE } else { filter.limit };
    let query = query.bind(filter.state.map(|state| public(state).to_owned())).bind(filter.cursor.map(|id| id.to_string()));
    c.all(query.bind(name).bind(value).bind(limit).bind(tokens::owned_by(filter.scope))).await?.iter().map(row).collect()
}

/// Changes a job's priority. Whether it exists.
pub(in super::super) async fn set_priority(c: &mut Tx, id: JobId, priority: i32) -> Result<bool, StoreError> {
    Ok(c.run(sql("UPDATE jobs SET priority = $1 WHERE id = $2").bind(priority).bind(id.to_string())).await? > 0)
}

/// Takes tiles and their cost out of a job's progress.
pub(super) async fn undo(c: &mut Tx, id: JobId, tiles: u64, cost: u64) -> Result<(), StoreError> {
    let query = sql("UPDATE jobs SET tiles_done = tiles_done - $1, cost_done = CASE WHEN cost_done > $2 THEN cost_done - $2 ELSE 0 END
         WHERE id = $3");
    c.run(query.bind(tiles).bind(cost).bind(id.to_string())).await?;
    Ok(())
}

/// Makes a plan the job's present one; workers may still ask for earlier ones by their digests.
pub(super) async fn set_plan(c: &mut Tx, id: JobId, plan: &PlanRef, cost: u64) -> Result<(), StoreError> {
    let (digest, blob) = (plan.digest.to_string(), plan.blob.to_string());
    let query = sql("UPDATE jobs SET plan = $1, plan_blob = $2, cost = $3 WHERE id = $4");
    c.run(query.bind(&digest).bind(&blob).bind(cost).bind(id.to_string())).await?;
    let query =
        sql("INSERT INTO plans (digest, job, blob) VALUES ($1, $2, $3) ON CONFLICT (digest, job) DO UPDATE SET blob = excluded.blob");
    c.run(query.bind(digest).bind(id.to_string()).bind(blob)).await?;
    Ok(())
}

/// The compressed bytes of a plan that a job has or had.
pub(in super::super) async fn plan(c: &mut Tx, digest: &str) -> Result<Option<crate::blob::BlobName>, StoreError> {
    let row = c.one(sql("SELECT blob FROM plans WHERE digest = $1 LIMIT 1").bind(digest)).await?;
    row.map(|row| parse("a blob name", &row.text("blob")?)).transpose()
}

pub(in super::super) async fn add_problem(c: &mut Tx, id: JobId, problem: &Problem, now: UnixMillis) -> Result<(), StoreError> {
    if state(c, id).await?.is_some() {
        events::append(c, id, &EventKind::Problem { problem: problem.clone() }, now).await?;
    }
    Ok(())
}

pub(in super::super) async fn delete(c: &mut Tx, id: JobId) -> Result<bool, StoreError> {
    const TABLES: [&str; 9] = [
        "DELETE FROM plans WHERE job = $1",
        "DELETE FROM tasks WHERE job = $1",
        "DELETE FROM attempts WHERE job = $1",
        "DELETE FROM shards WHERE job = $1",
        "DELETE FROM chunks WHERE job = $1",
        "DELETE FROM reports WHERE job = $1",
        "DELETE FROM package_files WHERE job = $1",
        "DELETE FROM events WHERE job = $1",
        "DELETE FROM contributions WHERE job = $1",
    ];
    lock(c, id).await?;
    for table in TABLES {
        c.run(sql(table).bind(id.to_string())).await?;
    }
    Ok(c.run(sql("DELETE FROM jobs WHERE id = $1").bind(id.to_string())).await? > 0)
}
