//! Jobs: create, estimate, look, cancel, delete, follow.

use super::{Engine, EngineError, Estimate, EventPage, JobFilter, JobPage, core::blocking, progress, space};
use crate::{
    auth::Principal,
    job::Event,
    records::{JobChange, JobRecord, NewJob, Problem, SceneState},
    store::{JobSpec, SceneRow},
};
use kiln_proto::{
    BAKE_VERSION,
    ids::{JobId, Token},
    limits,
    plan::Plan,
    settings::BakeSettings,
    wire::message::Phase,
};
use std::sync::Arc;

/// Labels of one job.
const LABELS: usize = 64;

fn not_found(job: JobId) -> EngineError {
    EngineError::NotFound { what: "job", id: job.to_string() }
}

/// Jobs in one answer, at most.
const PAGE: u32 = 1_000;

/// Whether a share of tiles that two workers bake is one.
///
/// # Errors
/// [`EngineError::Invalid`] outside [0, 1].
pub(crate) fn check_share(verify: Option<f64>) -> Result<(), EngineError> {
    if verify.is_none_or(|share| (0.0..=1.0).contains(&share)) {
        return Ok(());
    }
    Err(EngineError::invalid("verify: the share of tiles that two workers bake lies between 0 and 1"))
}

impl Engine {
    /// Creates a job for `by`, of a scene that `by` sees. The scene may still be importing.
    ///
    /// # Errors
    /// Settings out of range, an unknown or rejected scene, texture sizes for surfaces that a ready scene does not have.
    pub async fn create_job(&self, new: NewJob, by: &Principal) -> Result<JobRecord, EngineError> {
        self.create_job_as(JobId::random(), new, by).await
    }

    /// As [`Engine::create_job`], under an id. Where there is such a job already, an earlier try went this far: that job is the answer.
    ///
    /// # Errors
    /// As [`Engine::create_job`].
    pub async fn create_job_as(&self, id: JobId, new: NewJob, by: &Principal) -> Result<JobRecord, EngineError> {
        if let Some(row) = self.core.store.job(id).await? {
            return Ok(progress::one(&self.core, row).await?);
        }
        let (scene, settings) = self.validate(&new, by).await?;
        let spec = JobSpec {
            id,
            scene: scene.record.id,
            settings,
            priority: new.priority,
            labels: new.labels,
            bake_version: BAKE_VERSION,
            on_poison: new.on_poison,
            owner: by.owner(),
            verify: new.verify.unwrap_or(self.core.config.verify),
            secret: Token::random().to_string(),
            webhook: new.webhook,
        };
        let row = self.core.store.add_job(&spec, self.now()).await?;
        self.core.signals.tasks.notify_waiters();
        Ok(progress::one(&self.core, row).await?)
    }

    async fn validate(&self, new: &NewJob, by: &Principal) -> Result<(SceneRow, BakeSettings), EngineError> {
        let settings = new.settings.resolve().map_err(|e| EngineError::invalid(e.to_string()))?;
        check_share(new.verify)?;
        new.webhook.as_deref().map_or(Ok(()), |address| self.check_webhook(address))?;
        let long = |text: &String| text.len() > limits::NAME_BYTES;
        if new.labels.len() > LABELS || new.labels.iter().any(|(k, v)| long(k) || long(v)) {
            return Err(EngineError::invalid(format!("labels: at most {LABELS}, each name and value up to {} bytes", limits::NAME_BYTES)));
        }
        let scene = self.find_scene(&new.scene, by.sees()).await?;
        if scene.record.state == SceneState::Rejected {
            let rejected = Problem::new(format!("the scene {} was rejected", new.scene));
            return Err(EngineError::Invalid([vec![rejected], scene.record.problems].concat()));
        }
        if let Some(statistics) = &scene.record.statistics {
            let strange = settings.texture_sizes.keys().filter(|name| !statistics.surfaces.contains(name));
            let problems: Vec<Problem> = strange
                .map(|name| Problem {
                    message: format!("texture_sizes: the scene has no surface `{name}`; it has {}", statistics.surfaces.join(", ")),
                    file: None,
                    line: None,
                })
                .collect();
            if !problems.is_empty() {
                return Err(EngineError::Invalid(problems));
            }
        }
        Ok((scene, settings))
    }

    /// Whether jobs may ask to tell this address of their end.
    ///
    /// # Errors
    /// [`EngineError::Webhook`], which says why not.
    pub fn check_webhook(&self, address: &str) -> Result<(), EngineError> {
        self.core.webhooks.check(address)?;
        Ok(())
    }

    /// What a job would cost, without creating it. The scene must be ready.
    ///
    /// # Errors
    /// As [`Engine::create_job`], and a scene that is still importing.
    pub async fn estimate(&self, new: &NewJob, by: &Principal) -> Result<Estimate, EngineError> {
        let (row, settings) = self.validate(new, by).await?;
        let hash = row.record.scene.ok_or_else(|| EngineError::Conflict {
            what: format!("the scene {}", row.record.id),
            state: "still being imported".into(),
            needed: "try again when it is ready".into(),
        })?;
        let scene = self.core.scene(hash).await?;
        let names: Vec<String> = scene.surfaces.iter().map(|s| s.name.clone()).collect();
        let pipeline = Arc::clone(&self.core.pipeline);
        let planned = blocking({
            let settings = settings.clone();
            move || pipeline.plan(&scene, hash, &settings)
        });
        let (plan, warnings) = planned.await?.map_err(|problem| EngineError::Invalid(vec![problem]))?;
        Ok(Estimate {
            texels: plan.covered(),
            tiles: plan.tile_count(Phase::Bake),
            surfaces: names.into_iter().zip(plan.surfaces.iter().map(|s| s.size.to_string())).collect(),
            raw_bytes: plan.surfaces.iter().map(|s| s.size.texels()).sum::<u64>() * u64::from(settings.directions.len()) * 3,
            disk_bytes: space::expected(&plan, &settings),
            seconds: self.seconds(&plan, &settings).await?,
            warnings,
        })
    }

    /// Seconds to expect with the workers connected now: an order of magnitude, good enough to tell minutes from days.
    async fn seconds(&self, plan: &Plan, settings: &BakeSettings) -> Result<Option<f64>, EngineError> {
        // Measured on the thesis's room at depth 5: 460 million incident paths, gather and encoding included, in 350 core-seconds.
        const PATHS_PER_SECOND: f64 = 1_300_000.0;
        let since = self.now() - self.core.silence();
        let threads: u64 = self.core.store.workers(since).await?.iter().map(|w| u64::from(w.threads)).sum();
        let paths = plan.covered() as f64 * f64::from(settings.samples);
        Ok((threads > 0).then(|| paths / (PATHS_PER_SECOND * threads as f64)))
    }

    /// A job.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn job(&self, job: JobId) -> Result<JobRecord, EngineError> {
        let row = self.core.store.job(job).await?.ok_or_else(|| not_found(job))?;
        Ok(progress::one(&self.core, row).await?)
    }

    /// Some jobs, youngest first.
    ///
    /// # Errors
    /// A failing store.
    pub async fn jobs(&self, filter: &JobFilter) -> Result<JobPage, EngineError> {
        let limit = if filter.limit == 0 { 100 } else { filter.limit.min(PAGE) };
        // One more than asked for tells whether there is a next page.
        let mut rows = self.core.store.jobs(&JobFilter { limit: limit + 1, ..filter.clone() }).await?;
        let more = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let next = rows.last().filter(|_| more).map(|row| row.spec.id);
        Ok(JobPage { jobs: progress::records(&self.core, rows).await?, next })
    }

    /// Cancels a job that has not ended; a job that has is left as it is.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn cancel_job(&self, job: JobId) -> Result<JobRecord, EngineError> {
        // That it has ended already is no error: the caller wants it to be over, and it is.
        let _ = self.core.store.job_event(job, &Event::Cancel, self.now()).await?.ok_or_else(|| not_found(job))?;
        self.core.meter().forget(job);
        self.core.signals.job_changed(job);
        self.job(job).await
    }

    /// Pauses or resumes a job, or gives it another priority.
    ///
    /// # Errors
    /// [`EngineError::NotFound`]; [`EngineError::Conflict`] where a job that does not bake is to be paused.
    pub async fn change_job(&self, job: JobId, change: &JobChange) -> Result<JobRecord, EngineError> {
        if let Some(paused) = change.paused {
            let (event, needed) =
                if paused { (Event::Pause, "only a job that bakes can be paused") } else { (Event::Resume, "only a paused job can go on") };
            self.happen(job, &event, needed).await?;
        }
        if let Some(priority) = change.priority {
            if !self.core.store.set_priority(job, priority).await? {
                return Err(not_found(job));
            }
            self.core.signals.job_changed(job);
        }
        self.job(job).await
    }

    /// Tries the tiles of a failed job again that were given up.
    ///
    /// # Errors
    /// [`EngineError::NotFound`]; [`EngineError::Conflict`] where the job did not fail for such tiles.
    pub async fn retry_job(&self, job: JobId) -> Result<JobRecord, EngineError> {
        self.happen(job, &Event::Retry, "only a job that failed because tiles were given up can be tried again; submit it anew").await?;
        self.job(job).await
    }

    async fn happen(&self, job: JobId, event: &Event, needed: &str) -> Result<(), EngineError> {
        let happened = self.core.store.job_event(job, event, self.now()).await?.ok_or_else(|| not_found(job))?;
        happened.map_err(|illegal| EngineError::Conflict {
            what: "this job".into(),
            state: illegal.state.to_owned(),
            needed: needed.to_owned(),
        })?;
        self.core.signals.job_changed(job);
        Ok(())
    }

    /// Cancels a job and removes every trace of it, its package included. Blobs follow when they are collected.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn delete_job(&self, job: JobId) -> Result<(), EngineError> {
        if !self.core.store.delete_job(job).await? {
            return Err(not_found(job));
        }
        self.core.meter().forget(job);
        self.core.signals.job_changed(job);
        Ok(())
    }

    /// At most `limit` events of a job with a sequence number above `after`.
    ///
    /// # Errors
    /// [`EngineError::NotFound`].
    pub async fn events(&self, job: JobId, after: i64, limit: u32) -> Result<EventPage, EngineError> {
        self.core.store.events(job, after, limit).await?.ok_or_else(|| not_found(job))
    }

    /// Resolves when the job has events above `after`, when it is deleted, or on shut-down; then ask again. May resolve without cause.
    pub async fn wait_for_events(&self, job: JobId, after: i64) {
        let mut changes = self.core.signals.watch(job);
        match self.core.store.events(job, after, 1).await {
            Ok(Some(page)) if page.events.is_empty() && !page.dropped && !self.core.signals.is_stopping() => {
                // The sender is gone when the engine stops: that is a reason to wake up too.
                let _ = changes.changed().await;
            }
            _ => {}
        }
    }
}
