use super::*;
use kiln_proto::{
    scene::{AlphaMode, LayerMode, Lobe, Opacity, Phong, Reflection, TextureLayer, TextureRef},
    units::Rgb,
};
use proptest::prelude::*;
use std::path::PathBuf;

fn bundle_of(files: &[(&str, &[u8])], main: &str) -> Bundle {
    let parts = files.iter().map(|(name, bytes)| Part { name: (*name).into(), content: Content::Bytes(bytes.to_vec()) }).collect();
    Bundle::from_parts(parts, Some(main), &std::env::temp_dir()).unwrap()
}

fn import_files(files: &[(&str, &str)]) -> Result<Imported, Vec<Problem>> {
    let files: Vec<(&str, &[u8])> = files.iter().map(|(n, t)| (*n, t.as_bytes())).collect();
    import_bundle(&bundle_of(&files, files[0].0), &ImportOptions::default())
}

fn shown(problems: &[Problem]) -> Vec<String> {
    problems.iter().map(ToString::to_string).collect()
}

fn own(name: &str) -> Result<Imported, Vec<Problem>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/scenes/obj").join(name);
    let (bundle, _) = bundle::collect(&path, None, &std::env::temp_dir()).unwrap();
    import_bundle(&bundle, &ImportOptions::default())
}

#[test]
fn a_scene_whose_z_is_up_is_turned_whole() {
    let files = [("a.obj", "v 0 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 5\nf 1 2 3\nf 1 2 4\n".as_bytes())];
    let options = ImportOptions { up: kiln_proto::options::UpAxis::Z, ..ImportOptions::default() };
    let Imported { scene, statistics, .. } = import_bundle(&bundle_of(&files, "a.obj"), &options).unwrap();
    assert_eq!((statistics.low, statistics.high), ([0.0, 0.0, -3.0], [2.0, 5.0, 0.0]));
    let [a, b, c] = scene.corners(&scene.surfaces[0].triangles[0]);
    assert_eq!((b - a).cross(c - a).normalize(), glam::DVec3::Y, "its floor faces up");
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn phong_of<'a>(scene: &'a Scene, surface: &str) -> &'a Phong {
    match &scene.materials[scene.surface(surface).unwrap().1.parts[0].material as usize].reflection {
        Reflection::Phong(phong) => phong,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_awkward_file_imports_with_everything_said() {
    let Imported { scene, warnings, statistics } = own("awkward.obj").unwrap();
    assert_eq!(statistics.surfaces, ["floor plan", "lamp.glow", "lamp.chrome"]);
    assert_eq!(scene.surfaces.iter().map(|s| s.triangles.len()).collect::<Vec<_>>(), [3, 2, 1]);
    assert_eq!(scene.surfaces.iter().map(|s| s.file_stem.as_str()).collect::<Vec<_>>(), ["floor_plan", "lamp.glow", "lamp.chrome"]);
    assert_eq!((statistics.materials, statistics.textures, statistics.emissive_triangles), (3, 1, 2));
    assert_eq!((statistics.low, statistics.high), ([0.0, 0.0, -4.0], [4.0, 3.0, 0.0]));
    let chrome = &scene.materials[scene.surface("lamp.chrome").unwrap().1.parts[0].material as usize];
    let Reflection::MetallicRoughness(metal) = &chrome.reflection else { panic!("{chrome:?}") };
    assert_eq!((metal.roughness, chrome.opacity), (0.1, Opacity { mode: AlphaMode::Blend, factor: 0.5, texture: None }));
    let board = phong_of(&scene, "floor plan");
    let checker = TextureLayer { texture: TextureRef::plain(0, 0), mode: LayerMode::Modulate { scale: 1.0 } };
    assert_eq!((board.layers.as_slice(), board.lobe), (&[checker][..], Lobe::Phong { exponent: 40.0 }));
    assert!((board.diffuse.r - 2.0 / 3.0).abs() < 1e-6 && (board.specular.r - 1.0 / 3.0).abs() < 1e-6);
    // Kd + Ks = 1.5 was scaled to one; the texture's bottom row comes first and begins dark.
    assert_eq!(&scene.textures[0].texels[..6], [40, 40, 60, 230, 230, 230]);
    let expected = [
        "awkward paint.mtl:7: the bump map `bumps.png` is not in the bundle",
        "awkward paint.mtl:11: Ks and Ns of materials with numbers of the PBR extension",
        "awkward paint.mtl:3: the material `checker board` reflects 1.5 times",
        "awkward.obj:35: the statement `curv2`",
        "awkward.obj:33: points and lines were ignored, only faces are surfaces: 2",
        "awkward.obj:26: triangles that repeat another one exactly were dropped: 1",
        "awkward.obj:27: triangles without area were dropped: 1",
    ];
    let said = shown(&warnings);
    for wanted in expected {
        assert!(said.iter().any(|w| w.starts_with(wanted)), "{wanted} is not in {said:#?}");
    }
    assert_eq!(said.len(), expected.len(), "{said:#?}");
}

#[test]
fn every_fault_of_a_broken_file_is_located() {
    let problems = own("broken.obj").unwrap_err();
    let lines: Vec<Option<u32>> = problems.iter().map(|p| p.line).collect();
    assert_eq!(lines, (4..=13).map(Some).collect::<Vec<_>>(), "{:#?}", shown(&problems));
    assert!(problems.iter().all(|p| p.file.as_deref() == Some("broken.obj")));
}

#[test]
fn a_missing_texture_names_file_and_line() {
    assert_eq!(shown(&own("missing-texture.obj").unwrap_err()), ["missing-texture.mtl:3: the texture `bricks.png` is not in the bundle"]);
}

#[test]
fn surfaces_are_named_by_objects_then_groups_then_the_file() {
    let names = |text: &str| import_files(&[("room.obj", &format!("{TRIANGLE}v 0 0 1\n{text}"))]).unwrap().statistics.surfaces;
    assert_eq!(names("f 1 2 3"), ["room"]);
    assert_eq!(names("g wall left\nf 1 2 3\ng floor\nf 1 2 4\ng wall left\nf 2 3 4"), ["wall left", "floor"]);
    assert_eq!(names("g ignored\no one\nf 1 2 3\ng other\nf 1 2 4\no two\nf 2 3 4"), ["one", "two"]);
    assert_eq!(names("o a\nusemtl m\nf 1 2 3\nusemtl n\nf 1 2 4\no a.m\nf 2 3 4"), ["a.m", "a.n", "a.m-2"]);
}

#[test]
fn what_is_missing_or_unknown_is_repaired_and_said() {
    let text = format!("mtllib gone.mtl\n{TRIANGLE}usemtl gone\nf 1 2 3\nusemtl gone\nf 3 2 1");
    let imported = import_files(&[("a.obj", &text)]).unwrap();
    let said = shown(&imported.warnings);
    assert_eq!(said.len(), 3, "{said:#?}");
    assert!(said[0].starts_with("a.obj:1: the material library `gone.mtl`"));
    assert!(said[1].starts_with("a.obj:5: the material `gone`"));
    assert!(said[2].starts_with("a.obj: nothing in the scene emits light"));
    assert_eq!(phong_of(&imported.scene, "a").diffuse, Rgb::splat(0.5));
    assert_eq!(imported.scene.triangle_count(), 2, "the back of a triangle is no duplicate");
}

#[test]
fn near_misses_in_file_names_are_found() {
    let obj = format!("mtllib C:\\work\\Lib.MTL\n{TRIANGLE}usemtl m\nf 1 2 3");
    let said = shown(&import_files(&[("a.obj", &obj), ("mats/lib.mtl", "newmtl m\nKe 1")]).unwrap().warnings);
    assert_eq!(said, ["a.obj:1: the material library `C:\\work\\Lib.MTL` is not in the bundle; `mats/lib.mtl` is used instead"]);
}

/// An emitter, so that warnings are those of the material under test.
fn material(mtl: &str) -> Result<(kiln_proto::scene::Material, Vec<String>), Vec<String>> {
    let obj = format!("mtllib m.mtl\n{TRIANGLE}usemtl m\nf 1 2 3");
    let imported = import_files(&[("a.obj", &obj), ("m.mtl", &format!("newmtl m\nKe 1 1 1\n{mtl}"))]).map_err(|e| shown(&e))?;
    Ok((imported.scene.materials[0].clone(), shown(&imported.warnings)))
}

#[test]
fn illumination_models_decide_the_lobe() {
    let lobe = |mtl: &str| {
        let (m, warnings) = material(mtl).unwrap();
        assert_eq!(warnings, [""; 0]);
        let Reflection::Phong(phong) = m.reflection else { panic!("{m:?}") };
        (phong.specular.r, phong.lobe)
    };
    let phong = |exponent| Lobe::Phong { exponent };
    assert_eq!(lobe("Ks 0.5\nNs 20\nillum 2"), (0.5, phong(20.0)));
    assert_eq!(lobe("Ks 0.5 0.5 0.5\nNs 20"), (0.5, phong(20.0)));
    assert_eq!(lobe("Ks 0.5\nNs 20\nillum 1"), (0.0, phong(1.0)));
    assert_eq!(lobe("Ks 0.5\nNs 20\nillum 3"), (0.5, phong(20.0)));
    assert_eq!(lobe("Ks 0.5\nNs 1000\nillum 5"), (0.5, Lobe::Mirror));
    assert_eq!(lobe("Ks 0.5\nillum 3"), (0.5, Lobe::Mirror));
}

#[test]
fn bad_material_values_are_located() {
    for (mtl, wanted) in [
        ("Kd 1 -1 1", "m.mtl:3: Kd is -1"),
        ("Kd nan 1 1", "m.mtl:3: Kd has the value `nan`"),
        ("Kd 1 1", "m.mtl:3: Kd has 2 numbers"),
        ("Kd", "m.mtl:3: Kd has 0 numbers"),
        ("Ks spectral a.rfl", "m.mtl:3: Ks is given as `spectral`"),
        ("Ns x", "m.mtl:3: Ns has `x`"),
        ("d inf", "m.mtl:3: d has the value `inf`"),
        ("illum two", "m.mtl:3: illum has `two`"),
        ("norm a.png", "m.mtl:3: the texture `a.png` is not in the bundle"),
        ("map_Kd a.obj", "m.mtl:3: the image `a.obj` is not an image"),
        ("newmtl", "m.mtl:3: a material's name"),
    ] {
        let problems = material(mtl).unwrap_err();
        assert!(problems.len() == 1 && problems[0].starts_with(wanted), "{mtl}: {problems:?}");
    }
}

#[test]
fn questionable_materials_are_warned_of() {
    for (mtl, wanted) in [
        ("d 0.75\nTr 0.5", "m.mtl:4: the material `m` is 0.75 opaque by `d` and 0.5 by `Tr`"),
        ("d 0", "m.mtl:3: the material `m` is invisible"),
        ("Pr 1.5", "m.mtl:3: Pr is 1.5"),
        ("Ns -1", "m.mtl:3: Ns is -1"),
        ("map_Kd -clamp on", "m.mtl:3: map_Kd names no file"),
        ("aniso 0.5", "m.mtl:3: `aniso` (anisotropy) is not supported"),
        ("bump a.png", "m.mtl:3: the bump map `a.png` is not in the bundle"),
        ("d 0.25\nillum 9", "m.mtl:4: the material `m` is glass"),
        ("Kd 1\nKs 1", "m.mtl:4: the material `m` reflects 2 times"),
        ("newmtl m\nKe 2", "m.mtl:3: the material `m` was already defined at m.mtl:1"),
        ("disp a.png\ndisp b.png", "m.mtl:3: `disp` (displacement) is not supported"),
    ] {
        let (_, warnings) = material(mtl).unwrap();
        assert!(warnings.len() == 1 && warnings[0].starts_with(wanted), "{mtl}: {warnings:?}");
    }
    assert_eq!(material("newmtl m\nKe 2").unwrap().0.emission, Rgb::splat(2.0), "the last definition counts");
}

#[test]
fn texture_coordinates_survive_or_are_dropped_whole() {
    let text = format!("{TRIANGLE}v 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 2 4\nf 2/3/9 3/2/9 4/1/9");
    let imported = import_files(&[("a.obj", &text)]).unwrap();
    let uv: Vec<_> = imported.scene.surfaces[0].uv_sets[0].clone();
    let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    assert_eq!(uv, [Some(corners), None, Some([corners[2], corners[1], corners[0]])]);
}

#[test]
fn equal_scenes_have_equal_bytes_however_they_are_written() {
    let one = format!("{TRIANGLE}f 1 2 3");
    let two = "# other\r\nvn 0 0 1\r\nv -0.0 0 0 # origin\r\nv 1e0 0 0\r\nv 0 1.000 0\r\nv 7 7 7\r\nf -4//1 -3//1 -2//1\r\n";
    let bytes = |text: &str| import_files(&[("a.obj", text)]).unwrap().scene.to_bytes().unwrap();
    assert_eq!(bytes(&one), bytes(two));
}

#[test]
fn faces_may_come_before_their_vertices_but_not_without_them() {
    let forward = format!("{}{TRIANGLE}", "f 1 2 3\nf 3 2 1\n".repeat(2_000));
    let imported = import_files(&[("a.obj", &forward)]).unwrap();
    assert_eq!(imported.scene.triangle_count(), 2);
    let short = format!("{}f 1 2 4\n{TRIANGLE}", "f 1 2 3\n".repeat(2_000));
    assert_eq!(shown(&import_files(&[("a.obj", &short)]).unwrap_err()), ["a.obj:2001: the face uses vertex 4, but only 3 are defined"]);
}

#[test]
fn other_formats_are_refused_by_name() {
    for (name, text) in [("a.obj", "Kaydara FBX Binary"), ("a.obj", "<?xml version='1.0'?><COLLADA/>")] {
        let problems = import_files(&[(name, text)]).unwrap_err();
        assert!(problems[0].message.contains("Wavefront OBJ") && problems[0].file.as_deref() == Some("a.obj"));
    }
    assert!(shown(&import_files(&[("a.obj", "")]).unwrap_err())[0].contains("no faces"));
}

const SEED_OBJ: &str = "mtllib m.mtl\no a b\nv 0 0 0 1\nv 0 0 2 1 0 0\ns 1\nv 1 0 0\nv 1 1 0\nv .5 .2 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
    usemtl m\nf 1/1/1 2/2/1 3/3/1\nf 1 2 3 \\\n 4 5\ng x\nusemtl n\nf -1//1 -2//1 -3//1\ns 1\np 1\n";
const SEED_MTL: &str = "newmtl m\nKd 0.5 0.5 0.5\nKs 0.1\nNs 20\nillum 2\nd 1\nTr 0\nmap_Kd -s 1 1 1 t.png\nmap_Ns t.png\nmap_d -imfchan r t.png\nbump t.png\n\
    newmtl n\nKe 1 2 3\nillum 3\nPr 0.5\nPc 1\nmap_Pm -mm 0 1 t.png\nnorm -bm 2 t.png\n";

/// A copy of `seed` with random bytes replaced, removed, doubled or taken from a list of awkward words.
fn mutate(seed: &[u8], edits: &[(u16, u8, u8)]) -> Vec<u8> {
    const WORDS: [&str; 12] = ["nan", "-1", "0", "1e99", "/", "\\\n", "\r", "f ", "\0", "é", "99999999999999999999", "\nmtllib "];
    let mut bytes = seed.to_vec();
    for (at, kind, value) in edits {
        let at = usize::from(*at) % (bytes.len() + 1);
        match kind % 5 {
            0 if at < bytes.len() => bytes[at] = *value,
            1 if at < bytes.len() => drop(bytes.remove(at)),
            2 => bytes.insert(at, *value),
            3 => bytes.truncate(at),
            _ => drop(bytes.splice(at..at, WORDS[usize::from(*value) % WORDS.len()].bytes())),
        }
    }
    bytes
}

fn edits() -> impl Strategy<Value = Vec<(u16, u8, u8)>> {
    prop::collection::vec(any::<(u16, u8, u8)>(), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// No bytes make the import panic; what it accepts is valid and survives its canonical form, what it refuses is located.
    #[test]
    fn mutated_scenes_never_panic(obj in edits(), mtl in prop::option::of(edits())) {
        let obj = mutate(SEED_OBJ.as_bytes(), &obj);
        let mtl = mtl.map_or(SEED_MTL.as_bytes().to_vec(), |e| mutate(SEED_MTL.as_bytes(), &e));
        let png = std::fs::read(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/scenes/obj/checker board.png")).unwrap();
        match import_bundle(&bundle_of(&[("a.obj", &obj), ("m.mtl", &mtl), ("t.png", &png)], "a.obj"), &ImportOptions::default()) {
            Ok(imported) => {
                prop_assert_eq!(imported.scene.validate(), Ok(()));
                let bytes = imported.scene.to_bytes().unwrap();
                prop_assert_eq!(Scene::from_bytes(&bytes).unwrap(), imported.scene);
            }
            Err(problems) => prop_assert!(!problems.is_empty() && problems.iter().all(|p| p.file.is_some()), "{problems:?}"),
        }
    }
}
