use super::*;
use kiln_proto::{
    codec::pwl::Kept,
    format::surface::SurfaceFiles,
    grid::{SphericalGrid, Walk},
    plan::{ChartSource, PLAN_VERSION, PhaseResults, PlannedTile},
    scene::{Material, Scene, Surface, Triangle},
    segment::{Raw, Rows, TexelMask},
    settings::{SettingsPatch, TextureSize},
    tile::Cell,
    units::{Exposure, Rgb},
};
use std::collections::{BTreeMap, BTreeSet};

/// splitmix64: small, seeded and the same everywhere.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, below: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % below
    }
}

struct Made {
    plan: Plan,
    segments: Vec<Vec<u8>>,
    /// What each texel (number) holds.
    texels: BTreeMap<u64, (Vec<Kept>, Vec<u8>)>,
    errors: ErrorStats,
}

fn scene() -> Scene {
    Scene {
        positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        surfaces: vec![Surface {
            file_stem: "the_floor".into(),
            ..Surface::plain("the floor", 0, vec![(Triangle { corners: [0, 1, 2], polygon: 0 }, None)])
        }],
        materials: vec![Material::matt("grey", Rgb::splat(0.5))],
        ..Scene::empty()
    }
}

/// A surface of 70 x 40 texels with a hole of a tile, random light in it, and at most `levels` values a channel.
fn make(grid: SphericalGrid, levels: u64, raw: Option<RawFormat>) -> Made {
    let mut dice = Dice(levels);
    let size = TextureSize::new(70, 40).unwrap();
    let order = kiln_proto::codec::pwl::Order::new(grid, Walk::Theta);
    let cells = [(0, 0), (1, 0), (0, 1), (2, 0), (2, 1)].map(|(x, y)| Cell { x, y }); // (1, 1) has no texels
    let (mut tiles, mut parts, mut texels, mut errors) = (vec![], vec![], BTreeMap::new(), ErrorStats::default());
    for cell in cells {
        let (mut mask, mut rows, mut samples, mut own) = (TexelMask::default(), Rows::default(), vec![], ErrorStats::default());
        let (x0, y0) = (u32::from(cell.x) * 32, u32::from(cell.y) * 32);
        for (y, x) in (y0..(y0 + 32).min(40)).flat_map(|y| (x0..(x0 + 32).min(70)).map(move |x| (y, x))) {
            let covered = match dice.roll(10) {
                0 => continue,
                1 => false,
                _ => true,
            };
            mask.insert(x - x0, y - y0, covered);
            let mut colour = || [0; 3].map(|_: u8| (dice.roll(levels) * 255 / levels.max(2)) as u8);
            let ends = [colour(), colour()];
            let middle: Vec<_> = (1..order.len() - 1).map(|step| (step, colour())).collect();
            let mut kept = vec![Kept { depth: order.depth(0), rgb: ends[0] }];
            kept.extend(middle.into_iter().filter(|_| dice.roll(2) == 0).map(|(s, rgb)| Kept { depth: order.depth(s), rgb }));
            kept.push(Kept { depth: order.depth(order.len() - 1), rgb: ends[1] });
            rows.push(&kept);
            let bytes: Vec<u8> = (0..order.len() * 3).map(|_| dice.roll(256) as u8).collect();
            if covered {
                let off = [[2, 0, 0], [0, 0, 0]][dice.roll(2) as usize];
                (0..order.len()).for_each(|_| own.measure(&[[0; 3]], &[off]));
            }
            samples.extend(&bytes);
            texels.insert(u64::from(y) * 70 + u64::from(x), (kept, bytes));
        }
        errors.add(&own);
        tiles.push(PlannedTile { cell, covered: mask.covered() as u16, gutter: mask.gutter() as u16 });
        parts.push((cell, mask, rows, samples, own));
    }
    let segment = |(index, (cell, mask, rows, samples, errors)): (usize, (Cell, TexelMask, Rows, Vec<u8>, ErrorStats))| {
        let raw = match raw {
            None => Raw::None,
            Some(RawFormat::U8) => Raw::U8(samples),
            Some(RawFormat::F32) => Raw::F32(samples.iter().map(|b| f32::from(*b) * 0.5).collect()),
        };
        let tile = TileIndex(index as u64);
        Segment::Tile(Box::new(TileSegment { tile, surface: 0, cell, grid, walk: Walk::Theta, mask, errors, rows, raw }))
            .to_bytes()
            .unwrap()
    };
    let covered = tiles.iter().map(|t| u64::from(t.covered)).sum();
    let surface = SurfacePlan { size, source: ChartSource::Author, uv: vec![[[0.0; 2]; 3]], charts: vec![0], covered, tiles };
    let plan = Plan {
        version: PLAN_VERSION,
        bake_version: 1,
        scene: Scene::hash_of(&scene().to_bytes().unwrap()),
        settings: SettingsPatch { directions: Some(grid), raw, ..Default::default() }.resolve().unwrap(),
        surfaces: vec![surface],
        probe: Some(PhaseResults { exposure: Exposure::default(), walks: vec![Walk::Theta], clipped_ppm: 3 }),
    };
    Made { plan, segments: parts.into_iter().enumerate().map(segment).collect(), texels, errors }
}

fn assemble(made: &Made, dir: &Path) -> SurfaceReport {
    let mut source = |index: usize| Ok(made.segments[index].clone());
    assemble_surface(&made.plan, 0, "the_floor", &mut source, dir).unwrap()
}

fn file(header: Header, payload: &[u8]) -> Vec<u8> {
    [&Header { crc: crc32c::crc32c(payload), ..header }.to_bytes()[..], payload].concat()
}

/// The files of the whole surface, put together in memory in the most obvious way.
fn naive(made: &Made) -> BTreeMap<&'static str, Vec<u8>> {
    let size = made.plan.surfaces[0].size;
    let depth = made.plan.settings.directions.len();
    let all: Vec<&[Kept]> = (0..size.texels()).map(|t| made.texels.get(&t).map_or(&[][..], |(kept, _)| kept)).collect();
    let kept: Vec<Kept> = all.iter().flat_map(|k| k.iter().copied()).collect();
    let map: Vec<[u8; 3]> = kept.iter().map(|k| k.rgb).collect::<BTreeSet<_>>().into_iter().collect();
    let direct = map.len() > 65_536;
    let mut starts = vec![0u32];
    all.iter().for_each(|k| starts.push(starts[starts.len() - 1] + k.len() as u32));
    let colour = |k: &Kept| if direct { k.rgb.to_vec() } else { (map.binary_search(&k.rgb).unwrap() as u16).to_le_bytes().to_vec() };
    let head = |kind, bits, count: usize| Header { kind, bits, size, depth, count: count as u64, crc: 0 };
    let bytes = |parts: Vec<Vec<u8>>| parts.concat();
    let mut out = BTreeMap::from([
        ("mtsp", file(head(Kind::Mtsp, 32, starts.len()), &bytes(starts.iter().map(|s| s.to_le_bytes().to_vec()).collect()))),
        ("mti", file(head(Kind::Mti, 16, kept.len()), &bytes(kept.iter().map(|k| k.depth.to_le_bytes().to_vec()).collect()))),
        ("mtnc", file(head(Kind::Mtnc, if direct { 24 } else { 16 }, kept.len()), &bytes(kept.iter().map(colour).collect()))),
        ("mtm", if direct { file(head(Kind::Mtm, 8, 0), &[]) } else { file(head(Kind::Mtm, 8, map.len()), map.as_flattened()) }),
    ]);
    if let Some(format) = made.plan.settings.raw {
        let empty = vec![0; depth as usize * 3];
        let values = (0..size.texels()).flat_map(|t| made.texels.get(&t).map_or(&empty, |(_, raw)| raw));
        let (bits, payload): (u16, Vec<u8>) = match format {
            RawFormat::U8 => (8, values.copied().collect()),
            RawFormat::F32 => (32, values.flat_map(|b| (f32::from(*b) * 0.5).to_le_bytes()).collect()),
        };
        out.insert("mtex", file(head(Kind::Mtex, bits, size.texels() as usize * depth as usize), &payload));
    }
    out
}

#[test]
fn streamed_files_equal_files_put_together_in_memory() {
    for (grid, levels, raw) in [("4x4", 7, None), ("2x4", 200, Some(RawFormat::U8)), ("8x8", 255, Some(RawFormat::F32)), ("1x2", 1, None)] {
        let made = make(grid.parse().unwrap(), levels, raw);
        let dir = tempfile::tempdir().unwrap();
        let report = assemble(&made, dir.path());
        let expected = naive(&made);
        assert_eq!(report.files.len(), expected.len());
        for (extension, bytes) in &expected {
            let path = format!("surfaces/the_floor.{extension}");
            let record = report.files.iter().find(|f| f.path == path).unwrap();
            assert!(std::fs::read(dir.path().join(&path)).unwrap() == *bytes, "{grid}: {extension} differs");
            assert_eq!((record.bytes, record.sha256), (bytes.len() as u64, kiln_proto::format::Sha256Hex::of(bytes)));
        }
        assert_eq!((report.colour_bits, report.colours == 0), if grid == "8x8" { (24, true) } else { (16, false) }, "{grid}");
        assert_eq!((report.errors, report.error_sum), (made.errors.counts().collect(), made.errors.sum()));
        assert_eq!(std::fs::read_dir(dir.path().join("surfaces")).unwrap().count(), expected.len(), "scratch files must be gone");
    }
}

#[test]
fn the_reference_reader_reads_what_was_assembled() {
    let made = make("4x4".parse().unwrap(), 9, None);
    let dir = tempfile::tempdir().unwrap();
    assemble(&made, dir.path());
    let read = |kind: Kind| std::fs::read(dir.path().join(kind.path("the_floor"))).unwrap();
    let [mtsp, mti, mtnc, mtm] = [Kind::Mtsp, Kind::Mti, Kind::Mtnc, Kind::Mtm].map(read);
    let files = SurfaceFiles::parse(&mtsp, &mti, &mtnc, &mtm).unwrap();
    for texel in 0..70 * 40 {
        assert_eq!(files.kept(texel), made.texels.get(&(texel as u64)).map_or(vec![], |(kept, _)| kept.clone()));
    }
}

#[test]
fn a_surface_without_covered_texels_has_its_files() {
    let mut made = make("1x2".parse().unwrap(), 2, Some(RawFormat::U8));
    made.plan.surfaces[0].tiles.clear();
    made.plan.surfaces[0].covered = 0;
    let dir = tempfile::tempdir().unwrap();
    let report = assemble(&made, dir.path());
    assert_eq!((report.kept_samples, report.colours, report.files.len()), (0, 0, 5));
    assert!(write_manifest(dir.path(), &scene().to_bytes().unwrap(), &made.plan, &[report]).is_ok());
}

#[test]
fn segments_that_fail_are_named() {
    let made = make("1x2".parse().unwrap(), 2, None);
    let dir = tempfile::tempdir().unwrap();
    let with = |source: &mut dyn SegmentSource| assemble_surface(&made.plan, 0, "f", source, dir.path()).unwrap_err();
    let missing = with(&mut |index: usize| if index == 2 { Err("gone".into()) } else { Ok(made.segments[index].clone()) });
    assert!(matches!(missing, AssembleError::Source { tile: TileIndex(2), .. }), "{missing}");
    let swapped = with(&mut |_: usize| Ok(made.segments[1].clone()));
    assert!(matches!(swapped, AssembleError::Segment { tile: TileIndex(0), .. }), "{swapped}");
    std::fs::remove_dir_all(dir.path().join("surfaces")).unwrap();
    std::fs::write(dir.path().join("surfaces"), "in the way").unwrap();
    assert!(matches!(with(&mut |_: usize| Ok(vec![])), AssembleError::Io { .. }));
}

#[test]
fn the_manifest_is_the_same_after_reports_went_through_json() {
    let made = make("4x4".parse().unwrap(), 9, Some(RawFormat::U8));
    let dir = tempfile::tempdir().unwrap();
    let report = assemble(&made, dir.path());
    let json = serde_json::to_string(&report).unwrap();
    let bytes = scene().to_bytes().unwrap();
    let first = write_manifest(dir.path(), &bytes, &made.plan, &[report]).unwrap();
    let manifest = std::fs::read(dir.path().join("manifest.json")).unwrap();
    let again = write_manifest(dir.path(), &bytes, &made.plan, &[serde_json::from_str(&json).unwrap()]).unwrap();
    assert_eq!((first.hash, &manifest), (again.hash, &std::fs::read(dir.path().join("manifest.json")).unwrap()));
    let parsed = kiln_proto::format::Manifest::from_bytes(&manifest).unwrap();
    assert_eq!(parsed.files.len(), 6);
    assert_eq!(parsed.surfaces[0].name, "the floor");
    assert_eq!(parsed.surfaces[0].encoding.errors.max, 2);
    let file = std::fs::read(dir.path().join("scene.kiln")).unwrap();
    let (read_scene, read_plan) = kiln_proto::format::container::parse(&file).unwrap();
    assert_eq!((read_scene, &read_plan), (scene(), &made.plan));
    assert!(kiln_proto::format::container::parse(&file[..file.len() - 1]).is_err());
    let flipped: Vec<u8> = file.iter().enumerate().map(|(k, b)| if k == 40 { b ^ 1 } else { *b }).collect();
    assert!(kiln_proto::format::container::parse(&flipped).unwrap_err().to_string().contains("checksum"));
    assert!(write_manifest(dir.path(), &bytes, &made.plan, &[]).is_err());
}
