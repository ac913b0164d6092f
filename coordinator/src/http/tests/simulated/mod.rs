//! The real router and the real client of workers on a simulated network, with everything that networks and machines do wrong.
//!
//! turmoil runs a coordinator, three to five workers and a watcher in one thread, each with a clock of its own that stands still while it
//! works: a minute of faults takes a fraction of a second. Real are axum with all layers, the engine, the store in SQLite, blobs as files,
//! and the worker's session, courier, spool and ledger over hyper's client. Made up are what is baked (segments of sixteen bytes), the network
//! and time. Links are cut (both ways or one), held up, slowed down and made lossy; workers and the coordinator die and come again, with what
//! they had on disk.
//!
//! `store` keeps SQLite's threads from confusing the clocks. `net` is both ends of the network, `worker` and `farm` who is on it, `chaos` what
//! happens to them. `witness` hears every answer that arrives, and `farm` looks into the folder at every start and at the end: the job is
//! done; each tile was accepted once, by one worker's knowledge and in the store; nothing that a worker knows to be accepted is lost; the
//! package is that of a calm farm; no call failed for a reason that honest workers have no part in; every worker is back at work.
//!
//! The alternative, proxies between real processes, is in tests/system: it proves more for each run and has a few runs where this has hundreds.
//! Here a failure names its seed, and `KILN_SEED=n` runs that one alone, several times: the seed fixes what goes wrong and when, how fast
//! everybody is and the network's delays, but not the tokens, nor which of the real threads that SQLite and files need is done first, so that
//! two runs of a seed part after a while. Forbidding those threads would have taken a seam in every module that blocks.
//!
//! A hundred seeds take about a minute of processor time on all cores, most of it SQLite's. `KILN_SOAK=1`, as in `make soak`, runs 500.

mod chaos;
mod farm;
mod net;
mod store;
mod template;
mod witness;
mod worker;

use crate::lease::rule::Rule;
use farm::{Knobs, Outcome, run};
use std::{
    collections::BTreeSet,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
};
use template::Template;

/// What a schedule is worth: `Err` says which promise was broken.
type Promise<T> = Result<T, String>;

const SEEDS: u64 = 100;
const SOAK_SEEDS: u64 = 500;

/// What schedules that say anything must come across.
const MEETS: [&str; 14] = [
    "a call without an answer",
    "a chunk sent twice",
    "a coordinator's crash",
    "a cut",
    "a deaf worker",
    "a lie found",
    "a lossy link",
    "a mute worker",
    "a slow link",
    "a tile baked twice",
    "a worker's crash",
    "an attempt that ran out",
    "chunks of an earlier life",
    "messages held up",
];

/// How often a seed is run that is asked for.
const TRIES: usize = 20;

/// The seeds to run: all, or the one that is asked for.
fn seeds() -> Vec<u64> {
    if let Ok(seed) = std::env::var("KILN_SEED") {
        return vec![seed.parse().expect("KILN_SEED is a number"); TRIES];
    }
    (0..if std::env::var_os("KILN_SOAK").is_some() { SOAK_SEEDS } else { SEEDS }).collect()
}

fn fails(seed: u64, outcome: &Outcome, why: &str) -> String {
    let last = outcome.trace.len().saturating_sub(80);
    let trace = outcome.trace[last..].join("\n");
    format!("seed {seed}: {why}\n{trace}\nKILN_SEED={seed} cargo test -p kiln-coordinator --lib simulated runs it again")
}

/// What is wrong with a schedule that should bring forth the package of a calm farm.
fn wrong(outcome: &Outcome, calm: &Vec<Vec<u8>>) -> Option<String> {
    match &outcome.promise {
        Ok(package) if outcome.lies || package == calm => None,
        Ok(_) => Some("the package differs from that of a calm farm".into()),
        Err(why) => Some(why.clone()),
    }
}

#[test]
fn whatever_the_network_does_every_job_ends_with_the_same_package() {
    let template = Template::new();
    let calm = run(&template, 0, Knobs { calm: true, ..Knobs::default() });
    let calm = calm.promise.as_ref().unwrap_or_else(|why| panic!("{}", fails(0, &calm, why)));
    let (seeds, met) = (seeds(), Mutex::new(BTreeSet::new()));
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(&seed) = seeds.get(next.fetch_add(1, Ordering::SeqCst)) {
            let outcome = run(&template, seed, Knobs::default());
            if let Some(why) = wrong(&outcome, calm) {
                panic!("{}", fails(seed, &outcome, &why));
            }
            met.lock().unwrap().extend(outcome.met);
        }
    };
    std::thread::scope(|threads| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            threads.spawn(work);
        }
    });
    let met = met.into_inner().unwrap();
    let missed: Vec<_> = MEETS.iter().filter(|what| !met.contains(**what)).collect();
    assert!(seeds.len() == TRIES || missed.is_empty(), "no schedule comes across {missed:?}");
}

/// The order in which threads of the database and of the disk are done is nobody's to choose, and tokens are random.
#[test]
fn a_seed_is_one_schedule_of_faults() {
    let template = Template::new();
    for seed in 0..3 {
        let (once, again) = (run(&template, seed, Knobs::default()).faults, run(&template, seed, Knobs::default()).faults);
        // Until the first of both farms is done.
        let most = once.len().min(again.len());
        assert!(most > 2 && once[..most] == again[..most], "seed {seed}: {once:#?} against {again:#?}");
    }
}

/// Schedules within which a farm that keeps no rules must be caught.
const CAUGHT: u64 = 20;

/// What the first schedule says that a knob turns into a failure.
fn caught(knobs: Knobs) -> String {
    let template = Template::new();
    (0..CAUGHT).find_map(|seed| run(&template, seed, knobs).promise.err()).unwrap_or_default()
}

#[test]
fn leases_that_never_run_out_are_noticed() {
    let said = caught(Knobs { broken: Some(Rule::Expiry), ..Knobs::default() });
    assert!(said.contains("does not end"), "{said}");
}

#[test]
fn a_coordinator_that_forgets_is_noticed() {
    let said = caught(Knobs { forgetful: true, ..Knobs::default() });
    assert!(said.contains("is lost"), "{said}");
}
