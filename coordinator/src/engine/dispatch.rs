//! Workers that wait for work, and the one task that hands it out.
//!
//! All workers that wait are served together: one look at what is pending, one transaction for all their leases. Were each to claim for
//! itself, sixty-four of them would meet on the same row, and most would be sent away while there is plenty. What another coordinator took
//! meanwhile is looked for again, until everybody is served or nothing is pending: nobody is sent away while work waits. Whose tiles go next
//! is the ledger's to say; whoever is left idle may bake along with a late attempt.

use super::{
    EngineError,
    core::Core,
    leases::busy,
    offers::{self, Offer},
};
use crate::{
    lease::{self, Ledger},
    records::WorkerRecord,
    store::Grant,
};
use kiln_proto::{
    ids::JobId,
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

/// Offers of one job in vain before a worker waits for the next look: what was offered was taken by others each time, or is what this worker has
/// failed and another must try.
pub(super) const TRIES: usize = 3;

/// How often late attempts are looked for while workers are idle.
const TWINS_EVERY: Duration = Duration::from_millis(500);

/// How a wait ends: with a lease, or with word to come back.
type Answer = Result<LeaseGrant, Refusal>;

pub(super) struct Waiting {
    pub(super) worker: WorkerRecord,
    answer: oneshot::Sender<Answer>,
    /// Told once that there was nothing: nobody's patience ends before somebody has looked.
    looked: Option<oneshot::Sender<()>>,
    /// Jobs whose work it was offered in this look and did not get: others come first for it.
    pub(super) in_vain: Vec<JobId>,
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
    /// Who has had how much.
    ledger: Mutex<Ledger>,
    /// When late attempts were last looked for.
    looked: Mutex<Option<Instant>>,
}

impl Dispatch {
    /// Puts a worker at the end of the queue.
    pub(super) fn queue_up(&self, worker: WorkerRecord) -> Place {
        let ((answer, answered), (look, looked)) = (oneshot::channel(), oneshot::channel());
        self.queue().push_back(Waiting { worker, answer, looked: Some(look), in_vain: Vec::new() });
        self.arrived.notify_one();
        Place { answer: answered, looked }
    }

    pub(super) fn ledger(&self) -> std::sync::MutexGuard<'_, Ledger> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it is time to look for late attempts again; if so it is not, for a while.
    fn may_look_for_twins(&self) -> bool {
        let mut looked = self.looked.lock().unwrap_or_else(PoisonError::into_inner);
        let due = looked.is_none_or(|at| at.elapsed() >= TWINS_EVERY);
        if due {
            *looked = Some(Instant::now());
        }
        due
    }

    fn is_empty(&self) -> bool {
        self.queue().is_empty()
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
            one.in_vain.clear();
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
            // Attempts become late by themselves.
            () = tokio::time::sleep(TWINS_EVERY), if !core.dispatch.is_empty() => {}
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
    while !waiting.is_empty() {
        let offers = match offers::of_work(core, &waiting).await {
            Ok(offers) => offers,
            Err(error) => return Err((waiting, error)),
        };
        if offers.iter().all(Option::is_none) {
            break;
        }
        // It ends: whoever gets nothing has a try less.
        waiting = grant(core, waiting, offers).await?;
    }
    if waiting.is_empty() || !core.dispatch.may_look_for_twins() {
        return Ok(waiting);
    }
    match offers::of_twins(core, &waiting).await {
        Ok(offers) if offers.iter().all(Option::is_none) => Ok(waiting),
        Ok(offers) => grant(core, waiting, offers).await,
        Err(error) => Err((waiting, error)),
    }
}

/// Records what workers were offered, and tells them. Those that got nothing come back.
async fn grant(core: &Arc<Core>, waiting: Vec<Waiting>, offers: Vec<Option<Offer>>) -> Result<Vec<Waiting>, (Vec<Waiting>, EngineError)> {
    let asked: Vec<Grant> = offers.iter().flatten().map(|offer| offer.grant).collect();
    let mut granted = match core.store.grant(&asked, core.now()).await {
        Ok(granted) => granted.into_iter(),
        Err(error) => return Err((waiting, error.into())),
    };
    let mut left = Vec::new();
    for (mut one, offer) in waiting.into_iter().zip(offers) {
        let Some(offer) = offer else {
            left.push(one);
            continue;
        };
        match granted.next().flatten() {
            Some(tiles) => answer(core, one, &offer, tiles).await,
            // Other coordinators took all of it meanwhile, or it must not have what is left.
            None => {
                one.in_vain.push(offer.grant.job);
                left.push(one);
            }
        }
    }
    Ok(left)
}

/// Sends a worker its lease. One that has gone meanwhile gives it back at once.
async fn answer(core: &Core, waiting: Waiting, offer: &Offer, tiles: TileRun) {
    let Offer { grant, candidate } = offer;
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
