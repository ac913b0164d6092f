//! The engine with a worker that bakes nothing: real import, real plan, real store, real blobs; segments of a few bytes.

mod chunks;
mod crash;
mod faults;
mod flow;
mod holes;
mod live;
mod lost;
mod notices;
pub(crate) mod real;
mod retention;
mod shares;

use super::{
    Engine, EngineError, JobFilter, Parts, UploadedFile, background,
    ports::{Kiln, Pipeline, PipelineError, Segments},
};
use crate::{
    auth::{Principal, Scope},
    blob::{BlobError, BlobList, BlobName, Blobs, ByteStream, LocalBlobs},
    config::Config,
    import::Imported,
    job::OnPoison,
    records::{JobRecord, JobState, NewJob, Problem, SceneRecord, SceneState},
};
use bytes::Bytes;
use futures_util::TryStreamExt;
use kiln_proto::{
    BAKE_VERSION,
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    options::ImportOptions,
    plan::Plan,
    probe::ProbeSums,
    scene::Scene,
    settings::{BakeSettings, SettingsPatch},
    tile::TileIndex,
    wire::{
        frame::to_frame,
        message::{
            ChunkEntry, ChunkTrailer, ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Phase, Refusal,
            Verdict,
        },
    },
};
use std::{
    collections::BTreeMap,
    io::Write,
    ops::Range,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicI64, Ordering},
    },
    time::{Duration, SystemTime},
};
use tempfile::TempDir;

/// A floor and a lamp.
pub(crate) const OBJ: &str = "mtllib r.mtl
v 0 0 0
v 4 0 0
v 4 0 -4
v 0 0 -4
v 1 2 -1
v 1 2 -3
v 3 2 -3
v 3 2 -1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
o floor
usemtl grey
f 1/1 2/2 3/3 4/4
o lamp
usemtl light
f 5/1 6/2 7/3 8/4
";
pub(crate) const MTL: &str = "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl light\nKd 0 0 0\nKe 5 5 5\n";

/// The segment of a tile: 12 bytes that name it, and one number that stands for light.
pub(crate) fn segment(phase: Phase, tile: u64, light: f32) -> Vec<u8> {
    let mut bytes = format!("{:<4}", if phase == Phase::Probe { "PRB" } else { "BAK" }).into_bytes();
    bytes.extend(tile.to_le_bytes());
    bytes.extend(light.to_le_bytes());
    bytes
}

/// Real import and plan; segments as above; a package that is the segments one after another.
pub(crate) struct Toy;

impl Pipeline for Toy {
    fn import(&self, files: Vec<(String, PathBuf)>, options: &ImportOptions, scratch: &Path) -> Result<Imported, Vec<Problem>> {
        Kiln.import(files, options, scratch)
    }
    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
        Kiln.plan(scene, hash, settings)
    }
    fn check(&self, bytes: &[u8], _: &Plan, phase: Phase, tile: TileIndex) -> Result<(), Problem> {
        let bad = |message: &str| Problem::new(message);
        let light = bytes.last_chunk::<4>().map(|b| f32::from_le_bytes(*b)).ok_or_else(|| bad("too short"))?;
        if !light.is_finite() {
            return Err(bad("not finite"));
        }
        if bytes == segment(phase, tile.0, light) { Ok(()) } else { Err(bad("another tile's data")) }
    }
    fn lean(&self, bytes: Vec<u8>) -> Result<Vec<u8>, Problem> {
        Ok(bytes)
    }
    fn probe(&self, _: &[u8], plan: &Plan, _: TileIndex) -> Result<ProbeSums, Problem> {
        let mut sums = ProbeSums::new(plan.surfaces.len());
        sums.count(0.25);
        Ok(sums)
    }
    fn assemble(
        &self,
        plan: &Plan,
        scene: &Scene,
        surface: usize,
        holes: &BTreeMap<TileIndex, String>,
        segments: &dyn Segments,
        dir: &Path,
    ) -> Result<serde_json::Value, PipelineError> {
        let first = plan.first_tile(surface).0;
        let tiles = first..first + plan.surfaces[surface].tiles.len() as u64;
        let bytes = tiles
            .filter(|t| !holes.contains_key(&TileIndex(*t)))
            .map(|t| segments.segment(TileIndex(t)))
            .collect::<Result<Vec<_>, _>>()?
            .concat();
        std::fs::create_dir_all(dir.join("surfaces")).unwrap();
        std::fs::write(dir.join(format!("surfaces/{}.toy", scene.surfaces[surface].name)), bytes).unwrap();
        let holes: Vec<_> = holes.iter().map(|(t, reason)| serde_json::json!({ "tile": t.0 - first, "reason": reason })).collect();
        Ok(serde_json::json!({ "surface": surface, "holes": holes }))
    }
    fn manifest(&self, plan: &Plan, _: &Scene, surfaces: &[serde_json::Value], dir: &Path) -> Result<(), PipelineError> {
        let exposure = plan.probe.as_ref().unwrap().exposure.eighths;
        std::fs::write(dir.join("manifest.json"), serde_json::json!({ "surfaces": surfaces, "exposure": exposure }).to_string()).unwrap();
        Ok(())
    }
}

/// Blobs on a disk that can be filled up by a switch.
struct Disk {
    real: LocalBlobs,
    full: Arc<AtomicBool>,
    full_after_next: Arc<AtomicBool>,
}

impl Disk {
    fn room(&self) -> Result<(), BlobError> {
        if self.full.load(Ordering::SeqCst) { Err(BlobError::Full("a blob".into())) } else { Ok(()) }
    }
}

#[async_trait::async_trait]
impl Blobs for Disk {
    async fn put_file(&self, name: BlobName, file: tempfile::TempPath) -> Result<(), BlobError> {
        self.room()?;
        self.full.store(self.full_after_next.load(Ordering::SeqCst), Ordering::SeqCst);
        self.real.put_file(name, file).await
    }
    async fn put(&self, bytes: Bytes) -> Result<BlobName, BlobError> {
        self.room()?;
        self.real.put(bytes).await
    }
    async fn read(&self, name: BlobName, range: Option<Range<u64>>) -> Result<(u64, ByteStream), BlobError> {
        self.real.read(name, range).await
    }
    async fn delete(&self, name: BlobName) -> Result<(), BlobError> {
        self.real.delete(name).await
    }
    fn list(&self) -> BlobList {
        self.real.list()
    }
    async fn written(&self, name: BlobName) -> Result<Option<SystemTime>, BlobError> {
        self.real.written(name).await
    }
}

/// A data folder, a clock and a disk that survive the engines opened on them.
struct Rig {
    dir: TempDir,
    clock: Arc<AtomicI64>,
    full: Arc<AtomicBool>,
    /// The next file fills the disk.
    full_after_next: Arc<AtomicBool>,
    /// What the configuration says beside the folder.
    base: Config,
}

impl Rig {
    fn new() -> Self {
        Self {
            dir: tempfile::tempdir().unwrap(),
            clock: Arc::new(AtomicI64::new(1_000_000)),
            full: Arc::default(),
            full_after_next: Arc::default(),
            base: Config::default(),
        }
    }

    fn config(&self) -> Config {
        Config { data_dir: self.dir.path().join("data"), reserve_bytes: 0, ..self.base.clone() }
    }

    async fn open(&self) -> Arc<Engine> {
        self.open_as(self.config()).await
    }

    async fn open_as(&self, config: Config) -> Arc<Engine> {
        let local = Parts::of(&config).await;
        let parts = match local {
            Ok(parts) => parts,
            Err(_) => {
                std::fs::create_dir_all(&config.data_dir).unwrap();
                Parts::of(&config).await.unwrap()
            }
        };
        let (clock, data) = (Arc::clone(&self.clock), &config.data_dir);
        let real = LocalBlobs::open(&data.join("blobs"), &data.join("staging")).unwrap();
        let parts = Parts {
            blobs: Arc::new(Disk { real, full: Arc::clone(&self.full), full_after_next: Arc::clone(&self.full_after_next) }),
            pipeline: Arc::new(Toy),
            clock: Arc::new(move || clock.load(Ordering::SeqCst)),
            ..parts
        };
        Engine::open_with(config, parts).await.unwrap()
    }

    /// Time passes, and the engine looks at the clock.
    async fn pass(&self, engine: &Engine, ms: i64) {
        self.clock.fetch_add(ms, Ordering::SeqCst);
        background::expire(&engine.core).await;
    }
}

async fn upload(engine: &Engine, files: &[(&str, &str)]) -> SceneRecord {
    let spool = |(name, text): &(&str, &str)| {
        let mut file = engine.spool().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        UploadedFile { name: (*name).into(), path: file.into_temp_path().keep().unwrap() }
    };
    engine.add_scene(files.iter().map(spool).collect(), ImportOptions::default(), None).await.unwrap()
}

pub(crate) async fn ready_scene(engine: &Engine) -> SceneRecord {
    let record = upload(engine, &[("room/r.obj", OBJ), ("room/r.mtl", MTL)]).await;
    let record = engine.wait_for_scene(record.id, Duration::from_secs(30)).await.unwrap();
    assert_eq!(record.state, SceneState::Ready, "{:?}", record.problems);
    record
}

/// A job of 20 tiles on the floor and 5 on the lamp, at 40 texels a metre.
pub(crate) fn new_job(scene: &SceneRecord) -> NewJob {
    let settings = SettingsPatch { texels_per_metre: Some(40.0), ..SettingsPatch::default() };
    let labels = [("who".to_owned(), "test".to_owned())].into();
    NewJob { scene: scene.id.to_string(), settings, labels, ..NewJob::default() }
}

/// A worker that has said hello.
struct Worker {
    engine: Arc<Engine>,
    id: WorkerId,
}

impl Worker {
    async fn join(engine: &Arc<Engine>, name: &str) -> Self {
        let hello = Hello { bake_version: BAKE_VERSION, name: name.into(), threads: 2, features: vec![] };
        Self { engine: Arc::clone(engine), id: engine.hello(&hello).await.unwrap().worker }
    }

    /// Waits as long as it takes for preparing or merging, which are quick.
    async fn lease(&self) -> LeaseGrant {
        self.lease_within(20_000).await.expect("work within 20 seconds")
    }

    async fn lease_within(&self, wait_ms: u64) -> Option<LeaseGrant> {
        self.engine.lease(&LeaseRequest { worker: self.id, wait_ms }).await.unwrap()
    }

    async fn put(&self, token: Token, n: u64, bytes: &[u8]) -> Result<ChunkVerdict, Refusal> {
        let mut file = self.engine.spool().unwrap();
        file.write_all(bytes).unwrap();
        self.engine.chunk(token, n, file.into_temp_path()).await
    }

    async fn bake(&self, grant: &LeaseGrant) {
        let tiles: Vec<u64> = (grant.tiles.start..grant.tiles.end).collect();
        let verdict = self.put(grant.token, 0, &chunk(grant.phase, &tiles)).await.unwrap();
        assert!(verdict.tiles.iter().all(|(_, v)| *v == Verdict::Accepted), "{verdict:?}");
        self.engine.complete(grant.token, &finish()).await.unwrap();
    }

    /// Bakes everything that there is until the job has ended.
    async fn see_through(&self, job: JobId) -> JobRecord {
        loop {
            let record = self.engine.job(job).await.unwrap();
            if record.state.is_final() {
                return record;
            }
            if let Some(grant) = self.lease_within(20).await {
                self.bake(&grant).await;
            }
        }
    }
}

fn finish() -> Finish {
    Finish { core_seconds: 1.5, rays: 1_000, peak_rss_bytes: 50 << 20, failure: None }
}

/// A chunk of the given plain segments.
fn pack(segments: &[(u64, Vec<u8>)]) -> Vec<u8> {
    let (mut bytes, mut entries) = (Vec::new(), Vec::new());
    for (tile, plain) in segments {
        let packed = zstd::bulk::compress(plain, 1).unwrap();
        entries.push(ChunkEntry {
            tile: TileIndex(*tile),
            offset: bytes.len() as u64,
            length: packed.len() as u64,
            plain_length: plain.len() as u64,
            digest: Digest::of(plain),
        });
        bytes.extend(packed);
    }
    with_trailer(bytes, entries)
}

fn with_trailer(mut bytes: Vec<u8>, entries: Vec<ChunkEntry>) -> Vec<u8> {
    let frame = to_frame(&ChunkTrailer { entries }).unwrap();
    bytes.extend(&frame);
    bytes.extend((frame.len() as u32).to_le_bytes());
    bytes
}

/// A good chunk of some tiles.
fn chunk(phase: Phase, tiles: &[u64]) -> Vec<u8> {
    pack(&tiles.iter().map(|t| (*t, segment(phase, *t, 0.5))).collect::<Vec<_>>())
}

pub(crate) async fn read_all(engine: &Engine, job: JobId, path: &str) -> Vec<u8> {
    let download = engine.read_package_file(job, path, None).await.unwrap();
    download
        .stream
        .try_fold(vec![], |mut all, part| async move {
            all.extend_from_slice(&part);
            Ok(all)
        })
        .await
        .unwrap()
}

/// Waits for a state that the engine reaches by itself.
pub(crate) async fn until(engine: &Engine, job: JobId, wanted: JobState) -> JobRecord {
    let mut seen = 0;
    loop {
        let record = engine.job(job).await.unwrap();
        if record.state == wanted {
            return record;
        }
        assert!(!record.state.is_final(), "ended {:?}: {:?}", record.state, record.problem);
        engine.wait_for_events(job, seen).await;
        seen = engine.events(job, seen, 10_000).await.unwrap().events.last().map_or(seen, |e| e.seq);
    }
}
