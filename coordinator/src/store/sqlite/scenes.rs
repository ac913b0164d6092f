//! Uploads and what became of them.

use super::{
    jobs,
    rows::{from_json, json, parse, scene_state, scene_state_name},
    tasks,
};
use crate::{
    job,
    records::{Problem, SceneRecord, SceneState, UnixMillis},
    store::{SceneRow, StoreError, StoredFile, Task, TaskResult},
};
use kiln_proto::{ids::SceneHash, options::ImportOptions};
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};
use uuid::Uuid;

pub(super) async fn add(
    c: &mut SqliteConnection,
    id: Uuid,
    files: &[StoredFile],
    options: &ImportOptions,
    now: UnixMillis,
) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO scenes (id, state, created, files, options) VALUES (?, ?, ?, ?, ?)")
        .bind(id.to_string())
        .bind(scene_state_name(SceneState::Uploaded))
        .bind(now)
        .bind(json(&files)?)
        .bind(json(options)?)
        .execute(&mut *c)
        .await?;
    tasks::enqueue(c, &Task::Import(id)).await
}

fn row(row: &SqliteRow) -> Result<SceneRow, StoreError> {
    let text = |column: &str| row.try_get::<String, _>(column);
    let maybe = |column: &str| row.try_get::<Option<String>, _>(column);
    let record = SceneRecord {
        id: parse("a scene id", &text("id")?)?,
        scene: maybe("hash")?.map(|t| parse("a scene hash", &t)).transpose()?,
        state: scene_state(&text("state")?)?,
        created_ms: row.try_get("created")?,
        options: from_json("import options", &text("options")?)?,
        statistics: maybe("statistics")?.map(|t| from_json("statistics", &t)).transpose()?,
        warnings: from_json("problems", &text("warnings")?)?,
        problems: from_json("problems", &text("problems")?)?,
    };
    let canonical = maybe("canonical")?.map(|t| parse("a blob name", &t)).transpose()?;
    Ok(SceneRow { record, files: from_json("files", &text("files")?)?, canonical })
}

pub(super) async fn get(c: &mut SqliteConnection, id: Uuid) -> Result<Option<SceneRow>, StoreError> {
    let found = sqlx::query("SELECT * FROM scenes WHERE id = ?").bind(id.to_string()).fetch_optional(c).await?;
    found.as_ref().map(row).transpose()
}

pub(super) async fn by_hash(c: &mut SqliteConnection, scene: SceneHash) -> Result<Option<SceneRow>, StoreError> {
    let query = sqlx::query("SELECT * FROM scenes WHERE hash = ? ORDER BY created, id LIMIT 1");
    query.bind(scene.to_string()).fetch_optional(c).await?.as_ref().map(row).transpose()
}

pub(super) async fn mark_importing(c: &mut SqliteConnection, id: Uuid) -> Result<(), StoreError> {
    let query = sqlx::query("UPDATE scenes SET state = ? WHERE id = ?").bind(scene_state_name(SceneState::Importing));
    query.bind(id.to_string()).execute(c).await?;
    Ok(())
}

/// Ends an import, and moves the jobs that waited for it.
pub(super) async fn finish(c: &mut SqliteConnection, id: Uuid, result: &TaskResult, now: UnixMillis) -> Result<(), StoreError> {
    match result {
        TaskResult::Imported { scene, canonical, statistics, warnings } => {
            sqlx::query("UPDATE scenes SET state = ?, hash = ?, canonical = ?, statistics = ?, warnings = ? WHERE id = ?")
                .bind(scene_state_name(SceneState::Ready))
                .bind(scene.to_string())
                .bind(canonical.to_string())
                .bind(json(statistics)?)
                .bind(json(warnings)?)
                .bind(id.to_string())
                .execute(&mut *c)
                .await?;
            wake_jobs(c, id, Some(*scene), &job::Event::SceneReady, now).await
        }
        TaskResult::Rejected(problems) => reject(c, id, problems, now).await,
        TaskResult::Failed(problem) => reject(c, id, std::slice::from_ref(problem), now).await,
        // Any other result belongs to a job's task.
        _ => Ok(()),
    }
}

async fn reject(c: &mut SqliteConnection, id: Uuid, problems: &[Problem], now: UnixMillis) -> Result<(), StoreError> {
    sqlx::query("UPDATE scenes SET state = ?, problems = ? WHERE id = ?")
        .bind(scene_state_name(SceneState::Rejected))
        .bind(json(&problems)?)
        .bind(id.to_string())
        .execute(&mut *c)
        .await?;
    wake_jobs(c, id, None, &job::Event::Fail(rejected(problems)), now).await
}

/// Why a job of a rejected scene fails.
pub(super) fn rejected(problems: &[Problem]) -> Problem {
    problems.first().cloned().unwrap_or(Problem { message: "the scene was rejected".into(), file: None, line: None })
}

async fn wake_jobs(
    c: &mut SqliteConnection,
    id: Uuid,
    scene: Option<SceneHash>,
    event: &job::Event,
    now: UnixMillis,
) -> Result<(), StoreError> {
    let query = sqlx::query_scalar("SELECT id FROM jobs WHERE scene = ? AND public = 'queued'").bind(id.to_string());
    let waiting: Vec<String> = query.fetch_all(&mut *c).await?;
    for job in waiting {
        sqlx::query("UPDATE jobs SET scene_hash = ? WHERE id = ?").bind(scene.map(|s| s.to_string())).bind(&job).execute(&mut *c).await?;
        jobs::happen(c, parse("a job id", &job)?, event, now).await?;
    }
    Ok(())
}
