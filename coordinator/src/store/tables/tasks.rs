//! Coordinator work, leased with tokens. A task that waits has no token; a task that is over has no row.

use super::{jobs, lost, packages, poison, scenes};
use crate::{
    job::{self, JobTask},
    records::{Problem, UnixMillis},
    store::{
        Lane, Notice, StoreError, TASK_TRIES, Task, TaskLease, TaskResult,
        rows::{from_json, json, strange},
        sql::{Tx, either, sql},
    },
};
use kiln_proto::ids::{JobId, Token};

pub(super) async fn enqueue(c: &mut Tx, task: &Task) -> Result<(), StoreError> {
    // Notices are not found by their job: recalling a job's tasks must not recall what is to be told of an earlier end.
    let (job, lane) = match task {
        Task::Job(id, _) => (Some(id.to_string()), Lane::Work),
        Task::Import(_) => (None, Lane::Work),
        Task::Notify(_) => (None, Lane::Notices),
    };
    c.run(sql("INSERT INTO tasks (job, task, notice) VALUES ($1, $2, $3)").bind(job).bind(json(task)?).bind(notice(lane))).await?;
    Ok(())
}

/// Queues the notice of a job's end, where somebody asked for it.
pub(super) async fn announce(c: &mut Tx, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT public, seq FROM jobs WHERE id = $1 AND webhook IS NOT NULL");
    let Some(row) = c.one(query.bind(job.to_string())).await? else { return Ok(()) };
    let state = from_json("a job's public state", &format!("\"{}\"", row.text("public")?))?;
    enqueue(c, &Task::Notify(Notice { job, state, at_ms: now, seq: row.int("seq")? })).await
}

/// The column that tells lanes apart.
fn notice(lane: Lane) -> i64 {
    i64::from(lane == Lane::Notices)
}

pub(super) async fn drop_all(c: &mut Tx, job: JobId) -> Result<(), StoreError> {
    c.run(sql("DELETE FROM tasks WHERE job = $1").bind(job.to_string())).await?;
    Ok(())
}

pub(in super::super) async fn take(
    c: &mut Tx,
    lane: Lane,
    token: Token,
    deadline: UnixMillis,
    now: UnixMillis,
) -> Result<Option<TaskLease>, StoreError> {
    let query = either(
        "UPDATE tasks SET token = $1, deadline = $2, tries = tries + 1
         WHERE id = (SELECT id FROM tasks WHERE token IS NULL AND due <= $3 AND notice = $4 ORDER BY id LIMIT 1) RETURNING task, put_off",
        // `= ANY(ARRAY(...))`, not `IN (...)`, which may be planned as a scan of the whole table.
        "UPDATE tasks SET token = $1, deadline = $2, tries = tries + 1 WHERE id = ANY(ARRAY(
         SELECT id FROM tasks WHERE token IS NULL AND due <= $3 AND notice = $4 ORDER BY id LIMIT 1 FOR UPDATE SKIP LOCKED)) RETURNING task, put_off",
    );
    let Some(row) = c.one(query.bind(token.to_string()).bind(deadline).bind(now).bind(notice(lane))).await? else { return Ok(None) };
    let (task, put_off) = (from_json("a task", &row.text("task")?)?, row.small("put_off")?);
    if let Task::Import(id) = task {
        scenes::mark_importing(c, id).await?;
    }
    Ok(Some(TaskLease { token, task, put_off }))
}

pub(in super::super) async fn renew(c: &mut Tx, token: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
    let query = sql("UPDATE tasks SET deadline = $1 WHERE token = $2").bind(deadline).bind(token.to_string());
    Ok(c.run(query).await? > 0)
}

pub(in super::super) async fn put_off(c: &mut Tx, token: Token, why: &str, due: UnixMillis) -> Result<bool, StoreError> {
    let query = sql("UPDATE tasks SET token = NULL, deadline = NULL, tries = tries - 1, put_off = put_off + 1, due = $1, why = $2
         WHERE token = $3");
    Ok(c.run(query.bind(due).bind(why).bind(token.to_string())).await? > 0)
}

pub(in super::super) async fn take_over(c: &mut Tx, now: UnixMillis) -> Result<u64, StoreError> {
    let held = c.run(sql("UPDATE tasks SET deadline = $1 WHERE token IS NOT NULL").bind(now)).await?;
    expire(c, now).await?;
    Ok(held)
}

/// Puts overdue tasks back, and gives those up that were taken too often.
pub(in super::super) async fn expire(c: &mut Tx, now: UnixMillis) -> Result<u64, StoreError> {
    let query = sql("SELECT id, task, tries FROM tasks WHERE token IS NOT NULL AND deadline <= $1 ORDER BY id");
    let rows = c.all(query.bind(now)).await?;
    let mut expired = 0;
    for row in rows {
        let (id, tries, task) = (row.int("id")?, row.small("tries")?, from_json("a task", &row.text("task")?)?);
        lock_subject(c, task).await?;
        // Somebody else may have renewed, ended or put it back since it was seen.
        if tries < TASK_TRIES {
            let query = sql("UPDATE tasks SET token = NULL, deadline = NULL WHERE id = $1 AND token IS NOT NULL AND deadline <= $2");
            expired += c.run(query.bind(id).bind(now)).await?;
            continue;
        }
        let query = sql("DELETE FROM tasks WHERE id = $1 AND token IS NOT NULL AND deadline <= $2");
        if c.run(query.bind(id).bind(now)).await? == 0 {
            continue;
        }
        expired += 1;
        let message = format!("{} was begun {tries} times and never ended; the coordinator seems to die of it", name(task));
        settle(c, task, &TaskResult::Failed(Problem::new(message)), now).await?;
    }
    Ok(expired)
}

fn name(task: Task) -> &'static str {
    match task {
        Task::Import(_) => "importing the scene",
        Task::Job(_, JobTask::Prepare) => "preparing the job",
        Task::Job(_, JobTask::Merge(_)) => "merging a phase",
        Task::Job(_, JobTask::Assemble(_)) => "assembling a surface",
        Task::Job(_, JobTask::Publish) => "publishing the package",
        Task::Notify(_) => "telling the webhook",
    }
}

/// Locks what a task is about before the task itself.
async fn lock_subject(c: &mut Tx, task: Task) -> Result<(), StoreError> {
    match task {
        Task::Import(scene) => scenes::lock(c, scene).await.map(drop),
        Task::Job(job, _) | Task::Notify(Notice { job, .. }) => jobs::lock(c, job).await,
    }
}

pub(in super::super) async fn finish(c: &mut Tx, token: Token, result: &TaskResult, now: UnixMillis) -> Result<bool, StoreError> {
    let Some(row) = c.one(sql("SELECT task FROM tasks WHERE token = $1").bind(token.to_string())).await? else { return Ok(false) };
    let task = from_json("a task", &row.text("task")?)?;
    lock_subject(c, task).await?;
    if c.run(sql("DELETE FROM tasks WHERE token = $1").bind(token.to_string())).await? == 0 {
        return Ok(false);
    }
    settle(c, task, result, now).await?;
    Ok(true)
}

/// Performs the effects of a task that ended.
async fn settle(c: &mut Tx, task: Task, result: &TaskResult, now: UnixMillis) -> Result<(), StoreError> {
    let id = match task {
        Task::Import(scene) => return scenes::finish(c, scene, result, now).await,
        Task::Job(id, _) => id,
        // The job has ended, however its notice ends.
        Task::Notify(Notice { job, .. }) => match result {
            TaskResult::Failed(problem) => return jobs::add_problem(c, job, problem, now).await,
            _ => return Ok(()),
        },
    };
    let event = match result {
        TaskResult::Prepared { plan, tiles, cost, surfaces, texels, warnings } => {
            jobs::set_plan(c, id, plan, *cost).await?;
            c.run(sql("UPDATE jobs SET texels = $1 WHERE id = $2").bind(*texels).bind(id.to_string())).await?;
            for problem in warnings {
                jobs::add_problem(c, id, problem, now).await?;
            }
            job::Event::Prepared { tiles: *tiles, surfaces: *surfaces }
        }
        TaskResult::Merged { phase, plan, tiles, cost, places } => {
            jobs::set_plan(c, id, plan, *cost).await?;
            poison::set_places(c, id, places).await?;
            job::Event::Merged { phase: *phase, tiles: *tiles }
        }
        TaskResult::Assembled { surface, report, files } => {
            packages::add_report(c, id, *surface, report).await?;
            packages::add_files(c, id, files).await?;
            job::Event::SurfaceAssembled
        }
        TaskResult::Published(files) => {
            packages::add_files(c, id, files).await?;
            job::Event::Published
        }
        TaskResult::Failed(problem) => job::Event::Fail(problem.clone()),
        // A job whose loss was noticed by another task first has recalled this one, which then never comes here.
        TaskResult::Lost(phase, blob) if lost::lose(c, id, *phase, *blob, now).await? => return Ok(()),
        TaskResult::Lost(_, blob) => job::Event::Fail(Problem::new(format!("the blob {blob} is gone"))),
        TaskResult::Imported { .. } | TaskResult::Rejected(_) | TaskResult::Notified => return Ok(()),
    };
    match jobs::happen(c, id, &event, now).await? {
        Some(Err(illegal)) => Err(strange("a task that fits its job", illegal.to_string())),
        Some(Ok(())) | None => Ok(()),
    }
}
