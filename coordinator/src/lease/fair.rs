//! Whose tiles go next.
//!
//! Jobs of the same priority form a level. Levels share the farm by weight, 2^priority with the priority clamped to ±10: a level gets twice
//! the work of the one below it while both have tiles that wait (stride scheduling, Waldspurger and Weihl 1995: the level whose granted
//! work divided by its weight is least goes next). Within a level the oldest job goes first, because two jobs that finish one after the
//! other wait less on average than two that share everything. Neither starves anybody: a level that has waited for [`PATIENCE`] grants goes
//! next whatever its weight, and every [`TURN`]th grant of a level goes to its job that was served longest ago.
//!
//! The ledger lives in memory: a coordinator that restarts, or several of them, are each fair from now on, which is all that fairness
//! needs. Counting in the database, the alternative, makes one hot row of every job for nothing that a bake's result depends on.

use crate::auth::TokenId;
use kiln_proto::ids::JobId;
use std::collections::BTreeMap;

/// Priorities beyond this count as this.
const CLAMP: i32 = 10;

/// Grants after which a level goes next whatever its weight.
const PATIENCE: u64 = 64;

/// Which of a level's grants go to the job that was served longest ago.
const TURN: u64 = 8;

/// Virtual time of one texel at the least weight; at the greatest it is 1.
const SCALE: u128 = 1 << (2 * CLAMP);

/// A job that bakes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claim {
    /// The job. Ids are ordered by age.
    pub job: JobId,
    /// Its priority.
    pub priority: i32,
    /// Its tiles that wait, for a worker or for a second one.
    pub pending: u64,
    /// Its leases that are held now.
    pub leased: u64,
    /// Whose it is, where that is known.
    pub owner: Option<TokenId>,
}

/// What has been granted to whom, as far as it bears on who goes next.
#[derive(Debug, Clone, Default)]
pub struct Ledger {
    levels: BTreeMap<i32, Level>,
    /// Virtual time: that of the level that went last.
    now: u128,
    /// Grants so far.
    grants: u64,
}

#[derive(Debug, Clone, Default)]
struct Level {
    /// Granted work divided by weight.
    pass: u128,
    /// When it last went, or arrived; in grants.
    served: u64,
    /// When it was last seen with tiles that wait; in grants.
    seen: u64,
    /// Its grants.
    grants: u64,
    /// When each of its jobs was last served, or arrived; in grants.
    jobs: BTreeMap<JobId, u64>,
}

impl Ledger {
    /// The job whose tiles go next, of all jobs that bake. Owners that hold `limit` leases wait.
    pub fn choose(&mut self, claims: &[Claim], limit: Option<u64>) -> Option<JobId> {
        let within = |claim: &&Claim| claim.pending > 0 && limit.is_none_or(|most| leased(claims, claim) < most);
        let waiting: Vec<&Claim> = claims.iter().filter(within).collect();
        self.arrive(&waiting);
        let present = || self.levels.iter().filter(|(priority, _)| waiting.iter().any(|c| level(c.priority) == **priority));
        let overdue = present().filter(|(_, l)| self.grants - l.served >= PATIENCE).min_by_key(|(_, l)| l.served);
        // The higher one where both have had their share.
        let (priority, next) = overdue.or_else(|| present().min_by_key(|(priority, l)| (l.pass, -**priority)))?;
        let of_level = waiting.iter().filter(|c| level(c.priority) == *priority).map(|c| c.job);
        if next.grants % TURN == TURN - 1 { of_level.min_by_key(|job| (next.jobs.get(job).copied(), *job)) } else { of_level.min() }
    }

    /// Takes in that work of a job, in texels, was granted.
    pub fn granted(&mut self, job: JobId, priority: i32, work: u64) {
        self.grants += 1;
        let priority = level(priority);
        let next = self.levels.entry(priority).or_default();
        self.now = self.now.max(next.pass);
        next.pass += u128::from(work.max(1)) * (SCALE >> (CLAMP + priority));
        next.served = self.grants;
        next.grants += 1;
        next.jobs.insert(job, self.grants);
    }

    /// Lets jobs and levels in that were not waiting before; time away earns nothing. Forgets jobs that do not wait any more.
    fn arrive(&mut self, waiting: &[&Claim]) {
        for (priority, l) in &mut self.levels {
            l.jobs.retain(|job, _| waiting.iter().any(|c| c.job == *job && level(c.priority) == *priority));
        }
        for claim in waiting {
            let l = self.levels.entry(level(claim.priority)).or_insert_with(|| Level { seen: u64::MAX, ..Level::default() });
            // Absent when somebody else was served, or never here.
            if l.seen.checked_add(1).is_none_or(|next| next < self.grants) {
                l.pass = l.pass.max(self.now);
                l.served = self.grants;
            }
            l.seen = self.grants;
            l.jobs.entry(claim.job).or_insert(self.grants);
        }
    }
}

fn level(priority: i32) -> i32 {
    priority.clamp(-CLAMP, CLAMP)
}

/// Leases of an owner in all its jobs; where a job has no owner, those of the job.
fn leased(claims: &[Claim], of: &Claim) -> u64 {
    let same = |c: &&Claim| if of.owner.is_some() { c.owner == of.owner } else { c.job == of.job };
    claims.iter().filter(same).fold(0, |sum, c| sum.saturating_add(c.leased))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use uuid::Uuid;

    fn claim(job: u128, priority: i32) -> Claim {
        Claim { job: JobId(Uuid::from_u128(job)), priority, pending: 1, leased: 0, owner: None }
    }

    /// How many of so many grants of the same work each job gets.
    fn share(ledger: &mut Ledger, claims: &[Claim], grants: usize) -> Vec<usize> {
        let mut counts = vec![0; claims.len()];
        for _ in 0..grants {
            let job = ledger.choose(claims, None).unwrap();
            let k = claims.iter().position(|c| c.job == job).unwrap();
            ledger.granted(job, claims[k].priority, 100);
            counts[k] += 1;
        }
        counts
    }

    #[test]
    fn a_priority_more_is_twice_the_work() {
        let counts = share(&mut Ledger::default(), &[claim(1, 0), claim(2, 1), claim(3, 2)], 700);
        assert_eq!(counts, [100, 200, 400]);
    }

    #[test]
    fn work_is_shared_and_not_grants() {
        let (mut ledger, claims) = (Ledger::default(), [claim(1, 0), claim(2, 1)]);
        let mut work = [0u64; 2];
        for _ in 0..4_000 {
            let job = ledger.choose(&claims, None).unwrap();
            let k = usize::from(job == claims[1].job);
            let of = [1_000, 10][k];
            ledger.granted(job, claims[k].priority, of);
            work[k] += of;
        }
        // Patience gives the lower one a little more than its half.
        let ratio = work[1] as f64 / work[0] as f64;
        assert!((0.5..=2.05).contains(&ratio), "{work:?}");
    }

    #[test]
    fn among_equals_the_oldest_goes_first_and_the_others_are_not_forgotten() {
        let counts = share(&mut Ledger::default(), &[claim(3, 0), claim(1, 0), claim(2, 0)], 240);
        assert_eq!(counts, [15, 210, 15]);
    }

    #[test]
    fn time_away_earns_nothing() {
        let (mut ledger, both) = (Ledger::default(), [claim(1, 0), claim(2, 1)]);
        for _ in 0..2 {
            share(&mut ledger, &both[..1], 1_000);
            let counts = share(&mut ledger, &both, 300);
            assert!((99..=101).contains(&counts[0]), "{counts:?}");
        }
    }

    #[test]
    fn an_owner_at_its_limit_waits_with_all_its_jobs() {
        let [a, b] = [1, 2].map(|n| TokenId::from_random([n << 5; 8]));
        let owned = |n, leased| Claim { leased, owner: Some(a), ..claim(n, 9) };
        let claims = [owned(1, 60), Claim { pending: 0, ..owned(2, 40) }, Claim { owner: Some(b), ..claim(3, 0) }];
        assert_eq!(Ledger::default().choose(&claims, Some(101)), Some(claims[0].job));
        assert_eq!(Ledger::default().choose(&claims, Some(100)), Some(claims[2].job));
        assert_eq!(Ledger::default().choose(&claims[..2], Some(100)), None);
        assert_eq!(Ledger::default().choose(&[], None), None);
    }

    proptest! {
        /// Whatever the priorities, the ages and the sizes of leases: every job that waits is served within a bounded number of grants.
        #[test]
        fn nobody_starves(jobs in prop::collection::vec((-30i32..30, 1u64..5_000), 1..7)) {
            let claims: Vec<Claim> = jobs.iter().enumerate().map(|(n, (priority, _))| claim(n as u128, *priority)).collect();
            let levels = claims.iter().map(|c| level(c.priority)).collect::<std::collections::BTreeSet<_>>().len();
            let bound = TURN as usize * claims.len() * (PATIENCE as usize + levels);
            let (mut ledger, mut last) = (Ledger::default(), vec![0; claims.len()]);
            for grant in 1..=6_000 {
                let job = ledger.choose(&claims, None).unwrap();
                let k = claims.iter().position(|c| c.job == job).unwrap();
                ledger.granted(job, claims[k].priority, jobs[k].1);
                last[k] = grant;
                prop_assert!(last.iter().all(|l| grant - l <= bound), "{:?} at {}", last, grant);
            }
        }
    }
}
