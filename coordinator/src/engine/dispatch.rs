//! Workers that wait for work, and the one task that hands it out.
//!
//! All workers that wait are served together: one look at what is pending, one transaction for all their leases. Were each to claim for
//! itself, sixty-four of them would meet on the same row, and most would be sent away while there is plenty. What another coordinator took
//! meanwhile is looked for again, until everybody is served or nothing is pending: nobody is sent away while work waits.

use super::{
    EngineError,
    core::Core,
    leases::{busy, size},
};
use crate::{
    lease,
    records::WorkerRecord,
    store::{Candidate, Grant},
};
use kiln_proto::{
    ids::Token,
    tile::TileRun,
    wire::message::{LeaseGrant, Refusal},
};
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, PoisonError, atomic::Ordering},
    time::Duration,
};
use tokio::{
    sync::{Notify, oneshot},
    time::Instant,
};

/// Workers served in one transaction, at most.
const MOST: usize = 64;

/// Looks in a row that lead to no lease before the workers wait: what is pending was taken by others each time, or is what these workers have
/// failed and another must try.
const ROUNDS: u32 = 3;

/// How a wait ends: with a lease, or with word to come back.
type Answer = Result<LeaseGrant, Refusal>;

struct Waiting {
    worker: WorkerRecord,
    answer: oneshot::Sender<Answer>,
    /// Told once that there was nothing: nobody's patience ends before somebody has looked.
    looked: Option<oneshot::Sender<()>>,
}

/// A place in the queue. Dropping it leaves the queue.
pub(super) struct Place {
    answer: oneshot::Receiver<Answer>,
    looked: oneshot::Receiver<()>,
}

impl Place {
    /// Waits for a lease until a moment, but not less than one look at what is pending.
    pub(super) async fn wait(mut self, until: Instant) -> Option<Answer> {
        let looked = &mut self.looked;
        tokio::select! {
            biased;
            answer = &mut self.answer => return answer.ok(),
            () = async { drop(looked.await); tokio::time::sleep_until(until).await } => {}
        }
        // What was granted in this very moment is not lost.
        self.answer.close();
        self.answer.try_recv().ok()
    }
}

/// The queue.
#[derive(Default)]
pub(super) struct Dispatch {
    queue: Mutex<VecDeque<Waiting>>,
    arrived: Notify,
}

impl Dispatch {
    /// Puts a worker at the end of the queue.
    pub(super) fn queue_up(&self, worker: WorkerRecord) -> Place {
        let ((answer, answered), (look, looked)) = (oneshot::channel(), oneshot::channel());
        self.queue().push_back(Waiting { worker, answer, looked: Some(look) });
        self.arrived.notify_one();
        Place { answer: answered, looked }
    }

    fn queue(&self) -> std::sync::MutexGuard<'_, VecDeque<Waiting>> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Those who have waited longest, all of one bake version, which is none of `dry`.
    fn take(&self, dry: &[u32]) -> Vec<Waiting> {
        let mut queue = self.queue();
        queue.retain(|waiting| !waiting.answer.is_closed());
        let mut versions = queue.iter().map(|waiting| waiting.worker.bake_version);
        let Some(version) = versions.find(|version| !dry.contains(version)) else { return Vec::new() };
        let (mut taken, mut left) = (Vec::new(), VecDeque::with_capacity(queue.len()));
        for waiting in queue.drain(..) {
            if taken.len() < MOST && waiting.worker.bake_version == version { taken.push(waiting) } else { left.push_back(waiting) }
        }
        *queue = left;
        taken
    }

    /// Puts workers back at the front, in order: there was nothing for them.
    fn put_back(&self, waiting: Vec<Waiting>) {
        let mut queue = self.queue();
        for mut one in waiting.into_iter().rev() {
            if let Some(looked) = one.looked.take() {
                let _ = looked.send(());
            }
            queue.push_front(one);
        }
    }
}

/// Hands out work until the engine stops.
pub(super) async fn run(core: Arc<Core>) {
    while !core.signals.is_stopping() {
        let (work, stop) = (core.signals.work.notified(), core.signals.stop.notified());
        tokio::pin!(work, stop);
        work.as_mut().enable();
        stop.as_mut().enable();
        serve_all(&core).await;
        tokio::select! {
            () = work => {}
            () = core.dispatch.arrived.notified() => {}
            () = stop => {}
        }
    }
}

/// Serves whoever waits, as far as there is work for them.
async fn serve_all(core: &Arc<Core>) {
    // Bake versions for which nothing is pending: their workers must not stop those behind them.
    let mut dry = Vec::new();
    loop {
        let waiting = core.dispatch.take(&dry);
        let Some(version) = waiting.first().map(|first| first.worker.bake_version) else { return };
        match serve(core, waiting).await {
            Ok(left) if left.is_empty() => {}
            Ok(left) => {
                dry.push(version);
                core.dispatch.put_back(left);
            }
            Err((waiting, error)) => {
                let refusal = busy(error);
                for one in waiting {
                    let _ = one.answer.send(Err(refusal.clone()));
                }
            }
        }
    }
}

/// Serves workers of one bake version; those for whom there is nothing come back.
async fn serve(core: &Arc<Core>, mut waiting: Vec<Waiting>) -> Result<Vec<Waiting>, (Vec<Waiting>, EngineError)> {
    let mut in_vain = 0;
    while let Some(first) = waiting.first().filter(|_| in_vain < ROUNDS) {
        let version = first.worker.bake_version;
        let candidates = match core.store.next_work(version, waiting.len()).await {
            Ok(candidates) => candidates,
            Err(error) => return Err((waiting, error.into())),
        };
        if candidates.is_empty() {
            break;
        }
        let grants = match portion(core, &waiting, candidates).await {
            Ok(grants) => grants,
            Err(error) => return Err((waiting, error)),
        };
        let asked: Vec<Grant> = grants.iter().map(|(grant, _)| *grant).collect();
        let granted = match core.store.grant(&asked, core.now()).await {
            Ok(granted) => granted,
            Err(error) => return Err((waiting, error.into())),
        };
        in_vain = if granted.iter().any(Option::is_some) { 0 } else { in_vain + 1 };
        let rest = waiting.split_off(grants.len().min(waiting.len()));
        let mut left = Vec::new();
        for ((one, (grant, candidate)), run) in waiting.into_iter().zip(grants).zip(granted) {
            match run {
                Some(tiles) => answer(core, one, &grant, &candidate, tiles).await,
                // Other coordinators took the whole shard meanwhile, or it must not have what is left.
                None => left.push(one),
            }
        }
        left.extend(rest);
        waiting = left;
    }
    Ok(waiting)
}

/// Shares the candidates out, as far as they reach: a lease for each of the first workers.
async fn portion(core: &Core, waiting: &[Waiting], candidates: Vec<Candidate>) -> Result<Vec<(Grant, Candidate)>, EngineError> {
    let (now, lease) = (core.now(), &core.config.lease);
    let mut candidates = VecDeque::from(candidates);
    let mut pending = candidates.front().map_or(0, |first| first.pending);
    let mut grants = Vec::with_capacity(waiting.len());
    for one in waiting {
        let Some(candidate) = candidates.front_mut() else { break };
        candidate.pending = pending;
        let run = size(core, &one.worker, candidate).await?;
        pending = pending.saturating_sub(run.len());
        let grant = Grant {
            token: Token::random(),
            worker: one.worker.id,
            job: candidate.job,
            phase: candidate.phase,
            run,
            deadline: now.saturating_add(lease.ttl_ms as i64),
            cap: now.saturating_add(lease.hard_cap_ms as i64),
        };
        grants.push((grant, *candidate));
        let TileRun { start, end } = candidate.run;
        candidate.run = if run.start == start { TileRun { start: run.end, end } } else { TileRun { start, end: run.start } };
        if candidate.run.is_empty() {
            candidates.pop_front();
        }
    }
    Ok(grants)
}

/// Sends a worker its lease. One that has gone meanwhile gives it back at once.
async fn answer(core: &Core, waiting: Waiting, grant: &Grant, candidate: &Candidate, tiles: TileRun) {
    let lease = LeaseGrant {
        token: grant.token,
        job: grant.job,
        phase: grant.phase,
        tiles,
        scene: candidate.scene,
        plan: candidate.plan.digest,
        ttl_ms: core.config.lease.ttl_ms,
    };
    core.counters.leases_granted.fetch_add(1, Ordering::Relaxed);
    if waiting.answer.send(Ok(lease)).is_ok() {
        return;
    }
    if let Err(error) = core.store.finish_attempt(grant.token, lease::Event::Release, None, core.now()).await {
        tracing::warn!(%error, "a lease that nobody took could not be given back; it expires");
    }
}

/// Looks by themselves, for what hints have missed.
pub(super) async fn look_around(core: Arc<Core>) {
    // Spread, so that several coordinators do not ask all at once.
    let every = Duration::from_millis(800 + u64::from(uuid::Uuid::new_v4().as_bytes()[0]) * 400 / 255);
    while !core.signals.is_stopping() {
        tokio::time::sleep(every).await;
        core.signals.everything();
    }
}
