//! The workers, the network between them and the coordinators, and the people who pause and cancel.

use super::{
    super::{Attempt, Event, Kind},
    Dice, Promise, Slip,
    farm::{Coordinator, Farm, TTL},
};
use crate::job::{self, Job, JobTask};
use kiln_proto::{
    ids::{Digest, WorkerId},
    tile::TileIndex,
    wire::message::Phase,
};
use std::collections::{BTreeMap, BTreeSet};
use uuid::Uuid;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Nature {
    Honest,
    /// Sends other bytes now and then.
    Liar,
    /// Fails every third tile, which others manage.
    Clumsy(u64),
}

/// A lease as its worker sees it.
struct Bench {
    lease: usize,
    todo: Vec<u64>,
    /// Baked, and not known to be safe.
    spool: BTreeMap<u64, Digest>,
    failed: bool,
}

struct Hand {
    id: WorkerId,
    nature: Nature,
    benches: Vec<Bench>,
    /// It says nothing any more, and does not know it.
    silent: bool,
    /// It finishes what it has begun and takes nothing new.
    leaving: bool,
}

#[derive(Debug, Clone)]
enum Letter {
    Chunk(Vec<(u64, Digest)>),
    End(Event),
}

#[derive(Debug, Clone)]
struct Mail {
    from: WorkerId,
    lease: usize,
    letter: Letter,
}

pub(super) struct World {
    pub(super) farm: Farm,
    hands: Vec<Hand>,
    mail: Vec<Mail>,
    /// Tiles that nobody can bake: job, phase, tile.
    pub(super) poison: BTreeSet<(usize, Phase, u64)>,
    workers: u128,
}

/// The right bytes of a tile.
pub(super) fn truth(tile: u64) -> Digest {
    Digest([tile as u8; 32])
}

impl World {
    pub(super) fn new(seed: u64, slip: Option<Slip>) -> Self {
        let farm = Farm::new(Dice(seed), slip);
        let mut world = Self { farm, hands: vec![], mail: vec![], poison: BTreeSet::new(), workers: 0 };
        if world.farm.dice.once_in(3) {
            let (j, tile) = (world.farm.jobs.len() - 1, world.farm.dice.roll(20));
            let phase = if world.farm.dice.once_in(3) { Phase::Probe } else { Phase::Bake };
            world.poison.insert((j, phase, tile));
        }
        for _ in 0..1 + world.farm.dice.roll(3) {
            let nature = match world.farm.dice.roll(6) {
                0 if !world.hands.iter().any(|hand| hand.nature == Nature::Liar) => Nature::Liar,
                1 => Nature::Clumsy(world.farm.dice.roll(3)),
                _ => Nature::Honest,
            };
            world.join(nature);
        }
        world
    }

    fn join(&mut self, nature: Nature) -> WorkerId {
        self.workers += 1;
        let id = WorkerId(Uuid::from_u128(self.workers));
        self.farm.connected.insert(id);
        self.hands.push(Hand { id, nature, benches: vec![], silent: false, leaving: false });
        id
    }

    /// One honest worker more.
    pub(super) fn join_honest(&mut self) -> WorkerId {
        self.join(Nature::Honest)
    }

    /// Everybody is gone, and nothing is under way.
    pub(super) fn silence(&mut self) {
        self.hands.clear();
        self.mail.clear();
        self.farm.connected.clear();
    }

    pub(super) fn step(&mut self) -> Promise {
        self.farm.now += self.farm.dice.roll(6) as i64;
        if self.farm.dice.once_in(60) {
            self.farm.now += self.farm.dice.roll(200) as i64;
        }
        if self.farm.dice.once_in(2) {
            self.farm.tick()?;
        }
        match self.farm.dice.roll(24) {
            0..5 => self.ask(),
            5..10 => self.bake(),
            10..13 => self.send(),
            13..18 => self.arrive(),
            18 => self.heartbeat(),
            19 => self.trouble(),
            20 => self.people(),
            21 | 22 => self.task(),
            _ => self.misfortune(),
        }
    }

    /// A worker asks for work, as it may while it has some.
    fn ask(&mut self) -> Promise {
        let Some(h) = self.farm.dice.pick(self.hands.len()) else { return Ok(()) };
        let (c, hand) = (self.farm.dice.roll(self.farm.coordinators.len() as u64) as usize, &self.hands[h]);
        if hand.leaving || (hand.silent && !self.farm.dice.once_in(3)) {
            return Ok(());
        }
        if let Some(k) = self.farm.grant(hand.id, c)? {
            let run = self.farm.leases[k].run;
            let todo = (run.start..run.end).rev().collect();
            self.hands[h].benches.push(Bench { lease: k, todo, spool: BTreeMap::new(), failed: false });
        }
        Ok(())
    }

    fn bench(&mut self) -> Option<(usize, usize)> {
        let h = self.farm.dice.pick(self.hands.len())?;
        Some((h, self.farm.dice.pick(self.hands[h].benches.len())?))
    }

    /// A worker bakes a tile, or fails at it.
    fn bake(&mut self) -> Promise {
        let Some((h, b)) = self.bench() else { return Ok(()) };
        let hand = &mut self.hands[h];
        let bench = &mut hand.benches[b];
        let Some(tile) = bench.todo.pop() else { return Ok(()) };
        let lease = &self.farm.leases[bench.lease];
        let clumsy = matches!(hand.nature, Nature::Clumsy(k) if tile % 3 == k);
        if clumsy || self.poison.contains(&(lease.job, lease.phase, tile)) {
            bench.todo.push(tile);
            match self.farm.dice.roll(3) {
                0 if !clumsy => self.vanish(h),
                1 => hand.silent = true,
                _ => bench.failed = true,
            }
            return Ok(());
        }
        let lie = hand.nature == Nature::Liar && self.farm.dice.once_in(2);
        bench.spool.insert(tile, if lie { Digest([200; 32]) } else { truth(tile) });
        Ok(())
    }

    /// A worker writes: a chunk of what it has, or the end of an attempt.
    fn send(&mut self) -> Promise {
        let Some((h, b)) = self.bench() else { return Ok(()) };
        let (hand, hasty) = (&self.hands[h], self.farm.dice.once_in(25));
        let bench = &hand.benches[b];
        let letter = if !bench.spool.is_empty() && !hasty {
            Letter::Chunk(bench.spool.iter().map(|(tile, digest)| (*tile, *digest)).collect())
        } else if bench.failed {
            Letter::End(Event::Fail)
        } else if hand.leaving {
            Letter::End(if bench.todo.is_empty() { Event::Complete } else { Event::Release })
        } else if bench.todo.is_empty() || hasty {
            Letter::End(if self.farm.dice.once_in(12) { Event::Refuse } else { Event::Complete })
        } else {
            return Ok(());
        };
        if !hand.silent {
            self.mail.push(Mail { from: hand.id, lease: bench.lease, letter });
        }
        Ok(())
    }

    /// Some letter arrives, perhaps for the first time, perhaps nowhere.
    fn arrive(&mut self) -> Promise {
        let Some(m) = self.farm.dice.pick(self.mail.len()) else { return Ok(()) };
        let mail = self.mail[m].clone();
        if !self.farm.dice.once_in(8) {
            self.mail.swap_remove(m);
        }
        if self.farm.dice.once_in(12) {
            return Ok(());
        }
        match mail.letter {
            Letter::Chunk(tiles) => self.chunk(mail.from, mail.lease, &tiles),
            Letter::End(event) => {
                self.farm.finish(mail.lease, event)?;
                self.drop_bench(mail.from, mail.lease);
                Ok(())
            }
        }
    }

    /// A chunk arrives; the coordinator may die over it, and the answer may be lost.
    fn chunk(&mut self, from: WorkerId, lease: usize, tiles: &[(u64, Digest)]) -> Promise {
        let dies = self.farm.dice.once_in(8);
        let heard = match (dies, self.farm.slip) {
            (true, Some(Slip::AckFirst)) => Some(tiles.iter().map(|(tile, _)| *tile).collect()),
            (true, _) => return Ok(()),
            (false, _) => self.farm.deliver(lease, tiles)?,
        };
        if self.farm.dice.once_in(8) {
            return Ok(());
        }
        let Some(safe) = heard else {
            self.drop_bench(from, lease);
            return Ok(());
        };
        let row = &self.farm.leases[lease];
        let bake = &self.farm.jobs[row.job];
        let open = bake.open == Some(row.phase) && row.kind != Kind::Check;
        if let Some(tile) = safe.iter().find(|tile| open && !bake.segments.contains_key(tile)) {
            return Err(format!("a worker heard that tile {tile} is safe, and it is not"));
        }
        for bench in self.hands.iter_mut().filter(|hand| hand.id == from).flat_map(|hand| &mut hand.benches) {
            if bench.lease == lease {
                bench.spool.retain(|tile, _| !safe.contains(tile));
            }
        }
        Ok(())
    }

    fn heartbeat(&mut self) -> Promise {
        let Some((h, b)) = self.bench() else { return Ok(()) };
        let (hand, lease) = (&self.hands[h], self.hands[h].benches[b].lease);
        if hand.silent && !self.farm.dice.once_in(4) {
            return Ok(());
        }
        let id = hand.id;
        self.farm.attempt(lease, Event::Heartbeat { ttl: TTL })?;
        if !matches!(self.farm.leases[lease].state, Attempt::Held { .. }) {
            self.drop_bench(id, lease);
        }
        Ok(())
    }

    fn drop_bench(&mut self, worker: WorkerId, lease: usize) {
        self.hands.iter_mut().filter(|hand| hand.id == worker).for_each(|hand| hand.benches.retain(|bench| bench.lease != lease));
    }

    fn vanish(&mut self, h: usize) {
        let hand = self.hands.swap_remove(h);
        self.farm.connected.remove(&hand.id);
    }

    /// Workers come, go, leave in order and fall silent.
    fn trouble(&mut self) -> Promise {
        let Some(h) = self.farm.dice.pick(self.hands.len()) else {
            self.join(Nature::Honest);
            return Ok(());
        };
        match self.farm.dice.roll(5) {
            0 => self.vanish(h),
            1 => self.hands[h].silent ^= true,
            2 => {
                self.hands[h].leaving = true;
                self.farm.connected.remove(&self.hands[h].id);
            }
            _ if self.hands.len() < 4 => drop(self.join(Nature::Honest)),
            _ => {}
        }
        Ok(())
    }

    /// Somebody pauses, resumes, cancels or tries again.
    fn people(&mut self) -> Promise {
        let j = self.farm.dice.roll(self.farm.jobs.len() as u64) as usize;
        let event = match self.farm.dice.roll(16) {
            0 => job::Event::Cancel,
            1..6 => job::Event::Pause,
            6..12 => job::Event::Resume,
            _ => job::Event::Retry,
        };
        self.farm.happen(j, &event).map(drop)
    }

    /// A coordinator does a task of a job.
    pub(super) fn task(&mut self) -> Promise {
        let j = self.farm.dice.roll(self.farm.jobs.len() as u64) as usize;
        let bake = &mut self.farm.jobs[j];
        let [probe, tiles] = bake.tiles;
        let Some(task) = bake.tasks.pop() else { return Ok(()) };
        let event = match task {
            JobTask::Prepare => job::Event::Prepared { tiles: probe, surfaces: 2 },
            JobTask::Merge(phase) => job::Event::Merged { phase, tiles },
            JobTask::Assemble(_) => job::Event::SurfaceAssembled,
            JobTask::Publish => {
                self.package(j)?;
                job::Event::Published
            }
        };
        if self.farm.happen(j, &event)? { Ok(()) } else { Err(format!("{} came to nothing", event.name())) }
    }

    /// A coordinator restarts, or the bytes of a tile are gone.
    fn misfortune(&mut self) -> Promise {
        if self.farm.dice.once_in(2) || self.farm.lazy {
            let c = self.farm.dice.roll(self.farm.coordinators.len() as u64) as usize;
            self.farm.coordinators[c] = Coordinator::default();
            return Ok(());
        }
        let j = self.farm.dice.roll(self.farm.jobs.len() as u64) as usize;
        let Some(n) = self.farm.dice.pick(self.farm.jobs[j].segments.len()) else { return Ok(()) };
        let Some(tile) = self.farm.jobs[j].segments.keys().nth(n).copied() else { return Ok(()) };
        let needed = !matches!(self.farm.jobs[j].state, Job::Assembling { left: 0, .. });
        let lost = self.farm.lose(j, &[TileIndex(tile)].into_iter().collect())?;
        if lost {
            self.farm.oracle.met.insert("a lost segment");
        }
        if self.farm.jobs[j].open.is_some() && lost != needed {
            return Err(format!("the loss of tile {tile} was noted ({lost}) and needed ({needed})"));
        }
        Ok(())
    }
}
