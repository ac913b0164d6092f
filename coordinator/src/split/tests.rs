use super::*;
use crate::import::{Content, Part, import_bundle};
use kiln_proto::{
    scene::{Reflection, Scene},
    settings::SettingsPatch,
};
use std::{collections::BTreeMap, path::PathBuf};

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/scenes").join(name)
}

fn scene(name: &str, files: &[&str]) -> Scene {
    let parts = files.iter().map(|f| Part { name: (*f).into(), content: Content::File(folder(name).join(f)) }).collect();
    let bundle = crate::import::Bundle::from_parts(parts, None, &std::env::temp_dir()).unwrap();
    let imported = import_bundle(&bundle, &kiln_proto::options::ImportOptions::default()).unwrap();
    assert_eq!(imported.warnings, []);
    imported.scene
}

fn nominal(name: &str) -> BakeSettings {
    let text = std::fs::read_to_string(folder(name).join("nominal.json")).unwrap();
    serde_json::from_str::<SettingsPatch>(&text).unwrap().resolve().unwrap()
}

fn covered(scene: &Scene, plan: &Plan) -> BTreeMap<String, u64> {
    scene.surfaces.iter().zip(&plan.surfaces).map(|(s, p)| (s.name.clone(), p.covered)).collect()
}

/// The counts are those of an independent rasteriser (numpy, first triangle with tolerance 1e-9) of the same file.
#[test]
fn the_thesis_room_covers_what_it_should() {
    let scene = scene("thesis-room", &["thesis.obj", "thesis.mtl"]);
    let (plan, warnings) = make_plan(&scene, SceneHash::of(b""), &nominal("thesis-room")).unwrap();
    assert_eq!(warnings, []);
    let expected = [
        ("wall_side", 20_000),
        ("wall_front", 20_000),
        ("floor", 40_000),
        ("box_front", 84_096),
        ("box_back", 84_096),
        ("prism", 201_396),
        ("light", 64),
    ];
    assert_eq!(covered(&scene, &plan), expected.map(|(n, c)| (n.to_owned(), c)).into());
    assert_eq!(plan.surfaces.iter().map(|s| s.size.texels()).sum::<u64>(), 522_208);
}

#[test]
fn the_cornell_room_covers_what_it_should() {
    let scene = scene("cornell-room", &["cornell.obj", "cornell.mtl"]);
    let (plan, _) = make_plan(&scene, SceneHash::of(b""), &nominal("cornell-room")).unwrap();
    let counts: Vec<u64> = plan.surfaces.iter().map(|s| s.covered).collect();
    assert_eq!(counts, [40_000, 65_536, 65_536, 65_536, 65_536, 58_072, 58_072, 64]);
}

/// Tiles are in Morton order, hold every covered texel once, and agree with the raster texel by texel.
#[test]
fn tiles_hold_every_covered_texel_once() {
    let scene = scene("thesis-room", &["thesis.obj", "thesis.mtl"]);
    let mut settings = nominal("thesis-room");
    settings.texel_scale = 0.2;
    let (plan, _) = make_plan(&scene, SceneHash::of(b""), &settings).unwrap();
    for (surface, layout) in scene.surfaces.iter().zip(&plan.surfaces) {
        assert!(layout.tiles.windows(2).all(|w| w[0].cell.morton() < w[1].cell.morton()));
        let raster = SurfaceRaster::new(&scene, surface, layout, settings.frame);
        let texels = (0..layout.size.height).flat_map(|y| (0..layout.size.width).map(move |x| (x, y)));
        assert_eq!(texels.filter(|(x, y)| raster.texel(*x, *y).is_some()).count() as u64, layout.covered, "{}", surface.name);
    }
}

#[test]
fn a_plan_without_a_texel_is_refused_and_a_surface_without_one_is_named() {
    let mut scene = scene("thesis-room", &["thesis.obj", "thesis.mtl"]);
    let mut settings = nominal("thesis-room");
    settings.texture_sizes.clear();
    scene.surfaces.retain(|s| s.name == "light");
    settings.texture_sizes.insert("light".into(), "1x1".parse().unwrap());
    let mut planned = |factor: f32| {
        for uv in scene.surfaces[0].uv_sets[0].iter_mut().flatten() {
            *uv = uv.map(|c| c.map(|v| v * factor));
        }
        make_plan(&scene, SceneHash::of(b""), &settings)
    };
    // The light's chart shrinks into a corner of the only texel, beside its centre, then into nothing.
    assert_eq!(planned(0.25).unwrap().0.covered(), 1);
    assert!(planned(1e-3).unwrap_err().message.contains("texel_scale"));
}

/// 1,100 x 1,100 texels of 64 x 64 directions are more than 32 bits count, and only gloss keeps so many.
#[test]
fn more_samples_than_a_file_addresses_are_told_before_the_bake() {
    let mut scene = scene("thesis-room", &["thesis.obj", "thesis.mtl"]);
    scene.surfaces.retain(|s| s.name == "floor");
    let material = scene.surfaces[0].parts[0].material as usize;
    let mut settings = nominal("thesis-room");
    settings.directions = "64x64".parse().unwrap();
    settings.texture_sizes = BTreeMap::from([("floor".to_owned(), "1100x1100".parse().unwrap())]);
    let mut ask = |gloss: f32, rule| {
        if let Reflection::Phong(phong) = &mut scene.materials[material].reflection {
            phong.specular = kiln_proto::units::Rgb::splat(gloss);
        }
        settings.rule = rule;
        make_plan(&scene, SceneHash::of(b""), &settings).map(|(_, warnings)| warnings.into_iter().map(|w| w.message).collect::<Vec<_>>())
    };
    let warned = ask(0.1, Rule::Bounded { eps: 2 }).unwrap();
    assert!(warned.len() == 1 && warned[0].contains("`floor`") && warned[0].contains("4294967295"), "{warned:?}");
    assert!(ask(0.1, Rule::Thesis { threshold: 0 }).unwrap_err().message.contains("lossless"));
    assert_eq!(ask(0.0, Rule::Thesis { threshold: 0 }).unwrap(), Vec::<String>::new());
}
