use super::*;
use crate::assemble::{SurfaceReport, assemble_around, assemble_surface, write_manifest};
use kiln_proto::{
    format::{Header, Kind, Manifest, surface::SurfaceFiles},
    grid::Walk,
    plan::{ChartSource, PLAN_VERSION, PhaseResults, PlannedTile},
    scene::{Material, Surface, Triangle},
    segment::Segment,
    settings::SettingsPatch,
    units::{Exposure, Rgb},
};
use std::path::Path;

/// Width of the texture; tile (1, y) holds texels of both charts, which the column between them parts.
const WIDTH: u32 = 96;
const HEIGHT: u32 = 70;
const BETWEEN: u32 = 48;

/// A floor and a wall in one surface, each its own chart, side by side in 96 x 70 texels: 3 x 3 tiles.
struct Made {
    scene: Scene,
    plan: Plan,
}

fn made(raw: Option<RawFormat>) -> Made {
    let floor = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
    let wall = [[2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 1.0], [2.0, 0.0, 1.0]];
    let at = |x: u32| x as f32 / WIDTH as f32;
    let quad = |low: f32, high: f32| [[low, 0.0], [high, 0.0], [high, 1.0], [low, 1.0]];
    let uv = [quad(0.0, at(BETWEEN - 3)), quad(at(BETWEEN + 3), 1.0)].concat();
    let corners = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let triangles = corners.map(|c| (Triangle { corners: c.map(|k| k as u32), polygon: 0 }, Some(c.map(|k| uv[k]))));
    let scene = Scene {
        positions: [floor, wall].concat(),
        surfaces: vec![Surface { file_stem: "room".into(), ..Surface::plain("room", 0, triangles.to_vec()) }],
        materials: vec![Material::matt("grey", Rgb::splat(0.5))],
        ..Scene::empty()
    };
    let size = format!("{WIDTH}x{HEIGHT}").parse().unwrap();
    let uv = corners.map(|c| c.map(|k| uv[k])).to_vec();
    let mut layout = SurfacePlan { size, source: ChartSource::Author, uv, charts: vec![0, 0, 1, 1], covered: 0, tiles: vec![] };
    let settings = SettingsPatch { directions: Some("2x4".parse().unwrap()), raw, ..SettingsPatch::default() }.resolve().unwrap();
    let raster = SurfaceRaster::new(&scene, &scene.surfaces[0], &layout, settings.frame);
    for cell in (0..3).flat_map(|y| (0..3).map(move |x| Cell { x, y })) {
        let rows = raster.tile(cell);
        let covered = rows.iter().filter(|row| row.is_covered()).count();
        layout.covered += covered as u64;
        layout.tiles.push(PlannedTile { cell, covered: covered as u16, gutter: (rows.len() - covered) as u16 });
    }
    let plan = Plan {
        version: PLAN_VERSION,
        bake_version: 1,
        scene: Scene::hash_of(&scene.to_bytes().unwrap()),
        settings,
        surfaces: vec![layout],
        probe: Some(PhaseResults { exposure: Exposure::default(), walks: vec![Walk::Theta], clipped_ppm: 0 }),
    };
    Made { scene, plan }
}

/// A colour that tells where a texel lies.
fn colour((x, y): Place) -> [u8; 3] {
    [x as u8, y as u8, 200]
}

impl Made {
    fn raster(&self) -> SurfaceRaster {
        SurfaceRaster::new(&self.scene, &self.scene.surfaces[0], &self.plan.surfaces[0], self.plan.settings.frame)
    }

    fn segment(&self, tile: usize) -> Vec<u8> {
        let (order, cell) = (self.plan.order(0), self.plan.surfaces[0].tiles[tile].cell);
        let (mut mask, mut rows, mut errors, mut samples) = (TexelMask::default(), Rows::default(), ErrorStats::default(), vec![]);
        for row in self.raster().tile(cell) {
            mask.insert(row.x % TILE_SIDE, row.y % TILE_SIDE, row.is_covered());
            let rgb = colour(row.source);
            rows.push(&[0, order.len() - 1].map(|step| Kept { depth: order.depth(step), rgb }));
            samples.extend(rgb.repeat(order.len()));
            if row.is_covered() {
                let originals = vec![rgb; order.len()];
                errors.measure(&originals, &originals);
            }
        }
        let raw = match self.plan.settings.raw {
            None => Raw::None,
            Some(RawFormat::U8) => Raw::U8(samples),
            Some(RawFormat::F32) => Raw::F32(samples.iter().map(|b| f32::from(*b)).collect()),
        };
        let (grid, walk, tile) = (self.plan.settings.directions, Walk::Theta, TileIndex(tile as u64));
        Segment::Tile(Box::new(TileSegment { tile, surface: 0, cell, grid, walk, mask, errors, rows, raw })).to_bytes().unwrap()
    }

    fn assemble(&self, holes: &[usize], dir: &Path) -> SurfaceReport {
        let mut source = |tile: usize| {
            assert!(!holes.contains(&tile), "tile {tile} is a hole");
            Ok(self.segment(tile))
        };
        if holes.is_empty() {
            return assemble_surface(&self.plan, 0, "room", &mut source, dir).unwrap();
        }
        assemble_around(&self.holes(holes), "room", &mut source, dir).unwrap()
    }

    fn holes(&self, tiles: &[usize]) -> Holes<'_> {
        let list = tiles.iter().map(|tile| Hole { tile: *tile, reason: "failed".into() }).collect();
        Holes::new(&self.scene, &self.plan, 0, list).unwrap()
    }

    fn manifest(&self, report: &SurfaceReport, dir: &Path) -> Manifest {
        write_manifest(dir, &self.scene.to_bytes().unwrap(), &self.plan, std::slice::from_ref(report)).unwrap().manifest
    }
}

/// What each texel keeps, and its raw bytes.
fn texels(dir: &Path) -> Vec<(Vec<Kept>, Vec<u8>)> {
    let read = |kind: Kind| std::fs::read(dir.join(kind.path("room")));
    let [mtsp, mti, mtnc, mtm] = [Kind::Mtsp, Kind::Mti, Kind::Mtnc, Kind::Mtm].map(|kind| read(kind).unwrap());
    let files = SurfaceFiles::parse(&mtsp, &mti, &mtnc, &mtm).unwrap();
    let count = (WIDTH * HEIGHT) as usize;
    let raw = read(Kind::Mtex).map_or(vec![], |bytes| {
        let header = Header::parse(bytes.first_chunk().unwrap(), Kind::Mtex, bytes.len() as u64).unwrap();
        header.check_crc(crc32c::crc32c(&bytes[32..])).unwrap();
        bytes[32..].to_vec()
    });
    let part = raw.len() / count;
    (0..count).map(|texel| (files.kept(texel), raw[texel * part..(texel + 1) * part].to_vec())).collect()
}

#[test]
fn what_was_baked_stays_as_it_is_and_a_hole_takes_the_nearest_of_its_chart() {
    for (raw, holes) in [(None, &[1][..]), (Some(RawFormat::U8), &[4, 1]), (Some(RawFormat::F32), &[0, 3, 4, 8])] {
        let (made, whole, torn) = (made(raw), tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        made.assemble(&[], whole.path());
        let report = made.assemble(holes, torn.path());
        assert_eq!(report.holes.iter().map(|hole| hole.tile).collect::<BTreeSet<_>>(), holes.iter().copied().collect());
        let (expected, found, raster) = (texels(whole.path()), texels(torn.path()), made.raster());
        let missing = made.holes(holes);
        let rows: Vec<Row> = made.plan.surfaces[0].tiles.iter().flat_map(|tile| raster.tile(tile.cell)).collect();
        let chart = |(x, y): Place| raster.chart(x, y).unwrap();
        let there: Vec<Place> = rows.iter().filter(|row| row.is_covered()).map(|row| row.source).filter(|p| !missing.hides(*p)).collect();
        for row in &rows {
            let at = (row.y * WIDTH + row.x) as usize;
            if !missing.hides((row.x, row.y)) {
                assert!(expected[at] == found[at], "({}, {}) was baked, and is not what it was", row.x, row.y);
                continue;
            }
            let own = there.iter().filter(|p| chart(**p) == chart(row.source));
            let from = own.min_by_key(|(x, y)| (x.abs_diff(row.x).pow(2) + y.abs_diff(row.y).pow(2), *y, *x)).unwrap();
            let borrowed = &expected[(from.1 * WIDTH + from.0) as usize];
            assert!(found[at] == *borrowed, "({}, {}) is not {from:?}", row.x, row.y);
            assert_eq!(found[at].0[0].rgb, colour(*from), "light, not black");
        }
    }
}

#[test]
fn the_manifest_lists_holes_and_counts_their_texels_out_of_the_errors() {
    let (made, dir) = (made(None), tempfile::tempdir().unwrap());
    let report = made.assemble(&[5, 8], dir.path());
    let again: SurfaceReport = serde_json::from_str(&serde_json::to_string(&report).unwrap()).unwrap();
    assert_eq!(again, report);
    let manifest = made.manifest(&report, dir.path());
    let record = &manifest.surfaces[0];
    let rectangles: Vec<_> = record.holes.iter().map(|h| (h.tile, [h.x, h.y, h.width, h.height], h.reason.as_str())).collect();
    assert_eq!(rectangles, [(5, [64, 32, 32, 32], "failed"), (8, [64, 64, 32, 6], "failed")], "the texture ends within tile 8");
    let lost: u64 = record.holes.iter().map(|hole| u64::from(hole.covered)).sum();
    let counted: u64 = report.errors.iter().map(|(_, samples)| samples).sum();
    assert_eq!(counted, (record.covered - lost) * 8);
    assert_eq!(Manifest::from_bytes(&manifest.to_bytes().unwrap()).unwrap().surfaces[0].holes, record.holes);
    let whole = made.manifest(&made.assemble(&[], dir.path()), dir.path()).to_bytes().unwrap();
    assert!(!String::from_utf8(whole).unwrap().contains("holes"), "a whole package says nothing of holes");
}

#[test]
fn a_surface_without_any_tile_is_black_and_whole() {
    let (made, dir) = (made(Some(RawFormat::U8)), tempfile::tempdir().unwrap());
    let all: Vec<usize> = (0..9).collect();
    let report = made.assemble(&all, dir.path());
    let (order, raster) = (made.plan.order(0), made.raster());
    let found = texels(dir.path());
    for row in made.plan.surfaces[0].tiles.iter().flat_map(|tile| raster.tile(tile.cell)) {
        let mut samples = vec![[1; 3]; order.len()];
        kiln_proto::codec::pwl::decode_row(&found[(row.y * WIDTH + row.x) as usize].0, &order, &mut samples).unwrap();
        assert!(samples.iter().all(|rgb| *rgb == [0; 3]));
    }
    assert_eq!((report.colours, report.holes.len(), report.errors.len()), (1, 9, 0));
    assert_eq!(made.manifest(&report, dir.path()).surfaces[0].encoding.errors.max, 0);
}

#[test]
fn holes_that_are_no_tiles_are_refused() {
    let made = made(None);
    let with = |tiles: &[usize]| {
        let list = tiles.iter().map(|tile| Hole { tile: *tile, reason: String::new() }).collect();
        Holes::new(&made.scene, &made.plan, 0, list).is_ok()
    };
    assert_eq!([with(&[0, 8]), with(&[9]), with(&[3, 3])], [true, false, false]);
    assert!(Holes::new(&made.scene, &made.plan, 1, vec![]).is_err());
}
