//! What programs really write, and what no other test has.

use super::*;

fn said(parts: Vec<Part>) -> (Scene, Vec<String>) {
    let imported = import_parts(parts).unwrap();
    (imported.scene, imported.warnings.iter().map(ToString::to_string).filter(|w| !w.contains("emits light")).collect())
}

/// Surveys and photogrammetry keep map coordinates: half a metre is the step of 32-bit numbers there.
#[test]
fn models_far_from_the_origin_are_told() {
    let at = |x: f64, y: f64| format!("v {x} {y} 120.5\nv {} {y} 120.5\nv {x} {} 120.5\nf 1 2 3\n", x + 30.0, y + 30.0);
    let (_, far) = geometry(&at(500_123.456_7, 4_649_776.123_4));
    assert!(far.len() == 2 && far[1].contains("along y the vertices lie 4649806 from the origin"), "{far:?}");
    assert!(far[1].contains("are 0.5 apart") && far[1].contains("move it to the origin"), "{far:?}");
    assert_eq!(geometry(&at(100.0, -100.0)).1, [""; 0]);
    // A thin plate is thin, not lost.
    assert_eq!(geometry("v 0 0 100\nv 9 0 100.001\nv 0 9 100\nf 1 2 3\n").1, [""; 0]);
}

/// 3ds Max and MeshLab write what they could not compute.
#[test]
fn normals_and_coordinates_that_are_no_numbers_are_left_out() {
    let obj = format!("{SQUARE}vn -1.#IND -1.#IND -1.#IND\nvn -nan(ind) nan 0\nvt 1.#QNAN 0 0\nf 1/5/1 2/2/1 3/3/2\n");
    let (scene, said) = geometry(&obj);
    assert_eq!((scene.surfaces[0].normals.len(), scene.surfaces[0].uv(0, 0).unwrap()[0]), (0, [0.0; 2]));
    assert!(said.iter().any(|w| w.starts_with("a.obj:11: texture coordinates that are no numbers (nan) were taken as 0: 1")), "{said:?}");
    assert!(said.iter().any(|w| w.contains("normals without a length")), "{said:?}");
    // The third number, a depth, is not looked at.
    let (scene, said) = geometry(&format!("{SQUARE}vt 0.25 0.75 nan\nf 1/5 2/2 3/3\n"));
    assert_eq!((scene.surfaces[0].uv(0, 0).unwrap()[0], said), ([0.25, 0.75], vec![]));
    let errors = import_parts(vec![file("a.obj", "v nan 0 0\nv 1 0 0\nv 0 1,5 0\nf 1 2 3\n")]).unwrap_err();
    assert!(errors[0].starts_with("a.obj:1: the vertex has the value `nan`"), "{errors:?}");
    assert!(errors[1].contains("`1,5` where a number should be; decimals have a point, not a comma"), "{errors:?}");
}

/// An empty `map_Kd`, a colour with opacity, and an exponent of -1 stand in files that every viewer shows.
#[test]
fn harmless_slips_of_mtl_are_repaired() {
    let mtl = "newmtl m\nKe 1\nKd 0.5 0.25 0 1\nKs 0.1 0.1 0.1 1\nNs -1\nmap_Kd \nmap_Bump -bm 1\n";
    let (scene, said) = said(vec![file("a.obj", format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")), file("m.mtl", mtl)]);
    let Reflection::Phong(phong) = &scene.materials[0].reflection else { panic!() };
    assert_eq!((phong.diffuse, phong.lobe), (Rgb::new(0.5, 0.25, 0.0), kiln_proto::scene::Lobe::Phong { exponent: 0.0 }));
    let expected = [
        "m.mtl:3: Kd has a fourth number, which was ignored: opacity is `d` (said once)",
        "m.mtl:5: Ns is -1, but an exponent cannot be negative; it was taken as 0",
        "m.mtl:6: map_Kd names no file and was ignored",
        "m.mtl:7: map_Bump names no file and was ignored",
    ];
    assert_eq!(said, expected);
}

/// The colour's picture named again for opacity: it counts by its alpha channel, never by its brightness.
#[test]
fn the_colour_s_picture_is_no_opacity_by_its_brightness() {
    let look = |alpha: u8, map: &str| {
        let mut out = Cursor::new(vec![]);
        DynamicImage::from(RgbaImage::from_pixel(1, 1, Rgba([99, 9, 9, alpha]))).write_to(&mut out, ImageFormat::Png).unwrap();
        let mtl = format!("newmtl m\nKe 1\nmap_Kd x.png\nmap_d {map}\n");
        let obj = format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\n");
        let (scene, said) = said(vec![file("a.obj", obj), file("m.mtl", mtl), file("x.png", out.into_inner())]);
        (scene.materials[0].opacity, said)
    };
    let (opaque, said) = look(255, "x.png");
    assert_eq!((opaque, said.len()), (Opacity::OPAQUE, 1));
    assert!(said[0].starts_with("m.mtl:4: map_d is the picture of map_Kd, `x.png`, which has no transparent pixels"), "{said:?}");
    assert_eq!(look(99, "x.png").0.mode, AlphaMode::Blend);
    assert_eq!(look(255, "-imfchan r x.png").0.mode, AlphaMode::Blend, "a channel that is asked for counts");
}

/// tinyobjloader's option: colours are sRGB and numbers are not, whatever it says.
#[test]
fn the_space_of_colours_is_no_part_of_a_name() {
    let mut out = Cursor::new(vec![]);
    DynamicImage::from(RgbaImage::from_pixel(1, 1, Rgba([99; 4]))).write_to(&mut out, ImageFormat::Png).unwrap();
    let mtl = "newmtl m\nKe 1\nmap_Kd -colorspace sRGB x.png\nmap_Pr -colorspace linear x.png\nmap_Ke -colorspace linear x.png\n\
        map_Pm -colorspace sRGB x.png\n";
    let obj = format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3\n");
    let (_, said) = said(vec![file("a.obj", obj), file("m.mtl", mtl), file("x.png", out.into_inner())]);
    let odd: Vec<&String> = said.iter().filter(|w| w.contains("option")).collect();
    assert_eq!(odd.len(), 2, "{said:?}");
    assert!(odd[0].starts_with("m.mtl:5: the option `-colorspace linear` of map_Ke"), "{said:?}");
    assert!(odd[1].starts_with("m.mtl:6: the option `-colorspace sRGB` of map_Pm"), "{said:?}");
}

/// CAD programs write the whole tree of assemblies behind `g`.
#[test]
fn groups_have_names_of_any_length() {
    let long = "assembly ".repeat(300);
    let (scene, said) = geometry(&format!("{SQUARE}g {long}a\nf 1 2 3\ng {long}b\nf 1 3 4\n"));
    assert_eq!((scene.surfaces.len(), said), (2, vec![]));
    assert!(scene.surfaces.iter().all(|s| s.name.starts_with("assembly assembly") && s.name.len() < 200));
    let two = format!("{SQUARE}g {long}a\nusemtl steel\nf 1 2 3\nusemtl glass\nf 1 3 4\ng {}\nf 4 3 2\n", "ü".repeat(300));
    let names: Vec<String> = import_parts(vec![file("a.obj", two)]).unwrap().scene.surfaces.into_iter().map(|s| s.name).collect();
    assert!(names[0].ends_with("assembly a.steel") && names[1].ends_with("assembly a.glass"), "{names:?}");
    assert!(names[0].starts_with("assembly assembly") && names.iter().all(|n| (110..=128).contains(&n.chars().count())), "{names:?}");
    let errors = import_parts(vec![file("a.obj", format!("{SQUARE}usemtl {long}\nf 1 2 3\n"))]).unwrap_err();
    assert!(errors[0].starts_with("a.obj:9: the name has 2699 bytes; those of materials have at most 1024"), "{errors:?}");
}

#[test]
fn zbrush_paints_in_comments() {
    let text = |paint: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB {paint}\n# End of MRGB block\nf 1 2 3\n");
    let whole = text("ffff0000ff008000 ff0000ff");
    for whole in [whole.replace('\n', "\r"), whole.replace('\n', "\r\n"), whole] {
        let (scene, said) = geometry(&whole);
        let colors = scene.surfaces[0].colors[0].map(|i| scene.colors[i as usize]);
        assert_eq!(colors, [[1.0, 0.0, 0.0, 1.0], [0.0, math::srgb_eotf(128.0 / 255.0), 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]);
        assert_eq!(said, [""; 0]);
    }
    let (scene, said) = geometry(&text("ffff0000"));
    assert!(scene.surfaces[0].colors.len() == 1 && said[0].starts_with("a.obj:4: 2 of 3 vertices have no colour"), "{said:?}");
    let (scene, said) = geometry(&text("ffff000"));
    assert!(scene.surfaces[0].colors.is_empty() && said[0].starts_with("a.obj:4: polypaint (#MRGB) is not written in"), "{said:?}");
    let (_, said) = geometry(&text(&"ff00ff00".repeat(4)));
    assert!(said[0].starts_with("a.obj:4: there are 4 colours of polypaint for 3 vertices"), "{said:?}");
    let (_, said) = geometry(&text(&format!("{}zz", "ff00ff00".repeat(4))));
    assert!(said[0].starts_with("a.obj:4: polypaint (#MRGB) is not written in"), "{said:?}");
}

/// An outline from a drawing program: concave, and of more corners than any modelling program makes.
#[test]
fn faces_have_any_number_of_corners() {
    let teeth = 3_000;
    let tooth = |i: i32| format!("v {} 1 0\nv {} 0.1 0\n", 2 * i, 2 * i + 1);
    let corners: String = (0..teeth).map(tooth).collect();
    let face: String = (1..=2 * teeth + 2).rev().map(|i| format!(" {i}")).collect();
    let (scene, said) = geometry(&format!("{corners}v {} 0 0\nv 0 0 0\nf{face}\n", 2 * teeth));
    assert_eq!((scene.surfaces[0].triangles.len(), said), (2 * teeth as usize, vec![]));
}
