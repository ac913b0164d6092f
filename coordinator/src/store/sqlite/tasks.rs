//! Coordinator work, leased with tokens. A task that waits has no token; a task that is over has no row.

use super::{
    jobs, lost, packages,
    rows::{from_json, json},
    scenes,
};
use crate::{
    job::{self, JobTask},
    records::{Problem, UnixMillis},
    store::{StoreError, TASK_TRIES, Task, TaskLease, TaskResult},
};
use kiln_proto::ids::{JobId, Token};
use sqlx::SqliteConnection;

pub(super) async fn enqueue(c: &mut SqliteConnection, task: &Task) -> Result<(), StoreError> {
    let job = match task {
        Task::Job(id, _) => Some(id.to_string()),
        Task::Import(_) => None,
    };
    sqlx::query("INSERT INTO tasks (job, task) VALUES (?, ?)").bind(job).bind(json(task)?).execute(c).await?;
    Ok(())
}

pub(super) async fn drop_all(c: &mut SqliteConnection, job: JobId) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM tasks WHERE job = ?").bind(job.to_string()).execute(c).await?;
    Ok(())
}

pub(super) async fn take(
    c: &mut SqliteConnection,
    token: Token,
    deadline: UnixMillis,
    now: UnixMillis,
) -> Result<Option<TaskLease>, StoreError> {
    let query = sqlx::query_as(
        "UPDATE tasks SET token = ?, deadline = ?, tries = tries + 1
         WHERE id = (SELECT id FROM tasks WHERE token IS NULL AND due <= ? ORDER BY id LIMIT 1) RETURNING task, put_off",
    );
    let task: Option<(String, u32)> = query.bind(token.to_string()).bind(deadline).bind(now).fetch_optional(&mut *c).await?;
    let Some((task, put_off)) = task else { return Ok(None) };
    let task: Task = from_json("a task", &task)?;
    if let Task::Import(id) = task {
        scenes::mark_importing(c, id).await?;
    }
    Ok(Some(TaskLease { token, task, put_off }))
}

pub(super) async fn renew(c: &mut SqliteConnection, token: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
    let query = sqlx::query("UPDATE tasks SET deadline = ? WHERE token = ?").bind(deadline).bind(token.to_string());
    Ok(query.execute(c).await?.rows_affected() > 0)
}

pub(super) async fn put_off(c: &mut SqliteConnection, token: Token, why: &str, due: UnixMillis) -> Result<bool, StoreError> {
    let query = sqlx::query(
        "UPDATE tasks SET token = NULL, deadline = NULL, tries = tries - 1, put_off = put_off + 1, due = ?, why = ? WHERE token = ?",
    );
    Ok(query.bind(due).bind(why).bind(token.to_string()).execute(c).await?.rows_affected() > 0)
}

pub(super) async fn take_over(c: &mut SqliteConnection, now: UnixMillis) -> Result<u64, StoreError> {
    let held = sqlx::query("UPDATE tasks SET deadline = ? WHERE token IS NOT NULL").bind(now).execute(&mut *c).await?.rows_affected();
    expire(c, now).await?;
    Ok(held)
}

/// Puts overdue tasks back, and gives those up that were taken too often.
pub(super) async fn expire(c: &mut SqliteConnection, now: UnixMillis) -> Result<u64, StoreError> {
    let query = sqlx::query_as("SELECT id, task, tries FROM tasks WHERE token IS NOT NULL AND deadline <= ?").bind(now);
    let due: Vec<(i64, String, u32)> = query.fetch_all(&mut *c).await?;
    let count = due.len() as u64;
    for (id, task, tries) in due {
        if tries < TASK_TRIES {
            sqlx::query("UPDATE tasks SET token = NULL, deadline = NULL WHERE id = ?").bind(id).execute(&mut *c).await?;
            continue;
        }
        sqlx::query("DELETE FROM tasks WHERE id = ?").bind(id).execute(&mut *c).await?;
        let task: Task = from_json("a task", &task)?;
        let message = format!("{} was begun {tries} times and never ended; the coordinator seems to die of it", name(task));
        settle(c, task, &TaskResult::Failed(Problem { message, file: None, line: None }), now).await?;
    }
    Ok(count)
}

fn name(task: Task) -> &'static str {
    match task {
        Task::Import(_) => "importing the scene",
        Task::Job(_, JobTask::Prepare) => "preparing the job",
        Task::Job(_, JobTask::Merge(_)) => "merging a phase",
        Task::Job(_, JobTask::Assemble(_)) => "assembling a surface",
        Task::Job(_, JobTask::Publish) => "publishing the package",
    }
}

pub(super) async fn finish(c: &mut SqliteConnection, token: Token, result: &TaskResult, now: UnixMillis) -> Result<bool, StoreError> {
    let query = sqlx::query_scalar("DELETE FROM tasks WHERE token = ? RETURNING task").bind(token.to_string());
    let task: Option<String> = query.fetch_optional(&mut *c).await?;
    let Some(task) = task else { return Ok(false) };
    settle(c, from_json("a task", &task)?, result, now).await?;
    Ok(true)
}

/// Performs the effects of a task that ended.
async fn settle(c: &mut SqliteConnection, task: Task, result: &TaskResult, now: UnixMillis) -> Result<(), StoreError> {
    let id = match task {
        Task::Import(scene) => return scenes::finish(c, scene, result, now).await,
        Task::Job(id, _) => id,
    };
    let event = match result {
        TaskResult::Prepared { plan, tiles, cost, surfaces, texels, warnings } => {
            jobs::set_plan(c, id, plan, *cost).await?;
            let query = sqlx::query("UPDATE jobs SET texels = ? WHERE id = ?").bind(super::rows::int(*texels));
            query.bind(id.to_string()).execute(&mut *c).await?;
            for problem in warnings {
                jobs::add_problem(c, id, problem, now).await?;
            }
            job::Event::Prepared { tiles: *tiles, surfaces: *surfaces }
        }
        TaskResult::Merged { phase, plan, tiles, cost } => {
            jobs::set_plan(c, id, plan, *cost).await?;
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
        TaskResult::Lost(_, blob) => job::Event::Fail(Problem { message: format!("the blob {blob} is gone"), file: None, line: None }),
        TaskResult::Imported { .. } | TaskResult::Rejected(_) => return Ok(()),
    };
    match jobs::happen(c, id, &event, now).await? {
        Some(Err(illegal)) => Err(super::rows::strange("a task that fits its job", illegal.to_string())),
        Some(Ok(())) | None => Ok(()),
    }
}
