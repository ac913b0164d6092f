//! Random schedules of the pure core against a naive oracle: workers that crash, stall, duplicate, come late and lie about being done.
//!
//! The farm below is what the store does, without SQL: shards, attempts and the job machine. The oracle is a plain set of tiles that have
//! been accepted. Every schedule must end with each tile accepted exactly once. Each failure prints its seed.

use super::*;
use crate::job::{self, Job, apply};
use kiln_proto::{
    tile::{TileIndex, TileRuns},
    wire::message::Phase,
};
use std::collections::BTreeSet;

/// SplitMix64 (Steele, Lea and Flood 2014): enough for schedules.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % n
    }
}

const TTL: i64 = 30;

struct Farm {
    job: Job,
    shard: Shard,
    attempts: Vec<Attempt>,
    /// The oracle: every tile that was ever accepted.
    accepted: BTreeSet<u64>,
    now: i64,
}

/// What a worker remembers of a lease.
struct Bench {
    attempt: usize,
    todo: Vec<u64>,
    /// Baked, but not delivered.
    hand: Vec<u64>,
    silent: bool,
}

impl Farm {
    fn new(tiles: u64) -> Self {
        let job = Job::Baking { phase: Phase::Bake, left: tiles, surfaces: 1 };
        Self { job, shard: Shard::fresh(0, tiles), attempts: vec![], accepted: BTreeSet::new(), now: 0 }
    }

    fn grant(&mut self, dice: &mut Dice) -> Option<Bench> {
        let start = self.shard.first()?.start;
        let run = self.shard.take(TileIndex(start), 1 + dice.roll(6))?;
        self.attempts.push(Attempt::Held { deadline: self.now + TTL, cap: self.now + 20 * TTL, remaining: TileRuns::from_run(run) });
        Some(Bench { attempt: self.attempts.len() - 1, todo: (run.start..run.end).collect(), hand: vec![], silent: false })
    }

    fn event(&mut self, attempt: usize, event: Event) -> Result<(), Illegal> {
        let (state, actions) = self.attempts[attempt].clone().apply(event, self.now)?;
        self.attempts[attempt] = state;
        for Action::Return(tiles) in actions {
            self.shard.give_back(&tiles);
        }
        Ok(())
    }

    fn deliver(&mut self, attempt: usize, tiles: &[u64]) {
        let set: TileRuns = tiles.iter().map(|t| TileIndex(*t)).collect();
        if self.job.is_final() || self.event(attempt, Event::Deliver(set)).is_err() {
            return;
        }
        let fresh: Vec<u64> = tiles.iter().copied().filter(|t| self.shard.accept(TileIndex(*t))).collect();
        for tile in &fresh {
            assert!(self.accepted.insert(*tile), "tile {tile} was accepted twice");
        }
        if !fresh.is_empty() {
            let event = job::Event::Accepted { phase: Phase::Bake, tiles: fresh.len() as u64 };
            self.job = apply(&self.job, &event).unwrap().0;
        }
    }

    /// Every tile that is not done is pending or held exactly once.
    fn check(&self) {
        let mut places = vec![self.shard.pending.clone()];
        places.extend(
            self.attempts.iter().filter_map(|a| if let Attempt::Held { remaining, .. } = a { Some(remaining.clone()) } else { None }),
        );
        let open: Vec<TileRuns> = places.iter().map(|p| p.minus(&self.shard.done)).collect();
        let all = open.iter().fold(self.shard.done.clone(), |a, b| a.union(b));
        let sum: u64 = open.iter().map(TileRuns::len).sum();
        assert_eq!(all.len(), sum + self.shard.done.len(), "a tile is in two places");
        assert_eq!(self.accepted.len() as u64, self.shard.done.len());
    }
}

fn step(farm: &mut Farm, benches: &mut Vec<Bench>, dice: &mut Dice) {
    farm.now += dice.roll(8) as i64;
    for attempt in 0..farm.attempts.len() {
        let _ = farm.event(attempt, Event::Tick);
    }
    if benches.is_empty() || dice.roll(4) == 0 {
        benches.extend(farm.grant(dice));
        return;
    }
    let k = dice.roll(benches.len() as u64) as usize;
    let bench = &mut benches[k];
    match dice.roll(12) {
        0..4 => bench.hand.extend(bench.todo.pop()),
        4..7 => farm.deliver(bench.attempt, &std::mem::take(&mut bench.hand)),
        7 => farm.deliver(bench.attempt, &bench.hand), // The answer is lost: it comes again.
        8 if !bench.silent => drop(farm.event(bench.attempt, Event::Heartbeat { ttl: TTL })),
        9 => bench.silent = true,
        10 => {
            let event = if dice.roll(3) == 0 { Event::Release } else { Event::Complete };
            if bench.todo.is_empty() || dice.roll(5) == 0 {
                let _ = farm.event(bench.attempt, event);
            }
        }
        _ if dice.roll(3) == 0 => drop(benches.swap_remove(k)), // It crashes and says nothing more.
        _ => {
            if dice.roll(6) == 0 {
                let _ = farm.event(bench.attempt, Event::Fence);
            }
        }
    }
}

#[test]
fn every_schedule_accepts_every_tile_exactly_once_and_ends() {
    for seed in 0..10_000u64 {
        let outcome = std::panic::catch_unwind(|| {
            let mut dice = Dice(seed);
            let tiles = 1 + dice.roll(24);
            let (mut farm, mut benches) = (Farm::new(tiles), vec![]);
            for _ in 0..dice.roll(160) {
                step(&mut farm, &mut benches, &mut dice);
                farm.check();
            }
            // From wherever chaos left it, one honest worker finishes the job once the old leases have run out.
            farm.now += 21 * TTL;
            (0..farm.attempts.len()).for_each(|a| drop(farm.event(a, Event::Tick)));
            while let Some(bench) = farm.grant(&mut dice) {
                farm.deliver(bench.attempt, &bench.todo);
                farm.event(bench.attempt, Event::Complete).unwrap();
                assert_eq!(farm.attempts[bench.attempt], Attempt::Completed);
            }
            farm.check();
            assert_eq!(farm.accepted.len() as u64, tiles);
            assert_eq!(farm.job, Job::Assembling { left: 1, surfaces: 1 });
        });
        assert!(outcome.is_ok(), "seed {seed}");
    }
}

#[test]
fn a_late_heartbeat_is_not_believed_and_a_late_delivery_is() {
    let held = Attempt::Held { deadline: 10, cap: 100, remaining: TileRuns::all(3) };
    let (expired, actions) = held.clone().apply(Event::Heartbeat { ttl: TTL }, 10).unwrap();
    assert_eq!((&expired, actions), (&Attempt::Expired, vec![Action::Return(TileRuns::all(3))]));
    assert!(expired.clone().apply(Event::Deliver(TileRuns::all(1)), 11).is_ok());
    assert_eq!(expired.apply(Event::Complete, 11), Err(Illegal { event: "completion", state: "expired" }));
    let (fenced, _) = held.clone().apply(Event::Fence, 5).unwrap();
    assert!(fenced.apply(Event::Deliver(TileRuns::all(1)), 6).is_err());
    // The hard cap ends an attempt whose heartbeats never stop.
    let (held, _) = held.apply(Event::Heartbeat { ttl: 1_000 }, 9).unwrap();
    assert_eq!(held.apply(Event::Heartbeat { ttl: 1_000 }, 100).unwrap().0, Attempt::Expired);
}
