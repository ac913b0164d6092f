use super::*;
use crate::{
    codec::pwl::{ErrorStats, Kept},
    grid::Walk,
    ids::SceneHash,
    plan::{ChartSource, PLAN_VERSION, PhaseResults, Plan, PlannedTile, SurfacePlan},
    settings::{SettingsPatch, TextureSize},
    units::Exposure,
};
use proptest::prelude::*;

fn plan(raw: Option<RawFormat>) -> Plan {
    let tile = |x| PlannedTile { cell: Cell { x, y: 0 }, covered: 1, gutter: 1 };
    let surface = |tiles| SurfacePlan {
        size: TextureSize::new(40, 4).unwrap(),
        source: ChartSource::Author,
        uv: vec![],
        charts: vec![],
        covered: 1,
        tiles,
    };
    let directions = Some("2x2".parse().unwrap());
    Plan {
        version: PLAN_VERSION,
        bake_version: 1,
        scene: SceneHash::of(b""),
        settings: SettingsPatch { directions, raw, ..Default::default() }.resolve().unwrap(),
        surfaces: vec![surface(vec![tile(0)]), surface(vec![tile(0), tile(1)])],
        probe: Some(PhaseResults { exposure: Exposure::default(), walks: vec![Walk::Phi, Walk::Theta], clipped_ppm: 0 }),
    }
}

fn kept(pairs: &[(u16, u8)]) -> Vec<Kept> {
    pairs.iter().map(|(depth, v)| Kept { depth: *depth, rgb: [*v, v + 1, 0] }).collect()
}

/// Tile 2 of the plan: the second cell of the second surface, one covered texel and one gutter texel, walk theta (0, 2, 1, 3).
fn tile(raw: Raw) -> Segment {
    let mut mask = TexelMask::default();
    mask.insert(1, 0, true);
    mask.insert(0, 2, false);
    let mut rows = Rows::default();
    rows.push(&kept(&[(0, 5), (3, 7)]));
    rows.push(&kept(&[(0, 5), (2, 4), (3, 7)]));
    let mut errors = ErrorStats::default();
    errors.measure(&[[1; 3], [2; 3], [3; 3], [4; 3]], &[[1; 3], [2; 3], [3, 3, 5], [4; 3]]);
    let (cell, grid) = (Cell { x: 1, y: 0 }, "2x2".parse().unwrap());
    Segment::Tile(Box::new(TileSegment { tile: TileIndex(2), surface: 1, cell, grid, walk: Walk::Theta, mask, errors, rows, raw }))
}

fn probe() -> Segment {
    let mut sums = ProbeSums::new(2);
    sums.count(1.0);
    sums.variation[1] = (300, 2);
    Segment::Probe(ProbeSegment { tile: TileIndex(0), grid: "2x2".parse().unwrap(), sums })
}

#[test]
fn the_bytes_of_version_1_never_change() {
    let mut expected = b"KSEG\x01\0\x02\x01\x02\0\0\0\0\0\0\0\x01\0\0\0\x01\0\0\0\x02\0\x02\0\x02\0\0\0\x03\0\0\0".to_vec();
    expected.extend([0; 4]); // the checksum, below
    let mut masks = [0u8; 256];
    masks[0] = 0b10; // covered: row 0, column 1
    masks[128 + 8] = 0b1; // gutter: row 2, column 0
    expected.extend(masks);
    expected.extend([2, 0, 0, 3, 0, 0, 0, 2, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]);
    expected.extend([2, 0, 3, 5, 2, 6, 2, 0, 0]);
    expected.extend([3, 0, 1, 2, 5, 255, 3, 6, 255, 3, 0, 0, 0]);
    expected.extend(1..=24);
    let crc = checksum(&expected);
    expected[36..40].copy_from_slice(&crc.to_le_bytes());
    assert_eq!(tile(Raw::U8((1..=24).collect())).to_bytes().unwrap(), expected);
}

#[test]
fn segments_survive_their_bytes_and_fit_their_plan() {
    let floats = Raw::F32((0..24).map(|k| k as f32 * 0.25).collect());
    for (raw, format) in [(Raw::None, None), (Raw::U8(vec![7; 24]), Some(RawFormat::U8)), (floats, Some(RawFormat::F32))] {
        let segment = tile(raw);
        let bytes = segment.to_bytes().unwrap();
        assert_eq!(open(&bytes, &plan(format), Phase::Bake, TileIndex(2)).unwrap(), segment);
    }
    let bytes = probe().to_bytes().unwrap();
    assert_eq!(open(&bytes, &plan(None), Phase::Probe, TileIndex(0)).unwrap(), probe());
}

#[test]
fn a_segment_of_something_else_is_refused_by_name() {
    let bytes = tile(Raw::None).to_bytes().unwrap();
    let refusal = |change: &dyn Fn(&mut Plan), tile| {
        let mut plan = plan(None);
        change(&mut plan);
        check(&bytes, &plan, Phase::Bake, TileIndex(tile)).unwrap_err().to_string()
    };
    assert!(refusal(&|_| {}, 1).contains("tile is 2"));
    assert!(refusal(&|p| p.surfaces[0].tiles.clear(), 2).contains("a tile of the plan"));
    assert!(refusal(&|p| p.surfaces[0].tiles = vec![p.surfaces[0].tiles[0]; 2], 2).contains("cell"));
    assert!(refusal(&|p| p.surfaces[1].tiles[1].covered = 2, 2).contains("covered"));
    assert!(refusal(&|p| p.surfaces[1].tiles[1].gutter = 2, 2).contains("gutter"));
    assert!(refusal(&|p| p.surfaces[1].size.height = 2, 2).contains("texel at (0, 2)"));
    assert!(refusal(&|p| p.probe.as_mut().unwrap().walks[1] = Walk::Phi, 2).contains("walk"));
    assert!(refusal(&|p| p.settings.directions = "2x4".parse().unwrap(), 2).contains("directions"));
    assert!(refusal(&|p| p.settings.raw = Some(RawFormat::U8), 2).contains("raw"));
    assert!(refusal(&|p| p.settings.rule = crate::settings::Rule::Bounded { eps: 1 }, 2).contains("largest error is 2"));
    assert!(check(&bytes, &plan(None), Phase::Probe, TileIndex(2)).unwrap_err().to_string().contains("phase"));
    let mut one = plan(None);
    one.surfaces.truncate(1);
    assert!(check(&probe().to_bytes().unwrap(), &one, Phase::Probe, TileIndex(0)).unwrap_err().to_string().contains("probe sums"));
}

/// Raw samples of [`tile`] whose errors are those that it states: 2 levels in one channel of one sample.
fn raw_samples() -> Vec<u8> {
    [&[5, 6, 0, 6, 7, 0, 6, 7, 2, 7, 8, 0][..], &[9; 12]].concat()
}

#[test]
fn errors_are_measured_again_where_raw_samples_came_along() {
    let light = |bytes: Vec<u8>| Raw::F32(bytes.into_iter().map(|b| crate::units::byte_to_radiance(b, 1.0)).collect());
    let ask = |raw: Raw| {
        let format = raw.format();
        check(&tile(raw).to_bytes().unwrap(), &plan(format), Phase::Bake, TileIndex(2)).map_err(|e| e.to_string())
    };
    assert_eq!(ask(Raw::U8(raw_samples())), Ok(()));
    assert_eq!(ask(light(raw_samples())), Ok(()));
    let mut other = raw_samples();
    other[12] = 200; // gutter: not in the statistics
    assert_eq!(ask(Raw::U8(other.clone())), Ok(()));
    other[0] = 4;
    for raw in [Raw::U8(other.clone()), light(other)] {
        assert!(ask(raw).unwrap_err().contains("error statistics is 2 at most, 2 in all; expected 2 at most, 3 in all"));
    }
}

#[test]
fn raw_samples_can_be_left_out() {
    let bare = tile(Raw::None).to_bytes().unwrap();
    assert_eq!(without_raw(tile(Raw::U8(raw_samples())).to_bytes().unwrap()).unwrap(), bare);
    assert_eq!(without_raw(bare.clone()).unwrap(), bare);
    let sums = probe().to_bytes().unwrap();
    assert_eq!(without_raw(sums.clone()).unwrap(), sums);
    assert!(without_raw(bare[1..].to_vec()).is_err());
}

#[test]
fn probe_sums_beyond_what_the_tile_can_see_are_refused() {
    let ask = |surface: usize, variation| {
        let Segment::Probe(mut p) = probe() else { panic!("a probe") };
        p.sums.variation[surface] = variation;
        // All texels are the second surface's: two Probe tiles.
        let mut plan = plan(None);
        plan.surfaces[0].covered = 0;
        plan.surfaces[1].covered = 100;
        check(&Segment::Probe(p).to_bytes().unwrap(), &plan, Phase::Probe, TileIndex(0)).map_err(|e| e.to_string())
    };
    assert_eq!(ask(1, (u64::MAX / 2, 0)), Ok(()));
    assert!(ask(1, (0, u64::MAX / 2 + 1)).unwrap_err().contains("probe variation"));
    assert!(ask(0, (0, 1)).unwrap_err().contains("on surface 0; expected at most 0"));
}

/// Bytes with a right checksum and one thing wrong inside.
fn forged(change: impl Fn(&mut Vec<u8>)) -> String {
    let mut bytes = tile(Raw::F32(vec![1.0; 24])).to_bytes().unwrap();
    change(&mut bytes);
    let crc = checksum(&bytes);
    bytes[36..40].copy_from_slice(&crc.to_le_bytes());
    Segment::from_bytes(&bytes).unwrap_err().to_string()
}

#[test]
fn lies_with_a_right_checksum_are_found() {
    let rows = HEADER_BYTES + 256 + 20;
    let raw = rows + 9 + 13;
    assert!(forged(|b| b[4] = 2).contains("version is 2"));
    assert!(forged(|b| b[7] = 0).contains("kind and phase"));
    assert!(forged(|b| b[26] = 3).contains("directions"));
    assert!(forged(|b| b[28] = 3).contains("row count is 3"));
    assert!(forged(|b| b[32] = 8).contains("flags"));
    assert!(forged(|b| b[34] = 1).contains("reserved"));
    assert!(forged(|b| b[HEADER_BYTES + 128] = 2).contains("masks"));
    assert!(forged(|b| b[HEADER_BYTES + 256 + 3] = 4).contains("error statistics"));
    assert!(forged(|b| b[HEADER_BYTES + 256 + 7] = 0).contains("out of place"));
    assert!(forged(|b| b[rows] = 1).contains("fewer than two"));
    assert!(forged(|b| b[rows] = 5).contains("more than there are"));
    assert!(forged(|b| b[rows + 2] = 0).contains("same direction"));
    assert!(forged(|b| b[rows + 2] = 2).contains("not the last direction"));
    assert!(forged(|b| b[rows + 2] = 4).contains("beyond the last"));
    assert!(forged(|b| b[raw + 4 * 14 + 2..raw + 4 * 14 + 4].copy_from_slice(&[0x80, 0x7f])).contains("row 1, depth 0"));
    assert!(forged(|b| b.push(0)).contains("1 bytes follow"));
    assert!(forged(|b| b.truncate(b.len() - 1)).contains("raw samples"));
}

#[test]
fn too_many_bytes_are_refused_before_they_are_read() {
    assert!(matches!(Segment::from_bytes(&vec![0; limits::SEGMENT_BYTES + 1]), Err(SegmentError::TooLarge { .. })));
    assert!(check(&vec![0; 1 << 20], &plan(None), Phase::Bake, TileIndex(2)).unwrap_err().to_string().contains("length"));
}

proptest! {
    #[test]
    fn every_truncation_and_every_flipped_bit_is_an_error(at in any::<prop::sample::Index>(), bit in 0u8..8, is_probe in any::<bool>()) {
        let mut bytes = if is_probe { probe() } else { tile(Raw::U8(vec![9; 24])) }.to_bytes().unwrap();
        let at = at.index(bytes.len());
        prop_assert!(Segment::from_bytes(&bytes[..at]).is_err());
        bytes[at] ^= 1 << bit;
        prop_assert!(Segment::from_bytes(&bytes).is_err());
    }

    #[test]
    fn noise_behind_a_right_header_never_panics(noise in prop::collection::vec(any::<u8>(), 0..600)) {
        let mut bytes = tile(Raw::None).to_bytes().unwrap();
        bytes.truncate(HEADER_BYTES + 256);
        bytes.extend(noise);
        let crc = checksum(&bytes);
        bytes[36..40].copy_from_slice(&crc.to_le_bytes());
        let _ = Segment::from_bytes(&bytes);
    }
}
