//! Each rule, broken: the schedules must notice. A rule whose mutant survives is not tested, or not needed.

use super::{super::rule::Rule, Slip, schedule};

/// Schedules within which a mutant must be caught. Most die within twenty; twins need a late attempt at the end of a phase.
const SEEDS: u64 = 3_000;

fn dies(run: impl Fn(u64) -> super::Promise) -> bool {
    (0..SEEDS).any(|seed| run(seed).is_err())
}

macro_rules! mutants {
    ($($name:ident: $rule:expr, $run:expr;)*) => {
        $(#[test]
        fn $name() {
            assert!(dies(|seed| $run($rule, seed)), "nobody notices that {:?} is broken", $rule);
        })*
    };
}

fn core(rule: Rule, seed: u64) -> super::Promise {
    rule.broken(|| schedule(seed, None)).map(drop)
}

fn farm(slip: Slip, seed: u64) -> super::Promise {
    schedule(seed, Some(slip)).map(drop)
}

mutants! {
    a_fenced_attempt_delivers: Rule::Fence, core;
    nothing_expires: Rule::Expiry, core;
    there_is_no_hard_cap: Rule::HardCap, core;
    a_late_heartbeat_is_believed: Rule::LateHeartbeat, core;
    a_late_delivery_is_refused: Rule::LateDelivery, core;
    a_worker_that_says_it_is_done_is_believed: Rule::Completeness, core;
    a_release_is_charged: Rule::Drain, core;
    a_tile_is_accepted_twice: Rule::Once, core;
    giving_back_forgets_what_is_done: Rule::Done, core;
    giving_back_forgets_the_twin: Rule::TwinHolds, core;
    failed_leases_are_not_halved: Rule::Halving, core;
    leases_of_several_tiles_are_charged: Rule::Singles, core;
    one_worker_quarantines_alone: Rule::TwoWorkers, core;
    a_twin_goes_to_the_same_worker: Rule::OtherTwin, core;
    a_worker_checks_itself: Rule::OtherJudge, core;
    a_pause_loses_deliveries: Rule::PausedCounts, core;
    a_hole_is_waited_for: Rule::Holes, core;
    a_worker_hears_too_early_that_a_tile_is_safe: Slip::AckFirst, farm;
    nobody_tells_who_was_overtaken: Slip::Untold, farm;
    a_barred_worker_goes_on: Slip::BarredWorks, farm;
    a_retry_leaves_tiles_in_quarantine: Slip::ShutQuarantine, farm;
    a_paused_job_is_leased: Slip::PausedLeases, farm;
}
