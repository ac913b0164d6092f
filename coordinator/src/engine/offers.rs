//! What waiting workers are offered: of whose tiles, which and how many.
//!
//! All that wait are looked at in one go. The ledger says for each whose work goes next, so that jobs share the farm lease by lease and not
//! batch by batch. An offer is a wish: the store may find that somebody else was quicker.

use super::{
    EngineError,
    core::Core,
    dispatch::{TRIES, Waiting},
};
use crate::{
    config::LeaseOrder,
    lease::{Claim, Field, Kind, Running, Sizing, run_length},
    records::WorkerRecord,
    store::{Candidate, ClaimRow, Grant, Late},
};
use kiln_proto::{
    ids::{JobId, Token},
    tile::{TileIndex, TileRun, TileRuns},
};
use std::collections::{HashMap, VecDeque};

/// What a worker is offered.
pub(super) struct Offer {
    pub(super) grant: Grant,
    pub(super) candidate: Candidate,
}

impl Offer {
    fn new(core: &Core, worker: &WorkerRecord, candidate: Candidate, run: TileRun, cost: u64) -> Self {
        let (now, lease) = (core.now(), &core.config.lease);
        let grant = Grant {
            token: Token::random(),
            worker: worker.id,
            job: candidate.job,
            phase: candidate.phase,
            kind: candidate.kind,
            run,
            cost,
            deadline: now.saturating_add(lease.ttl_ms as i64),
            cap: now.saturating_add(lease.hard_cap_ms as i64),
        };
        Self { grant, candidate }
    }
}

/// Work for each of these workers of one bake version, as far as there is some.
pub(super) async fn of_work(core: &Core, waiting: &[Waiting]) -> Result<Vec<Option<Offer>>, EngineError> {
    let Some(first) = waiting.first() else { return Ok(Vec::new()) };
    let mut market = Market { claims: core.store.claims(first.worker.bake_version).await?, stalls: HashMap::new(), most: waiting.len() };
    let mut offers = Vec::with_capacity(waiting.len());
    for one in waiting {
        offers.push(market.offer(core, one).await?);
    }
    Ok(offers)
}

/// What all jobs have to offer at one moment, less what has been offered.
struct Market {
    claims: Vec<ClaimRow>,
    stalls: HashMap<JobId, VecDeque<Candidate>>,
    /// Candidates to ask of a job, at most.
    most: usize,
}

impl Market {
    async fn offer(&mut self, core: &Core, one: &Waiting) -> Result<Option<Offer>, EngineError> {
        while let Some((at, job)) = self.choose(core, one) {
            if !self.stalls.contains_key(&job) {
                self.stalls.insert(job, core.store.next_work(job, self.most).await?.into());
            }
            let stall = self.stalls.entry(job).or_default();
            let claim = &mut self.claims[at];
            let Some(candidate) = stall.front_mut() else {
                // Gone since it was counted, or more pieces than were asked for.
                (claim.waiting, claim.unasked) = (0, 0);
                continue;
            };
            claim.leased += 1;
            let offer = match candidate.kind {
                Kind::Check => {
                    claim.unasked = claim.unasked.saturating_sub(1);
                    Offer::new(core, &one.worker, *candidate, candidate.run, 0)
                }
                _ => {
                    candidate.pending = claim.waiting;
                    let (run, cost) = size(core, &one.worker, candidate).await?;
                    claim.waiting = claim.waiting.saturating_sub(run.len());
                    let offer = Offer::new(core, &one.worker, *candidate, run, cost);
                    candidate.run = rest(candidate.run, run);
                    offer
                }
            };
            if candidate.run.is_empty() {
                stall.pop_front();
            }
            core.dispatch.ledger().granted(job, self.claims[at].priority, offer.grant.cost);
            return Ok(Some(offer));
        }
        Ok(None)
    }

    /// The job that goes next for a worker, and where its claim is.
    fn choose(&self, core: &Core, one: &Waiting) -> Option<(usize, JobId)> {
        let claim = |c: &ClaimRow| {
            let tried = one.in_vain.iter().filter(|job| **job == c.job).count();
            let pending = if tried >= TRIES { 0 } else { c.waiting + c.unasked };
            Claim { job: c.job, priority: c.priority, pending, leased: c.leased, owner: c.owner }
        };
        let claims: Vec<Claim> = self.claims.iter().map(claim).collect();
        let job = core.dispatch.ledger().choose(&claims, core.config.lease.per_token)?;
        Some((claims.iter().position(|c| c.job == job)?, job))
    }
}

/// What is left of a run when its beginning or its end was taken.
fn rest(of: TileRun, taken: TileRun) -> TileRun {
    if taken.start == of.start { TileRun { start: taken.end, end: of.end } } else { TileRun { start: of.start, end: taken.start } }
}

/// How much of the candidate this worker gets, and what that costs, texels.
async fn size(core: &Core, worker: &WorkerRecord, candidate: &Candidate) -> Result<(TileRun, u64), EngineError> {
    let plan = core.plan(&candidate.plan).await?;
    let speed = core.meter().speeds.of(worker.id, candidate.job, candidate.phase);
    let sizing = Sizing {
        target_ms: core.config.lease.target_ms,
        speed,
        threads: worker.threads,
        pending: candidate.pending,
        workers: core.present_workers(),
    };
    let TileRun { start, end } = candidate.run;
    let cost = |t| plan.tile_cost(candidate.phase, TileIndex(t));
    let run = match core.config.lease.order {
        LeaseOrder::Forward => TileRun { start, end: start + run_length(&sizing, (start..end).map(cost)) },
        LeaseOrder::Reverse => TileRun { start: end - run_length(&sizing, (start..end).rev().map(cost)), end },
    };
    Ok((run, (run.start..run.end).map(cost).sum()))
}

/// Late attempts along with which these idle workers of one bake version may bake.
pub(super) async fn of_twins(core: &Core, waiting: &[Waiting]) -> Result<Vec<Option<Offer>>, EngineError> {
    let Some(first) = waiting.first() else { return Ok(Vec::new()) };
    let mut late = core.store.late(first.worker.bake_version, core.now()).await?;
    let mut offers = Vec::with_capacity(waiting.len());
    for one in waiting {
        let mut offer = None;
        for phase in &mut late {
            offer = twin(core, one, phase).await?;
            if offer.is_some() {
                break;
            }
        }
        offers.push(offer);
    }
    Ok(offers)
}

async fn twin(core: &Core, one: &Waiting, late: &mut Late) -> Result<Option<Offer>, EngineError> {
    let field = Field { pending: 0, running: &late.running, finished: &late.finished, workers: late.workers };
    let Some(twin) = field.twin(one.worker.id, core.now()) else { return Ok(None) };
    let plan = core.plan(&late.candidate.plan).await?;
    let cost = (twin.run.start..twin.run.end).map(|t| plan.tile_cost(late.candidate.phase, TileIndex(t))).sum();
    let candidate = Candidate { kind: Kind::Twin(twin.of), ..late.candidate };
    let offer = Offer::new(core, &one.worker, candidate, twin.run, cost);
    tracing::info!(job = %candidate.job, of = %twin.of, worker = %one.worker.id, "an attempt is late; an idle worker bakes along");
    late.running.push(Running {
        token: offer.grant.token,
        worker: one.worker.id,
        since: core.now(),
        cost,
        remaining: TileRuns::from_run(twin.run),
        twin_of: Some(twin.of),
        suspected: false,
    });
    Ok(Some(offer))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_eaten_from_either_end() {
        let run = |start, end| TileRun { start, end };
        assert_eq!(rest(run(2, 9), run(2, 4)), run(4, 9));
        assert_eq!(rest(run(2, 9), run(7, 9)), run(2, 7));
        assert!(rest(run(2, 9), run(2, 9)).is_empty());
    }
}
