//! One schedule: a coordinator, some workers and somebody who waits for the job, from a seed to its end and the look into the folder after it.

use super::{
    Promise,
    chaos::{Chaos, LATENCY},
    net::{COORDINATOR, SimulatedCarrier, SimulatedDoor},
    store::InPlace,
    template::{EPOCH, Template, copy, engine, folder},
    witness::Witness,
    worker::{self, Person, light},
};
use crate::{
    engine::{
        Engine,
        tests::{read_all, segment},
    },
    http::{App, HostPolicy, peer::Peer},
    lease::{rule::Rule, simulation::Dice},
    records::JobState,
    store::Store,
};
use kiln_proto::{
    ids::{Digest, JobId},
    tile::TileRun,
    wire::message::Phase,
};
use kiln_worker::client::transport::Carrier;
use std::{
    collections::BTreeSet,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::Duration,
};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;
use turmoil::Sim;

/// How far hosts run before the network moves on.
const TICK: Duration = Duration::from_millis(20);
/// Faults happen this long, ...
const CHAOS: Duration = Duration::from_secs(20);
/// ... and long after it every job has ended and every worker is back at its work: a call may wait a minute for an answer, and so may what
/// it was called for.
const LIMIT: Duration = Duration::from_secs(20 + 180);

/// What a schedule is run with.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Knobs {
    /// Nothing goes wrong.
    pub(super) calm: bool,
    /// A rule of the pure core that is broken.
    pub(super) broken: Option<Rule>,
    /// The coordinator forgets all that it knew when it is started again.
    pub(super) forgetful: bool,
}

/// What came of a schedule.
pub(super) struct Outcome {
    pub(super) trace: Vec<String>,
    /// What went wrong, and when.
    pub(super) faults: Vec<String>,
    pub(super) met: BTreeSet<&'static str>,
    /// Whether each worker baked bytes of its own.
    pub(super) lies: bool,
    /// The files of the package.
    pub(super) promise: Promise<Vec<Vec<u8>>>,
}

/// What every host of a schedule refers to.
struct Farm<'t> {
    template: &'t Template,
    folder: TempDir,
    clock: Arc<AtomicI64>,
    witness: Arc<Witness>,
    workers: Vec<String>,
    knobs: Knobs,
    lies: bool,
    seed: u64,
}

/// Runs a schedule to its end.
pub(super) fn run(template: &Template, seed: u64, knobs: Knobs) -> Outcome {
    let farm = Farm::new(template, seed, knobs);
    let run = || farm.schedule().and_then(|()| farm.look());
    let promise = match knobs.broken {
        Some(rule) => rule.broken(run),
        None => run(),
    };
    let mut seen = farm.witness.seen();
    let (trace, faults, met) = (std::mem::take(&mut seen.trace), std::mem::take(&mut seen.faults), std::mem::take(&mut seen.met));
    Outcome { trace, faults, met, lies: farm.lies, promise }
}

impl<'t> Farm<'t> {
    fn new(template: &'t Template, seed: u64, knobs: Knobs) -> Self {
        let (folder, witness) = (folder(), Arc::default());
        copy(template.folder(), &folder.path().join("data"));
        let mut dice = Dice(seed);
        let workers = (0..3 + dice.roll(3)).map(|k| format!("worker-{k}")).collect();
        let lies = !knobs.calm && dice.once_in(4);
        Self { template, folder, clock: Arc::new(AtomicI64::new(EPOCH)), witness, workers, knobs, lies, seed }
    }

    /// Until the job has ended and everybody is back at work.
    fn schedule(&self) -> Promise<()> {
        let mut dice = Dice(self.seed ^ 0x5eed);
        let mut builder = turmoil::Builder::new();
        builder.rng_seed(dice.roll(u64::MAX)).tick_duration(TICK).simulation_duration(LIMIT * 2).repair_rate(0.0);
        builder.min_message_latency(Duration::from_millis(1)).max_message_latency(LATENCY).enable_random_order();
        let mut sim = builder.build();
        self.coordinator(&mut sim);
        for (at, name) in self.workers.iter().enumerate() {
            self.worker(&mut sim, name, if self.lies { at as u64 + 1 } else { 0 }, &mut dice);
        }
        sim.client("watcher", watch(self.template.job, Arc::clone(&self.witness)));
        let mut chaos = if self.knobs.calm { Chaos::none() } else { Chaos::new(dice, CHAOS) };
        loop {
            chaos.step(&mut sim, &self.workers, &self.witness);
            sim.step().map_err(|error| format!("a host failed: {error}"))?;
            self.clock.store(EPOCH + sim.elapsed().as_millis() as i64, Ordering::SeqCst);
            if self.over(sim.elapsed())? {
                return Ok(());
            }
        }
    }

    /// Whether the job has ended and every worker has asked for work since.
    fn over(&self, now: Duration) -> Promise<bool> {
        let seen = self.witness.seen();
        if let Some(broken) = &seen.broken {
            return Err(broken.clone());
        }
        let late = now > LIMIT;
        match &seen.ended {
            None if late => Err("the job does not end".into()),
            None => Ok(false),
            Some((_, state)) if state != "done" => Err(format!("the job ended {state}")),
            Some((at, _)) => match self.workers.iter().find(|w| seen.polled.get(*w).is_none_or(|polled| polled < at)) {
                Some(worker) if late => Err(format!("{worker} is stuck")),
                stuck => Ok(stuck.is_none()),
            },
        }
    }

    fn coordinator(&self, sim: &mut Sim<'_>) {
        let data = self.folder.path().join("data");
        let (clock, witness, knobs) = (Arc::clone(&self.clock), Arc::clone(&self.witness), self.knobs);
        let (template, job) = (self.template.folder().to_owned(), self.template.job);
        let lives = AtomicI64::new(0);
        sim.host(COORDINATOR, move || {
            if lives.fetch_add(1, Ordering::SeqCst) > 0 && knobs.forgetful {
                copy(&template, &data);
            }
            let (data, clock, witness) = (data.clone(), Arc::clone(&clock), Arc::clone(&witness));
            async move {
                let store = Arc::new(InPlace::open(&data));
                kept(&store, job, &witness).await?;
                let engine = engine(&data, store, clock).await;
                let app = App::new(engine, HostPolicy::Any, None, CancellationToken::new());
                let service = app.router().into_make_service_with_connect_info::<Peer>();
                Ok(axum::serve(SimulatedDoor::open().await?, service).await?)
            }
        });
    }

    fn worker(&self, sim: &mut Sim<'_>, name: &str, lie: u64, dice: &mut Dice) {
        let (spool, witness) = (self.folder.path().join(name), Arc::clone(&self.witness));
        let (seed, pace) = (dice.roll(u64::MAX), [300, 1_000, 3_000][dice.roll(3) as usize]);
        let (lives, name) = (AtomicI64::new(0), name.to_owned());
        sim.host(name.clone(), move || {
            let life = lives.fetch_add(1, Ordering::SeqCst) as u64;
            let (name, spool, witness) = (name.clone(), spool.clone(), Arc::clone(&witness));
            worker::live(Person { name, dice: Dice(seed.wrapping_add(life)), spool, pace, plan: None, lie, witness })
        });
    }

    /// Looks at what is left, with a coordinator that is started once more.
    fn look(&self) -> Promise<Vec<Vec<u8>>> {
        let data = self.folder.path().join("data");
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|e| e.to_string())?;
        runtime.block_on(async {
            let store = Arc::new(InPlace::open(&data));
            kept(&store, self.template.job, &self.witness).await?;
            let engine = engine(&data, store, Arc::clone(&self.clock)).await;
            let record = engine.job(self.template.job).await.map_err(|e| e.to_string())?;
            if record.state != JobState::Done {
                return Err(format!("the job is {:?} after a last crash", record.state));
            }
            let package = package(&engine, self.template.job).await;
            self.compare(&package)?;
            Ok(package)
        })
    }

    /// Every tile has the bytes that were acknowledged, and those of somebody's who bakes them.
    fn compare(&self, package: &[Vec<u8>]) -> Promise<()> {
        let tiles = package[1..].concat();
        let seen = self.witness.seen();
        for (tile, bytes) in (0..).zip(tiles.chunks(segment(Phase::Bake, 0, 0.0).len())) {
            let most = if self.lies { self.workers.len() as u64 } else { 0 };
            if (0..=most).all(|lie| segment(Phase::Bake, tile, light(tile, lie)) != bytes) {
                return Err(format!("tile {tile} of the package was baked by nobody"));
            }
            if seen.accepted.get(&(Phase::Bake, tile)).is_some_and(|(_, digest)| *digest != Digest::of(bytes)) {
                return Err(format!("tile {tile} of the package is not what was accepted"));
            }
        }
        Ok(())
    }
}

/// The store has every tile once at most, and all that workers know to be accepted. When a job has ended, only its package is left.
async fn kept(store: &InPlace, job: JobId, witness: &Witness) -> Promise<()> {
    let mut there = BTreeSet::new();
    for phase in [Phase::Probe, Phase::Bake] {
        let rows = store.chunks(job, phase, TileRun { start: 0, end: u64::from(u32::MAX) }).await.map_err(|e| e.to_string())?;
        for tile in rows.iter().flat_map(|row| row.accepted.iter()) {
            if !there.insert((phase, tile.0)) {
                return Err(format!("the store has {phase:?} {} twice", tile.0));
            }
        }
    }
    let row = store.job(job).await.map_err(|e| e.to_string())?.ok_or("the job is lost")?;
    match witness.seen().accepted.keys().find(|tile| !there.contains(*tile)) {
        Some(_) if row.state.is_final() => Ok(()),
        Some(lost) => Err(format!("{lost:?} was accepted and is lost")),
        None => Ok(()),
    }
}

async fn package(engine: &Engine, job: JobId) -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for path in ["manifest.json", "surfaces/floor.toy", "surfaces/lamp.toy"] {
        files.push(read_all(engine, job, path).await);
    }
    files
}

/// Somebody who asks after the job until it is done. Where bad luck looked like a tile that kills whoever bakes it, they have it tried again.
async fn watch(job: JobId, witness: Arc<Witness>) -> turmoil::Result {
    let carrier = SimulatedCarrier::new("watcher", Arc::clone(&witness));
    let url = format!("http://{COORDINATOR}/v1/jobs/{job}");
    let ask = |method, url: String| {
        let mut request = reqwest::Request::new(method, url.parse().unwrap());
        *request.timeout_mut() = Some(Duration::from_secs(5));
        carrier.carry(request)
    };
    loop {
        tokio::time::sleep(Duration::from_millis(500)).await;
        let Ok(answer) = ask(reqwest::Method::GET, url.clone()).await else { continue };
        let record: serde_json::Value = answer.json().await?;
        match record["state"].as_str() {
            Some("failed") => {
                witness.meet("a job that is tried again");
                drop(ask(reqwest::Method::POST, format!("{url}/retry")).await);
            }
            Some(state @ ("done" | "cancelled")) => {
                witness.end(state);
                return Ok(());
            }
            _ => {}
        }
    }
}
