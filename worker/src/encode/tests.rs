use super::*;
use kiln_proto::{
    grid::Walk,
    ids::SceneHash,
    plan::{ChartSource, PLAN_VERSION, PhaseResults, PlannedTile},
    segment,
    settings::{SettingsPatch, TextureSize},
    units::Exposure,
    wire::message::Phase,
};

const D: usize = 12;

fn plan(rule: Rule, raw: Option<RawFormat>) -> Plan {
    let surface = SurfacePlan {
        size: TextureSize::new(40, 3).unwrap(),
        source: ChartSource::Author,
        uv: vec![],
        charts: vec![],
        covered: 12,
        tiles: vec![PlannedTile { cell: Cell { x: 1, y: 0 }, covered: 12, gutter: 6 }],
    };
    let mut settings = SettingsPatch { directions: Some("3x4".parse().unwrap()), raw, ..Default::default() }.resolve().unwrap();
    settings.rule = rule;
    let probe = PhaseResults { exposure: Exposure { eighths: 4 }, walks: vec![Walk::Theta], clipped_ppm: 0 };
    Plan { version: PLAN_VERSION, bake_version: 1, scene: SceneHash::of(b""), settings, surfaces: vec![surface], probe: Some(probe) }
}

/// Columns 32 to 35 covered, 36 and 37 gutter.
fn rows() -> Vec<Row> {
    (0..3).flat_map(|y| (32..38u32).map(move |x| Row { x, y, source: (x.min(35), y) })).collect()
}

fn radiance() -> Vec<f32> {
    (0..rows().len() * D * 3).map(|k| ((k * k * 7) % 101) as f32 * 0.01).collect()
}

fn parse(bytes: &[u8], plan: &Plan) -> Box<TileSegment> {
    match segment::open(bytes, plan, Phase::Bake, TileIndex(0)).unwrap() {
        Segment::Tile(tile) => tile,
        Segment::Probe(_) => panic!("a tile was encoded"),
    }
}

#[test]
fn a_tile_is_accepted_and_its_errors_are_those_of_its_rows() {
    let rule = Rule::Cumulative { threshold: 30 };
    let plan = plan(rule, Some(RawFormat::U8));
    let tile = parse(&encode_tile(&plan, TileIndex(0), &rows(), &radiance()).unwrap(), &plan);
    let Raw::U8(raw) = &tile.raw else { panic!("raw was asked for") };
    let order = Order::new(tile.grid, tile.walk);
    let mut errors = ErrorStats::default();
    for (k, texel) in tile.mask.texels().enumerate().filter(|(_, t)| t.covered) {
        let mut decoded = vec![[0; 3]; D];
        decode_row(tile.rows.row(k), &order, &mut decoded).unwrap();
        errors.measure(&raw.as_chunks::<3>().0[k * D..(k + 1) * D], &decoded);
        assert!(texel.x < 4);
    }
    assert_eq!((&tile.errors, tile.errors.samples()), (&errors, 12 * D as u64));
    assert!(errors.max() > 0, "data that cost nothing would prove nothing");
}

#[test]
fn coded_samples_give_the_bytes_that_their_radiance_gives() {
    for raw in [None, Some(RawFormat::U8)] {
        let plan = plan(Rule::default(), raw);
        let from_radiance = encode_tile(&plan, TileIndex(0), &rows(), &radiance()).unwrap();
        let factor = plan.probe.as_ref().unwrap().exposure.factor();
        let samples = radiance().as_chunks::<3>().0.iter().map(|rgb| rgb.map(|v| radiance_to_byte(v, factor))).collect();
        assert_eq!(encode_coded_tile(&plan, TileIndex(0), &rows(), samples).unwrap(), from_radiance);
    }
    let wants_radiance = plan(Rule::default(), Some(RawFormat::F32));
    assert!(encode_coded_tile(&wants_radiance, TileIndex(0), &rows(), vec![[0; 3]; 18 * D]).is_err());
}

#[test]
fn threads_do_not_reach_the_bytes() {
    let plan = plan(Rule::default(), Some(RawFormat::F32));
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| encode_tile(&plan, TileIndex(0), &rows(), &radiance()).unwrap())
    };
    assert_eq!(with(1), with(5));
}

#[test]
fn what_does_not_fit_the_plan_is_refused() {
    let plan = plan(Rule::default(), None);
    let refusal = |rows: &[Row], radiance: &[f32]| encode_tile(&plan, TileIndex(0), rows, radiance).unwrap_err().to_string();
    assert!(refusal(&rows()[1..], &radiance()).contains("17 rows"));
    assert!(refusal(&rows(), &radiance()[3..]).contains("645 values"));
    let mut swapped = rows();
    swapped.swap(3, 2);
    assert!(refusal(&swapped, &radiance()).contains("(34, 0)"));
    let mut elsewhere = rows();
    elsewhere[0] = Row { x: 31, y: 0, source: (31, 0) };
    assert!(refusal(&elsewhere, &radiance()).contains("(31, 0)"));
    let mut light = radiance();
    light[(7 * D + 5) * 3 + 1] = f32::NAN;
    assert!(refusal(&rows(), &light).contains("texel (33, 1), direction 5"));
    assert!(matches!(encode_tile(&plan, TileIndex(1), &rows(), &radiance()), Err(EncodeError::NoSuchTile { .. })));
    let early = Plan { probe: None, ..plan.clone() };
    assert!(matches!(encode_tile(&early, TileIndex(0), &rows(), &radiance()), Err(EncodeError::NoExposure)));
}

#[test]
fn a_probe_segment_is_accepted() {
    let plan = plan(Rule::default(), None);
    let mut sums = ProbeSums::new(1);
    sums.count(0.5);
    let bytes = encode_probe(&plan, TileIndex(0), sums).unwrap();
    segment::check(&bytes, &plan, Phase::Probe, TileIndex(0)).unwrap();
}
