//! What goes wrong in a schedule, and for how long: all of it from the seed.
//!
//! One fault at a time for each worker and for the coordinator, several at once in the farm. A partition loses what is on its way, and the
//! simulated TCP sends nothing again: a connection that lost a segment is silent for good, as one is whose other end was unplugged. The
//! client's and the server's own time limits are what gets them out of it.

use super::{net::COORDINATOR, witness::Witness};
use crate::lease::simulation::Dice;
use std::{collections::BTreeMap, time::Duration};
use turmoil::Sim;

/// The usual delay of a message, at most.
pub(super) const LATENCY: Duration = Duration::from_millis(60);
/// That of a slow link.
const SLOW: Duration = Duration::from_millis(4_000);
/// Of messages over a lossy link, this part breaks it until it is mended.
const LOSS: f64 = 0.05;

/// A fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fault {
    /// Nothing passes between a worker and the coordinator.
    Cut,
    /// What the coordinator says is lost.
    Deaf,
    /// What the worker says is lost.
    Mute,
    /// Everything is held up, and arrives at the end.
    Held,
    Slow,
    Lossy,
    /// The host dies, and is started again.
    Crash,
}

const FAULTS: [(Fault, &str); 7] = [
    (Fault::Cut, "a cut"),
    (Fault::Deaf, "a deaf worker"),
    (Fault::Mute, "a mute worker"),
    (Fault::Held, "messages held up"),
    (Fault::Slow, "a slow link"),
    (Fault::Lossy, "a lossy link"),
    (Fault::Crash, "a worker's crash"),
];

/// The faults of a schedule.
pub(super) struct Chaos {
    dice: Dice,
    /// When the next fault begins.
    next: Duration,
    /// When everything is mended for good.
    over: Duration,
    /// Whether a last crash of the coordinator cuts every connection then; otherwise those that wait in vain must find out by themselves.
    cuts: bool,
    /// What is wrong with a host, and until when.
    wrong: BTreeMap<String, (Fault, Duration)>,
}

impl Chaos {
    pub(super) fn new(mut dice: Dice, over: Duration) -> Self {
        let (next, cuts) = (Duration::from_millis(dice.roll(3_000)), !dice.once_in(4));
        Self { dice, next, over, cuts, wrong: BTreeMap::new() }
    }

    /// No faults at all.
    pub(super) fn none() -> Self {
        Self { dice: Dice(0), next: Duration::MAX, over: Duration::MAX, cuts: false, wrong: BTreeMap::new() }
    }

    /// Begins and ends what is due.
    pub(super) fn step(&mut self, sim: &mut Sim<'_>, workers: &[String], witness: &Witness) {
        let now = sim.elapsed();
        let due: Vec<String> =
            self.wrong.iter().filter(|(_, (_, until))| *until <= now || self.over <= now).map(|(h, _)| h.clone()).collect();
        for host in due {
            if let Some((fault, _)) = self.wrong.remove(&host) {
                witness.fault(now, &format!("{host} {fault:?} ends"));
                mend(sim, &host, fault);
            }
        }
        if self.over <= now && std::mem::take(&mut self.cuts) {
            witness.fault(now, "a last crash");
            sim.bounce(COORDINATOR);
        }
        if now < self.next || self.over <= now {
            return;
        }
        self.next = now + Duration::from_millis(100 + self.dice.roll(3_000));
        let (host, (fault, name)) = match self.dice.pick(workers.len() + 1) {
            Some(worker) if worker < workers.len() => (workers[worker].clone(), FAULTS[self.dice.roll(FAULTS.len() as u64) as usize]),
            _ => (COORDINATOR.to_owned(), (Fault::Crash, "a coordinator's crash")),
        };
        if self.wrong.contains_key(&host) {
            return;
        }
        // Shorter than a heartbeat, longer than a lease, or between them.
        let most = [1_500, 6_000, 20_000][self.dice.roll(3) as usize];
        let lasts = Duration::from_millis(50 + self.dice.roll(most));
        witness.fault(now, &format!("{host} {fault:?} for {} ms", lasts.as_millis()));
        witness.meet(name);
        begin(sim, &host, fault);
        self.wrong.insert(host, (fault, now + lasts));
    }
}

fn begin(sim: &mut Sim<'_>, host: &str, fault: Fault) {
    match fault {
        Fault::Cut => sim.partition(host, COORDINATOR),
        Fault::Deaf => sim.partition_oneway(COORDINATOR, host),
        Fault::Mute => sim.partition_oneway(host, COORDINATOR),
        Fault::Held => sim.hold(host, COORDINATOR),
        Fault::Slow => sim.set_link_max_message_latency(host, COORDINATOR, SLOW),
        Fault::Lossy => sim.set_link_fail_rate(host, COORDINATOR, LOSS),
        Fault::Crash => sim.crash(host),
    }
}

fn mend(sim: &mut Sim<'_>, host: &str, fault: Fault) {
    match fault {
        Fault::Cut | Fault::Deaf | Fault::Mute => sim.repair(host, COORDINATOR),
        Fault::Held => sim.release(host, COORDINATOR),
        Fault::Slow => sim.set_link_max_message_latency(host, COORDINATOR, LATENCY),
        Fault::Lossy => {
            sim.set_link_fail_rate(host, COORDINATOR, 0.0);
            sim.repair(host, COORDINATOR);
        }
        Fault::Crash => sim.bounce(host),
    }
}
