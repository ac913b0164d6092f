//! The real pipeline end to end: real import, plan, segment checks and assembly. Only the light is invented: every texel is grey, byte 90.

use super::*;
use kiln_proto::{
    codec::pwl::{ErrorStats, Kept},
    probe::ProbeSums,
    segment::{ProbeSegment, Raw, Rows, Segment, TexelMask, TileSegment},
    texel::SurfaceRaster,
    tile::TileRuns,
};

struct Studio {
    plan: Plan,
    rasters: Vec<SurfaceRaster>,
}

impl Studio {
    async fn new(engine: &Engine, grant: &LeaseGrant) -> Self {
        let scene = engine.core.scene(grant.scene).await.unwrap();
        // As a worker gets it: over the wire, by its digest.
        let packed = engine.plan_bytes(grant.plan).await.unwrap().stream.try_collect::<Vec<Bytes>>().await.unwrap().concat();
        let bytes = zstd::stream::decode_all(packed.as_slice()).unwrap();
        assert_eq!(Plan::digest_of(&bytes), grant.plan);
        let plan = Plan::from_bytes(&bytes).unwrap();
        let layouts = scene.surfaces.iter().zip(&plan.surfaces);
        let rasters = layouts.map(|(s, layout)| SurfaceRaster::new(&scene, s, layout, plan.settings.frame)).collect();
        Self { plan, rasters }
    }

    fn segment(&self, phase: Phase, tile: u64) -> Vec<u8> {
        let grid = self.plan.settings.directions;
        if phase == Phase::Probe {
            let mut sums = ProbeSums::new(self.plan.surfaces.len());
            sums.count(0.5);
            return Segment::Probe(ProbeSegment { tile: TileIndex(tile), grid, sums }).to_bytes().unwrap();
        }
        let (surface, planned) = self.plan.locate(TileIndex(tile)).unwrap();
        let (mut mask, mut rows, mut errors) = (TexelMask::default(), Rows::default(), ErrorStats::default());
        for row in self.rasters[surface].tile(planned.cell) {
            mask.insert(row.x % 32, row.y % 32, row.is_covered());
            rows.push(&[Kept { depth: 0, rgb: [90; 3] }, Kept { depth: grid.len() as u16 - 1, rgb: [90; 3] }]);
            if row.is_covered() {
                (0..grid.len()).for_each(|_| errors.measure(&[[90; 3]], &[[90; 3]]));
            }
        }
        let raw = match self.plan.settings.raw {
            Some(_) => Raw::U8(vec![90; mask.len() * grid.len() as usize * 3]),
            None => Raw::None,
        };
        let walk = self.plan.probe.as_ref().unwrap().walks[surface];
        let (tile, cell) = (TileIndex(tile), planned.cell);
        Segment::Tile(Box::new(TileSegment { tile, surface: surface as u32, cell, grid, walk, mask, errors, rows, raw }))
            .to_bytes()
            .unwrap()
    }
}

/// The plan in the container of a live job, if it can be read as one of a package can.
async fn live_plan(engine: &Engine, job: JobId) -> Plan {
    let live = engine.live_scene(job).await.unwrap();
    kiln_proto::format::container::parse(&engine.live_scene_bytes(&live).await.unwrap()).unwrap().1
}

#[tokio::test(flavor = "multi_thread")]
async fn a_live_view_gets_the_light_without_raw_samples_and_the_scene_of_the_package() {
    let rig = Rig::new();
    let engine = Engine::open(rig.config()).await.unwrap();
    let scene = ready_scene(&engine).await;
    let raw = Some(kiln_proto::settings::RawFormat::U8);
    let settings =
        SettingsPatch { directions: Some("2x2".parse().unwrap()), texels_per_metre: Some(12.0), raw, ..SettingsPatch::default() };
    let job = engine.create_job(NewJob { settings, ..new_job(&scene) }, &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "grey").await;
    while !engine.job(job).await.unwrap().state.is_final() {
        let Some(grant) = worker.lease_within(20).await else { continue };
        let studio = Studio::new(&engine, &grant).await;
        let segments: Vec<_> = (grant.tiles.start..grant.tiles.end).map(|t| (t, studio.segment(grant.phase, t))).collect();
        worker.put(grant.token, 0, &pack(&segments)).await.unwrap();
        assert_eq!(live_plan(&engine, job).await, studio.plan);
        let body = engine.live_segments(job, &TileRuns::all(1_000), 64 << 20).await.unwrap();
        let live = super::live::split(&body);
        assert_eq!(live.is_empty(), grant.phase == Phase::Probe);
        for (tile, bytes) in live {
            let Segment::Tile(segment) = Segment::from_bytes(bytes).unwrap() else { panic!("tile {tile} is none") };
            assert_eq!((segment.tile.0, &segment.raw), (tile, &Raw::None));
            assert!(!segment.mask.is_empty());
        }
        engine.complete(grant.token, &finish()).await.unwrap();
    }
    let live = engine.live_scene(job).await.unwrap();
    assert_eq!(engine.live_scene_bytes(&live).await.unwrap(), read_all(&engine, job, "scene.kiln").await);
}

/// Submits a job whose light is grey.
pub(crate) async fn submit(engine: &Arc<Engine>) -> JobId {
    let scene = ready_scene(engine).await;
    let settings = SettingsPatch { directions: Some("2x2".parse().unwrap()), texels_per_metre: Some(12.0), ..SettingsPatch::default() };
    engine.create_job(NewJob { settings, ..new_job(&scene) }, &Principal::Local).await.unwrap().id
}

/// Bakes a job to its end.
pub(crate) async fn bake(engine: &Arc<Engine>, job: JobId) {
    let worker = Worker::join(engine, "grey").await;
    while !engine.job(job).await.unwrap().state.is_final() {
        let Some(grant) = worker.lease_within(20).await else { continue };
        let studio = Studio::new(engine, &grant).await;
        let segments: Vec<_> = (grant.tiles.start..grant.tiles.end).map(|t| (t, studio.segment(grant.phase, t))).collect();
        worker.put(grant.token, 0, &pack(&segments)).await.unwrap();
        engine.complete(grant.token, &finish()).await.unwrap();
    }
    let record = engine.job(job).await.unwrap();
    assert_eq!(record.state, JobState::Done, "{:?}", record.problem);
}

#[tokio::test(flavor = "multi_thread")]
async fn real_segments_become_a_real_package() {
    let rig = Rig::new();
    let engine = Engine::open(rig.config()).await.unwrap();
    let job = submit(&engine).await;
    bake(&engine, job).await;
    let manifest: serde_json::Value = serde_json::from_slice(&engine.manifest(job).await.unwrap()).unwrap();
    let listed = manifest["files"].as_array().unwrap();
    let files = engine.package(job).await.unwrap();
    assert!(files.iter().any(|f| f.path == "surfaces/floor.mtsp"), "{files:?}");
    for file in files.iter().filter(|f| !["manifest.json", "report.json"].contains(&f.path.as_str())) {
        let entry = listed.iter().find(|e| e["path"] == file.path.as_str()).expect("every file stands in the manifest");
        assert_eq!((entry["sha256"].as_str(), entry["bytes"].as_u64()), (Some(file.sha256.as_str()), Some(file.bytes)));
        assert_eq!(read_all(&engine, job, &file.path).await.len() as u64, file.bytes);
    }
    assert_eq!(listed.len() + 2, files.len());
}

/// The third tile of the floor fails for ever: it is grey all the same, and listed.
#[tokio::test(flavor = "multi_thread")]
async fn a_real_package_with_a_hole_is_grey_all_over() {
    let rig = Rig::new();
    let engine = Engine::open(rig.config()).await.unwrap();
    let scene = ready_scene(&engine).await;
    let settings = SettingsPatch { directions: Some("2x2".parse().unwrap()), texels_per_metre: Some(12.0), ..SettingsPatch::default() };
    let new = NewJob { settings, on_poison: OnPoison::Skip, ..new_job(&scene) };
    let job = engine.create_job(new, &Principal::Local).await.unwrap().id;
    let worker = Worker::join(&engine, "grey").await;
    while !engine.job(job).await.unwrap().state.is_final() {
        let Some(grant) = worker.lease_within(20).await else { continue };
        if grant.phase == Phase::Bake && (grant.tiles.start..grant.tiles.end).contains(&2) {
            engine.release(grant.token, &Finish { failure: Some("no memory".into()), ..finish() }).await.unwrap();
            continue;
        }
        let studio = Studio::new(&engine, &grant).await;
        let segments: Vec<_> = (grant.tiles.start..grant.tiles.end).map(|t| (t, studio.segment(grant.phase, t))).collect();
        worker.put(grant.token, 0, &pack(&segments)).await.unwrap();
        engine.complete(grant.token, &finish()).await.unwrap();
    }
    let record = engine.job(job).await.unwrap();
    assert_eq!((record.state, record.holes), (JobState::Done, 1), "{:?}", record.problem);
    let manifest = kiln_proto::format::Manifest::from_bytes(&engine.manifest(job).await.unwrap()).unwrap();
    let [floor, lamp] = [0, 1].map(|surface: usize| manifest.surfaces[surface].holes.clone());
    assert_eq!((floor.len(), floor[0].tile, lamp.len()), (1, 2, 0));
    assert!(floor[0].covered > 0 && floor[0].reason.ends_with("the last time with: no memory"), "{floor:?}");
    let starts = read_all(&engine, job, "surfaces/floor.mtsp").await;
    let holds = |texel: usize| starts[32 + 4 * texel..][..4] != starts[36 + 4 * texel..][..4];
    let width = manifest.surfaces[0].size.width;
    assert!(holds((floor[0].y * width + floor[0].x) as usize + 5 * width as usize + 5), "a texel of the hole");
    assert_eq!(read_all(&engine, job, "surfaces/floor.mtm").await[32..], [90; 3], "one colour, and no black");
}
