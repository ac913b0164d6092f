//! Uploads and what became of them.

use super::{jobs, tasks, tokens};
use crate::{
    auth::{Scope, TokenId},
    job,
    records::{Problem, SceneRecord, SceneState, UnixMillis},
    store::{
        SceneRow, StoreError, StoredFile, Task, TaskResult,
        rows::{from_json, json, parse, scene_state, scene_state_name},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{ids::SceneHash, options::ImportOptions};
use uuid::Uuid;

pub(in super::super) async fn add(
    c: &mut Tx,
    id: Uuid,
    files: &[StoredFile],
    options: &ImportOptions,
    owner: Option<TokenId>,
    now: UnixMillis,
) -> Result<(), StoreError> {
    let query = sql("INSERT INTO scenes (id, state, created, files, options, owner) VALUES ($1, $2, $3, $4, $5, $6)");
    let query = query.bind(id.to_string()).bind(scene_state_name(SceneState::Uploaded)).bind(now);
    c.run(query.bind(json(&files)?).bind(json(options)?).bind(owner.map(|id| id.to_string()))).await?;
    tasks::enqueue(c, &Task::Import(id)).await
}

fn row(row: &Row) -> Result<SceneRow, StoreError> {
    let record = SceneRecord {
        id: parse("a scene id", &row.text("id")?)?,
        scene: row.maybe_text("hash")?.map(|t| parse("a scene hash", &t)).transpose()?,
        state: scene_state(&row.text("state")?)?,
        created_ms: row.int("created")?,
        options: from_json("import options", &row.text("options")?)?,
        statistics: row.maybe_text("statistics")?.map(|t| from_json("statistics", &t)).transpose()?,
        warnings: from_json("problems", &row.text("warnings")?)?,
        problems: from_json("problems", &row.text("problems")?)?,
    };
    let canonical = row.maybe_text("canonical")?.map(|t| parse("a blob name", &t)).transpose()?;
    Ok(SceneRow { record, files: from_json("files", &row.text("files")?)?, canonical, owner: tokens::owner(row)? })
}

pub(in super::super) async fn get(c: &mut Tx, id: Uuid) -> Result<Option<SceneRow>, StoreError> {
    c.one(sql("SELECT * FROM scenes WHERE id = $1").bind(id.to_string())).await?.as_ref().map(row).transpose()
}

pub(super) async fn lock(c: &mut Tx, id: Uuid) -> Result<Option<SceneRow>, StoreError> {
    c.one(sql("SELECT * FROM scenes WHERE id = $1").locking().bind(id.to_string())).await?.as_ref().map(row).transpose()
}

pub(in super::super) async fn by_hash(c: &mut Tx, scene: SceneHash, scope: Scope) -> Result<Option<SceneRow>, StoreError> {
    let query = sql("SELECT * FROM scenes WHERE hash = $1 AND (CAST($2 AS TEXT) IS NULL OR owner = $2) ORDER BY created, id LIMIT 1");
    c.one(query.bind(scene.to_string()).bind(tokens::owned_by(scope))).await?.as_ref().map(row).transpose()
}

pub(super) async fn mark_importing(c: &mut Tx, id: Uuid) -> Result<(), StoreError> {
    let query = sql("UPDATE scenes SET state = $1 WHERE id = $2").bind(scene_state_name(SceneState::Importing));
    c.run(query.bind(id.to_string())).await?;
    Ok(())
}

/// Ends an import, and moves the jobs that waited for it.
pub(super) async fn finish(c: &mut Tx, id: Uuid, result: &TaskResult, now: UnixMillis) -> Result<(), StoreError> {
    match result {
        TaskResult::Imported { scene, canonical, statistics, warnings } => {
            let query = sql("UPDATE scenes SET state = $1, hash = $2, canonical = $3, statistics = $4, warnings = $5 WHERE id = $6");
            let query = query.bind(scene_state_name(SceneState::Ready)).bind(scene.to_string()).bind(canonical.to_string());
            c.run(query.bind(json(statistics)?).bind(json(warnings)?).bind(id.to_string())).await?;
            wake_jobs(c, id, Some(*scene), &job::Event::SceneReady, now).await
        }
        TaskResult::Rejected(problems) => reject(c, id, problems, now).await,
        TaskResult::Failed(problem) => reject(c, id, std::slice::from_ref(problem), now).await,
        // Any other result belongs to a job's task.
        _ => Ok(()),
    }
}

async fn reject(c: &mut Tx, id: Uuid, problems: &[Problem], now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("UPDATE scenes SET state = $1, problems = $2 WHERE id = $3").bind(scene_state_name(SceneState::Rejected));
    c.run(query.bind(json(&problems)?).bind(id.to_string())).await?;
    wake_jobs(c, id, None, &job::Event::Fail(rejected(problems)), now).await
}

/// Why a job of a rejected scene fails.
pub(super) fn rejected(problems: &[Problem]) -> Problem {
    problems.first().cloned().unwrap_or(Problem::new("the scene was rejected"))
}

async fn wake_jobs(c: &mut Tx, id: Uuid, scene: Option<SceneHash>, event: &job::Event, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("SELECT id FROM jobs WHERE scene = $1 AND public = 'queued' ORDER BY id").locking();
    for row in c.all(query.bind(id.to_string())).await? {
        let job = row.text("id")?;
        c.run(sql("UPDATE jobs SET scene_hash = $1 WHERE id = $2").bind(scene.map(|s| s.to_string())).bind(&job)).await?;
        jobs::happen(c, parse("a job id", &job)?, event, now).await?;
    }
    Ok(())
}
