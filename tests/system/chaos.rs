//! Everything fails all the time: coordinators, workers and the database are killed, workers stand still beyond their leases, the bucket errs.
//! Nothing that was accepted is lost, little is baked twice, and every package is the one that an undisturbed machine bakes.
//!
//! A short storm in `make test`; a long one with the numbers of a farm in `make soak` (`KILN_SOAK=1`). What happens next follows from a counter
//! and not from dice: when a process dies in its work differs from run to run anyway.

use crate::{
    cluster::{Balancer, coordinator},
    fault_proxy::FaultProxy,
    harness::{PATIENCE, Process, Server, assert_same_package, bake_room, kiln, nominal, quick, room, runtime, succeed},
    object_storage::one_in_twenty,
    servers::S3,
};
use kiln_test_servers::Postgres;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    path::Path,
    process::Stdio,
    thread::sleep,
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// How long a lease lives without heartbeats in these tests (see [`coordinator`]).
const LEASE: Duration = Duration::from_secs(3);

/// A storm.
struct Storm {
    coordinators: usize,
    workers: usize,
    /// Between one fault and the next.
    every: Duration,
    /// Immediate stops of the database before it may end.
    stops: usize,
    samples: &'static str,
}

impl Storm {
    fn of_today() -> Self {
        if std::env::var_os("KILN_SOAK").is_some() {
            return Self { coordinators: 3, workers: 20, every: Duration::from_secs(5), stops: 50, samples: "1024" };
        }
        Self { coordinators: 2, workers: 4, every: Duration::from_millis(1_500), stops: 2, samples: "192" }
    }

    fn flags(&self) -> [&'static str; 2] {
        ["--samples", self.samples]
    }
}

/// Segments by what became of them, over all coordinators that ever were, as far as they were asked before they died.
#[derive(Default)]
struct Tally {
    accepted: u64,
    duplicate: u64,
    conflicting: u64,
}

struct Farm<'d> {
    dir: &'d Path,
    database: Postgres,
    store: String,
    bucket: FaultProxy,
    coordinators: Vec<Server>,
    balancer: Balancer,
    workers: Vec<Process>,
    /// A worker that stands still, and until when.
    frozen: Option<(usize, Instant)>,
    tally: Tally,
    /// Coordinators, workers and databases started so far, for names.
    started: usize,
    stops: usize,
    /// Seconds from a fault to the next tile that was accepted.
    recoveries: Vec<f64>,
    _s3: S3,
}

impl<'d> Farm<'d> {
    fn start(dir: &'d Path, storm: &Storm) -> Self {
        let (database, s3) = (Postgres::start(), S3::start());
        let bucket = FaultProxy::http(s3.address, one_in_twenty);
        let store = database.database();
        let begin = |n: usize| coordinator(dir, &format!("coordinator{n}"), &store, &bucket.url());
        let coordinators: Vec<Server> = (0..storm.coordinators).map(begin).collect();
        let balancer = Balancer::before(coordinators.iter().map(|c| c.port).collect());
        let started = storm.coordinators;
        let mut farm = Self {
            dir,
            database,
            store,
            bucket,
            coordinators,
            balancer,
            workers: vec![],
            frozen: None,
            tally: Tally::default(),
            started,
            stops: 0,
            recoveries: vec![],
            _s3: s3,
        };
        farm.workers = (0..storm.workers).map(|n| farm.worker(n)).collect();
        farm
    }

    /// Each place has a spool of its own: who takes it after a death delivers what lies there.
    fn worker(&self, place: usize) -> Process {
        let spool = self.dir.join(format!("spool{place}"));
        let mut command = kiln(["work", "--threads", "1", "--join", &self.balancer.url(), "--spool"]);
        Process(command.arg(spool).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap())
    }

    fn submit(&self, storm: &Storm) -> String {
        let mut args: Vec<String> = ["--json", "submit", "--server", &self.balancer.url()].map(str::to_owned).to_vec();
        args.push(room().display().to_string());
        args.extend(nominal());
        args.extend(quick(&storm.flags()));
        let said: Value = serde_json::from_str(&succeed(args)).unwrap();
        said["id"].as_str().unwrap().to_owned()
    }

    /// What any coordinator says of a job; nothing while none can.
    fn record(&self, job: &str) -> Option<Value> {
        let url = format!("{}/v1/jobs/{job}", self.balancer.url());
        let client = reqwest::Client::builder().no_proxy().timeout(Duration::from_secs(5)).build().unwrap();
        runtime().block_on(async { client.get(url).send().await.ok()?.error_for_status().ok()?.json().await.ok() })
    }

    /// The n-th fault.
    fn strike(&mut self, n: usize) {
        match n % 4 {
            0 => self.replace_coordinator(n / 4),
            1 => {
                let place = (n / 4) % self.workers.len();
                self.workers[place].kill();
                self.workers[place] = self.worker(place);
            }
            2 => self.stop_database(),
            _ => self.freeze(n / 4 + 1),
        }
    }

    fn replace_coordinator(&mut self, n: usize) {
        let place = n % self.coordinators.len();
        self.count(place);
        self.coordinators[place].process.kill();
        let name = format!("coordinator{}", self.started);
        self.started += 1;
        self.coordinators[place] = coordinator(self.dir, &name, &self.store, &self.bucket.url());
        self.balancer.moved(place, self.coordinators[place].port);
    }

    fn stop_database(&mut self) {
        self.database.stop_immediately();
        self.stops += 1;
        sleep(Duration::from_millis(500));
        self.database.run();
    }

    /// A worker stands still until its lease has been over for long.
    fn freeze(&mut self, n: usize) {
        if self.frozen.is_none() {
            let place = n % self.workers.len();
            kill_process(Pid::from_child(&self.workers[place].0), Signal::STOP).unwrap();
            self.frozen = Some((place, Instant::now() + 2 * LEASE));
        }
    }

    fn thaw(&mut self) {
        if let Some((place, _)) = self.frozen.take_if(|(_, until)| *until <= Instant::now()) {
            // It may have been killed meanwhile, and this is its heir, which does not mind.
            kill_process(Pid::from_child(&self.workers[place].0), Signal::CONT).unwrap();
        }
    }

    /// Takes in what a coordinator has counted.
    fn count(&mut self, place: usize) {
        let url = format!("{}/metrics", self.coordinators[place].url);
        let text = runtime().block_on(async { reqwest::get(url).await.ok()?.text().await.ok() }).unwrap_or_default();
        let figures: BTreeMap<&str, u64> =
            text.lines().filter_map(|l| l.split_once(' ')).filter_map(|(k, v)| Some((k, v.parse().ok()?))).collect();
        let of = |name: &str| figures.get(format!("kiln_tiles_{name}_total").as_str()).copied().unwrap_or(0);
        self.tally.accepted += of("accepted");
        self.tally.duplicate += of("duplicate");
        self.tally.conflicting += of("conflicting");
    }

    /// Strikes until the job is done; tiles that were accepted stay so.
    fn weather(&mut self, job: &str, storm: &Storm, faults: &mut usize) {
        let (mut last, mut next, mut struck) = ((String::new(), 0), Instant::now() + storm.every, None);
        let mut heard = Instant::now();
        loop {
            self.thaw();
            if let Some(record) = self.record(job) {
                heard = Instant::now();
                assert!(record["state"] != "failed" && record["state"] != "cancelled", "{record}");
                if record["state"] == "done" {
                    return;
                }
                let now = (record["phase"].as_str().unwrap_or_default().to_owned(), record["progress"]["tiles_done"].as_u64().unwrap());
                assert!(now.0 != last.0 || now.1 >= last.1, "accepted tiles were lost: {} of {}", now.1, last.1);
                if now.1 > last.1 {
                    self.recoveries.extend(struck.take().map(|at: Instant| at.elapsed().as_secs_f64()));
                }
                last = now;
            }
            assert!(heard.elapsed() < PATIENCE, "no coordinator answers any more");
            if Instant::now() >= next {
                self.strike(*faults);
                *faults += 1;
                struck.get_or_insert(Instant::now());
                next = Instant::now() + storm.every;
            }
            sleep(Duration::from_millis(100));
        }
    }
}

#[test]
fn a_storm_changes_no_byte() {
    let (dir, storm) = (TempDir::new().unwrap(), Storm::of_today());
    let expected = dir.path().join("undisturbed");
    bake_room(&expected, &storm.flags());
    let mut farm = Farm::start(dir.path(), &storm);
    let (mut faults, mut jobs) = (0, 0);
    while jobs == 0 || farm.stops < storm.stops {
        let job = farm.submit(&storm);
        farm.weather(&job, &storm, &mut faults);
        let package = dir.path().join(format!("package{jobs}"));
        succeed(["fetch", &job, "--server", &farm.balancer.url(), "-o", package.to_str().unwrap()]);
        assert_same_package(&expected, &package);
        jobs += 1;
    }
    (0..storm.coordinators).for_each(|place| farm.count(place));
    let Tally { accepted, duplicate, conflicting } = farm.tally;
    farm.recoveries.sort_by(f64::total_cmp);
    let slowest = farm.recoveries.last().copied().unwrap_or(0.0);
    println!(
        "{{\"jobs\": {jobs}, \"faults\": {faults}, \"database_stops\": {}, \"s3_faults\": {}, \"accepted\": {accepted}, \"duplicate\": {duplicate}, \
         \"slowest_recovery_s\": {slowest:.1}, \"lease_s\": {}}}",
        farm.stops,
        farm.bucket.faults(),
        LEASE.as_secs(),
    );
    assert_eq!(conflicting, 0, "two workers disagreed");
    assert!(duplicate * 10 <= accepted, "{duplicate} of {accepted} tiles were baked twice");
}
