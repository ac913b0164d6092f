//! A job from upload to package, all of it over HTTP: this test is the client and the worker. Segments are a few bytes that name their
//! tile.

use super::*;
use crate::{
    engine::{
        Parts,
        ports::{Kiln, Pipeline, PipelineError, Segments},
    },
    http::worker_protocol::FRAME,
    import::Imported,
    records::Problem,
};
use kiln_proto::{
    BAKE_VERSION,
    ids::{Digest, SceneHash, WorkerId},
    options::ImportOptions,
    plan::Plan,
    probe::ProbeSums,
    scene::Scene,
    settings::BakeSettings,
    tile::TileIndex,
    wire::{
        frame::{Message, from_frame, to_frame},
        message::{
            ChunkEntry, ChunkTrailer, ChunkVerdict, Finish, Heartbeat, HeartbeatReply, Hello, LeaseGrant, LeaseRequest, Phase, Welcome,
        },
    },
};
use std::{collections::BTreeMap, io::Read, path::PathBuf};

/// Real import and plan; a package of the segments one after another.
struct Names;

fn segment(tile: TileIndex) -> Vec<u8> {
    format!("tile {tile};").into_bytes()
}

impl Pipeline for Names {
    fn import(&self, files: Vec<(String, PathBuf)>, options: &ImportOptions, scratch: &Path) -> Result<Imported, Vec<Problem>> {
        Kiln.import(files, options, scratch)
    }
    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
        Kiln.plan(scene, hash, settings)
    }
    fn check(&self, bytes: &[u8], _: &Plan, _: Phase, tile: TileIndex) -> Result<(), Problem> {
        let wrong = Problem::new("another tile's data");
        if bytes == segment(tile) { Ok(()) } else { Err(wrong) }
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
        _: &Scene,
        surface: usize,
        _: &BTreeMap<TileIndex, String>,
        segments: &dyn Segments,
        dir: &Path,
    ) -> Result<Value, PipelineError> {
        let first = plan.first_tile(surface).0;
        let tiles = first..first + plan.surfaces[surface].tiles.len() as u64;
        let bytes = tiles.map(|tile| segments.segment(TileIndex(tile))).collect::<Result<Vec<_>, _>>()?.concat();
        std::fs::create_dir_all(dir).unwrap();
        std::fs::write(dir.join("floor.names"), bytes).unwrap();
        Ok(serde_json::json!({ "surface": surface }))
    }
    fn manifest(&self, _: &Plan, _: &Scene, _: &[Value], dir: &Path) -> Result<(), PipelineError> {
        std::fs::write(dir.join("manifest.json"), "{}").unwrap();
        Ok(())
    }
}

/// A chunk of a lease's tiles.
fn chunk(grant: &LeaseGrant) -> Vec<u8> {
    let (mut bytes, mut entries) = (Vec::new(), Vec::new());
    for tile in (grant.tiles.start..grant.tiles.end).map(TileIndex) {
        let plain = segment(tile);
        let packed = zstd::bulk::compress(&plain, 1).unwrap();
        let (offset, length, plain_length) = (bytes.len() as u64, packed.len() as u64, plain.len() as u64);
        entries.push(ChunkEntry { tile, offset, length, plain_length, digest: Digest::of(&plain) });
        bytes.extend(packed);
    }
    let trailer = to_frame(&ChunkTrailer { entries }).unwrap();
    bytes.extend(&trailer);
    bytes.extend((trailer.len() as u32).to_le_bytes());
    bytes
}

impl Bench {
    async fn call(&self, path: &str, message: &impl Message) -> Reply {
        let body = to_frame(message).unwrap();
        self.send(Request::post(path).header(header::CONTENT_TYPE, FRAME).body(body.into()).unwrap()).await
    }

    /// Does everything that there is to do until the job is done.
    async fn bake(&self, worker: WorkerId, job: &str) {
        let mut record = Value::Null;
        for _ in 0..1_000 {
            record = self.get(job).await.json();
            if record["state"] == "done" {
                return;
            }
            assert_eq!(record["problem"], Value::Null);
            let reply = self.call("/v1/worker/leases", &LeaseRequest { worker, wait_ms: 20 }).await;
            if reply.status == StatusCode::NO_CONTENT {
                continue;
            }
            let grant: LeaseGrant = from_frame(&reply.body).unwrap();
            let scene = self.get(&format!("/v1/worker/scenes/{}", grant.scene)).await;
            assert_eq!(SceneHash::of(&zstd::stream::decode_all(&*scene.body).unwrap()), grant.scene);
            let plan = self.get(&format!("/v1/worker/plans/{}", grant.plan)).await;
            assert_eq!(Digest::of(&zstd::stream::decode_all(&*plan.body).unwrap()), grant.plan);
            let attempt = format!("/v1/worker/attempts/{}", grant.token);
            let beat = self.call(&format!("{attempt}/heartbeat"), &Heartbeat { texels_done: 1, rays: 10 }).await;
            assert_eq!(from_frame::<HeartbeatReply>(&beat.body).unwrap(), HeartbeatReply::Continue);
            let reply = self.send(Request::put(format!("{attempt}/chunks/0")).body(chunk(&grant).into()).unwrap()).await;
            let verdict: ChunkVerdict = from_frame(&reply.body).unwrap();
            assert_eq!(verdict.tiles.len() as u64, grant.tiles.len());
            if grant.phase == Phase::Bake {
                self.shows_live(job, grant.tiles.start).await;
            }
            let finish = Finish { core_seconds: 1.0, rays: 20, peak_rss_bytes: 1, failure: None };
            assert_eq!(self.call(&format!("{attempt}/complete"), &finish).await.status, StatusCode::NO_CONTENT);
        }
        panic!("the job does not end: {record}");
    }

    /// A tile that was just accepted can be looked at.
    async fn shows_live(&self, job: &str, tile: u64) {
        let reply = self.get(&format!("{job}/segments?runs={tile}&max_bytes=1")).await;
        assert_eq!(reply.headers[header::CONTENT_TYPE], "application/vnd.kiln.segments");
        assert_eq!(reply.headers[header::CACHE_CONTROL], "no-store");
        let plain = segment(TileIndex(tile));
        let expected = [&tile.to_le_bytes()[..], &(plain.len() as u32).to_le_bytes(), &plain].concat();
        assert_eq!(&reply.body[..], expected);
        for (query, field) in
            [("", "runs"), ("?runs=x", "runs"), ("?runs=0&max_bytes=0", "max_bytes"), ("?runs=0&max_bytes=67108865", "max_bytes")]
        {
            let (status, kind, detail) = self.get(&format!("{job}/segments{query}")).await.problem();
            assert!((status, kind.as_str()) == (400, "invalid-request") && detail.contains(field), "{query}: {detail}");
        }
    }

    async fn get_with(&self, path: &str, name: header::HeaderName, value: &str) -> Reply {
        self.send(Request::get(path).header(name, value).body(Body::empty()).unwrap()).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scene_becomes_a_package_over_http() {
    let folder = TempDir::new().unwrap();
    let config = config(&folder);
    std::fs::create_dir_all(&config.data_dir).unwrap();
    let parts = Parts { pipeline: Arc::new(Names), ..Parts::of(&config).await.unwrap() };
    let bench = Bench::over(Engine::open_with(config, parts).await.unwrap(), folder);
    let hello = Hello { bake_version: BAKE_VERSION, name: "test".into(), threads: 1, features: vec![] };
    let welcome: Welcome = from_frame(&bench.call("/v1/worker/hello", &hello).await.body).unwrap();
    let job = format!("/v1/jobs/{}", bench.job().await);
    bench.bake(welcome.worker, &job).await;

    let tiles = bench.get(&format!("{job}/tiles")).await.json();
    let count = tiles["tiles_done"].as_u64().unwrap();
    assert_eq!((&tiles["phase"], &tiles["runs"]), (&"bake".into(), &serde_json::json!([{"start": 0, "end": count}])));
    let expected: Vec<u8> = (0..count).flat_map(|tile| segment(TileIndex(tile))).collect();
    files_come_whole_and_in_parts(&bench, &job, &expected).await;
    archives_hold_the_package(&bench, &job, &expected).await;
    scene_and_plan_come_with_a_tag(&bench, &job).await;
    assert_eq!(bench.get(&format!("{job}/segments?runs=0-99")).await.body, "");
    let worked = bench.get("/v1/workers").await.json()["workers"][0].clone();
    assert!(worked["rays_per_second"].as_f64().unwrap() > 0.0 && worked["texels_per_second"].as_f64().unwrap() > 0.0, "{worked}");
    let throughput = bench.get("/v1/throughput").await.json();
    let sum = |field: &str| throughput["points"].as_array().unwrap().iter().map(|point| point[field].as_u64().unwrap()).sum::<u64>();
    assert!(throughput["interval_ms"] == 5_000 && sum("rays") >= 20 && sum("tiles") > count && sum("texels") > 0, "{throughput}");
    let figures = String::from_utf8(bench.get("/metrics").await.body.to_vec()).unwrap();
    assert!(figures.contains("kiln_jobs{state=\"done\"} 1") && !figures.contains("kiln_rays_total 0"), "{figures}");
    assert_eq!(bench.get(&format!("{job}/assets/none.such")).await.problem().1, "unknown-asset");
    assert_eq!(bench.get(&format!("{job}/assets/../kiln.db")).await.status, StatusCode::NOT_FOUND);
}

async fn files_come_whole_and_in_parts(bench: &Bench, job: &str, expected: &[u8]) {
    assert_eq!(bench.get(&format!("{job}/assets")).await.body, "{}");
    let path = format!("{job}/assets/floor.names");
    let whole = bench.get(&path).await;
    assert_eq!((whole.status, &whole.body[..]), (StatusCode::OK, expected));
    let etag = whole.headers[header::ETAG].to_str().unwrap();
    let part = bench.get_with(&path, header::RANGE, "bytes=5-6").await;
    assert_eq!((part.status, &part.body[..]), (StatusCode::PARTIAL_CONTENT, &expected[5..7]));
    let tail = bench.get_with(&path, header::RANGE, "bytes=-3").await;
    assert_eq!(&tail.body[..], &expected[expected.len() - 3..]);
    assert_eq!(bench.get_with(&path, header::RANGE, "bytes=99999999-").await.problem().0, 416);
    let held = bench.get_with(&path, header::IF_NONE_MATCH, etag).await;
    assert_eq!((held.status, held.body.len()), (StatusCode::NOT_MODIFIED, 0));
    let head = bench.send(Request::head(&path).body(Body::empty()).unwrap()).await;
    assert_eq!((head.headers[header::CONTENT_LENGTH].to_str().unwrap(), head.body.len()), (expected.len().to_string().as_str(), 0));
}

async fn scene_and_plan_come_with_a_tag(bench: &Bench, job: &str) {
    let path = format!("{job}/scene.kiln");
    let whole = bench.get(&path).await;
    let (scene, plan) = kiln_proto::format::container::parse(&whole.body).unwrap();
    assert!(scene.surfaces[0].name == "floor" && plan.probe.is_some());
    assert_eq!(whole.headers[header::CACHE_CONTROL], "no-cache");
    let etag = whole.headers[header::ETAG].to_str().unwrap();
    let held = bench.get_with(&path, header::IF_NONE_MATCH, etag).await;
    assert_eq!((held.status, held.body.len()), (StatusCode::NOT_MODIFIED, 0));
    assert_eq!(bench.get_with(&path, header::IF_MATCH, "\"other\"").await.problem().1, "precondition-failed");
}

async fn archives_hold_the_package(bench: &Bench, job: &str, expected: &[u8]) {
    let zipped = bench.get(&format!("{job}/bundle.zip")).await;
    assert_eq!(zipped.headers[header::CONTENT_TYPE], "application/zip");
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(zipped.body)).unwrap();
    let mut found = Vec::new();
    archive.by_name("floor.names").unwrap().read_to_end(&mut found).unwrap();
    assert_eq!(found, expected);
    let tarred = bench.get(&format!("{job}/bundle.tar.zst")).await;
    let mut archive = tar::Archive::new(zstd::stream::Decoder::new(&*tarred.body).unwrap());
    let names: Vec<String> = archive.entries().unwrap().map(|entry| entry.unwrap().path().unwrap().display().to_string()).collect();
    assert_eq!(names, ["floor.names", "manifest.json", "report.json"]);
}
