//! What every store must do, whatever it is made of. An implementation's test calls [`all`] with a way to make empty stores.

mod concurrent;
mod failures;
mod jobs;
mod leases;
mod notices;
mod opinions;
mod requests;
mod retention;
mod schedule;
mod tokens;

use super::{Candidate, ChunkTile, ClaimRow, Grant, JobSpec, NewChunk, PlanRef, SceneRow, Store, StoredFile, Task, TaskResult};
use crate::{
    blob::BlobName,
    job::JobTask,
    lease::Kind,
    records::{LightCounts, SceneState, SceneStatistics, UnixMillis},
};
pub(crate) use concurrent::concurrent;
use kiln_proto::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    settings::SettingsPatch,
    tile::{TileIndex, TileRun},
    wire::message::Phase,
};
use std::{future::Future, sync::Arc};
use uuid::Uuid;

/// Runs the suite.
pub(crate) async fn all<F: Future<Output = Arc<dyn Store>>>(fresh: impl Fn() -> F) {
    jobs::a_job_runs_through_its_tasks(&*fresh().await).await;
    jobs::jobs_wait_for_their_scene_and_fail_with_it(&*fresh().await).await;
    jobs::a_task_belongs_to_its_token(&*fresh().await).await;
    jobs::a_task_that_never_ends_fails_its_job(&*fresh().await).await;
    jobs::events_are_kept_up_to_a_bound(&*fresh().await).await;
    jobs::blobs_are_named_as_long_as_rows_name_them(&*fresh().await).await;
    leases::a_run_is_granted_once(&*fresh().await).await;
    leases::priority_then_age_decides(&*fresh().await).await;
    leases::expiry_returns_what_is_owed_and_takes_late_chunks(&*fresh().await).await;
    leases::a_repeated_chunk_changes_nothing(&*fresh().await).await;
    leases::conflicts_blame_whoever_brought_the_tile(&*fresh().await).await;
    leases::the_end_of_a_job_ends_its_leases(&*fresh().await).await;
    failures::a_failing_tile_is_found_by_halves_and_can_be_tried_again(&*fresh().await).await;
    failures::a_job_that_skips_goes_on_and_lists_its_holes(&*fresh().await).await;
    failures::a_paused_job_leases_nothing_and_counts_what_comes(&*fresh().await).await;
    failures::what_an_expired_attempt_delivers_is_no_debt_of_the_next(&*fresh().await).await;
    failures::a_worker_that_fails_what_others_manage_is_barred(&*fresh().await).await;
    opinions::a_tile_counts_when_another_worker_agrees(&*fresh().await).await;
    opinions::whoever_lied_is_barred_and_baked_again(&*fresh().await).await;
    opinions::a_lie_about_others_is_found_too(&*fresh().await).await;
    opinions::checks_that_nobody_can_make_are_waived(&*fresh().await).await;
    opinions::a_late_attempt_gets_a_twin_and_the_first_wins(&*fresh().await).await;
    opinions::what_a_lost_twin_owed_is_still_held(&*fresh().await).await;
    tokens::tokens_are_kept_rotated_and_revoked_once(&*fresh().await).await;
    tokens::the_secret_of_the_service_is_made_once(&*fresh().await).await;
    tokens::scenes_and_jobs_have_owners(&*fresh().await).await;
    notices::every_end_of_a_job_with_a_webhook_is_told(&*fresh().await).await;
    notices::a_notice_that_is_given_up_changes_nothing_but_the_stream(&*fresh().await).await;
    requests::a_key_has_one_request_and_one_answer(&*fresh().await).await;
    requests::a_claim_that_ends_without_an_answer_is_free_again(&*fresh().await).await;
    requests::answers_are_forgotten_after_a_day(&*fresh().await).await;
    requests::a_claim_is_given_once(&*fresh().await).await;
    retention::what_is_long_over_is_forgotten(&*fresh().await).await;
    retention::what_is_under_way_or_tried_again_is_kept(&*fresh().await).await;
    schedule::random_schedules_agree_with_the_oracle(&*fresh().await).await;
    let store = fresh().await;
    concurrent(Arc::clone(&store), store).await;
}

const NOW: UnixMillis = 1_000;

fn blob(text: &str) -> BlobName {
    BlobName::of(text.as_bytes())
}

fn plan(text: &str) -> PlanRef {
    PlanRef { digest: Digest::of(text.as_bytes()), blob: blob(text) }
}

async fn scene(store: &dyn Store) -> SceneRow {
    let file = StoredFile { name: "a.obj".into(), blob: blob("obj") };
    store.add_scene(Uuid::now_v7(), &[file], &kiln_proto::options::ImportOptions::default(), None, NOW).await.unwrap()
}

fn statistics() -> SceneStatistics {
    SceneStatistics {
        triangles: 1,
        surfaces: vec!["s".into()],
        materials: 1,
        textures: 0,
        emissive_triangles: 0,
        low: [0.0; 3],
        high: [1.0; 3],
        lights: LightCounts { spot: 2, ..LightCounts::default() },
        environment: Some([2, 1]),
        ..SceneStatistics::default()
    }
}

/// Takes the next task, which must be this one, and ends it.
async fn perform(store: &dyn Store, expected: Task, result: &TaskResult) {
    let token = Token::random();
    let lease = store.take_task(token, NOW + 1_000_000, NOW).await.unwrap().expect("a task");
    assert_eq!(lease.task, expected);
    assert!(store.finish_task(token, result, NOW).await.unwrap());
}

pub(crate) async fn ready_scene(store: &dyn Store) -> Uuid {
    let id = scene(store).await.record.id;
    let result =
        TaskResult::Imported { scene: SceneHash::of(b"s"), canonical: blob("canonical"), statistics: statistics(), warnings: vec![] };
    perform(store, Task::Import(id), &result).await;
    assert_eq!(store.scene(id).await.unwrap().unwrap().record.state, SceneState::Ready);
    id
}

fn spec(scene: Uuid, priority: i32) -> JobSpec {
    let settings = SettingsPatch::default().resolve().unwrap();
    let labels = [("a".to_owned(), "b".to_owned())].into();
    let on_poison = crate::job::OnPoison::Fail;
    let (verify, secret) = (0.0, "secret".to_owned());
    let (owner, webhook) = (None, None);
    JobSpec { id: JobId::random(), scene, settings, priority, labels, bake_version: 1, on_poison, owner, verify, secret, webhook }
}

/// A job whose Probe phase of `tiles` tiles is open.
pub(crate) async fn probing(store: &dyn Store, scene: Uuid, tiles: u64, priority: i32) -> JobId {
    open(store, spec(scene, priority), tiles).await
}

async fn open(store: &dyn Store, spec: JobSpec, tiles: u64) -> JobId {
    let job = store.add_job(&spec, NOW).await.unwrap().spec.id;
    let prepared = TaskResult::Prepared { plan: plan("one"), tiles, cost: tiles * 10, surfaces: 1, texels: 7, warnings: vec![] };
    perform(store, Task::Job(job, JobTask::Prepare), &prepared).await;
    job
}

fn grant(job: JobId, start: u64, end: u64, at: UnixMillis) -> Grant {
    Grant {
        token: Token::random(),
        worker: WorkerId::random(),
        job,
        phase: Phase::Probe,
        kind: Kind::Work,
        run: TileRun { start, end },
        cost: (end - start) * 10,
        deadline: at + 100,
        cap: at + 10_000,
    }
}

/// What goes next where the most urgent and oldest job always does.
async fn next(store: &dyn Store) -> Option<Candidate> {
    let waits = |c: &ClaimRow| c.waiting + c.unasked > 0;
    let claims: Vec<ClaimRow> = store.claims(1).await.unwrap().into_iter().filter(waits).collect();
    let job = claims.iter().min_by_key(|c| (std::cmp::Reverse(c.priority), c.job))?.job;
    store.next_work(job, 1).await.unwrap().into_iter().next()
}

/// Whether a lease was recorded just as it was asked for.
async fn granted(store: &dyn Store, grant: &Grant, now: UnixMillis) -> bool {
    store.grant(&[*grant], now).await.unwrap() == [Some(grant.run)]
}

/// A chunk of these tiles; `salt` changes every digest.
fn chunk(token: Token, n: u64, tiles: &[u64], salt: &str) -> NewChunk {
    let tile = |t: &u64| ChunkTile { tile: TileIndex(*t), digest: Digest::of(format!("{salt}{t}").as_bytes()), cost: 10 };
    let tiles: Vec<ChunkTile> = tiles.iter().map(tile).collect();
    NewChunk { token, n, blob: blob(&format!("{token}{n}")), trailer_at: 5, length: 9, tiles }
}
