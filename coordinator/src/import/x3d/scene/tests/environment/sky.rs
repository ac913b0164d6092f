//! Where what the textures of an EnvironmentLight show comes to lie, and what is no picture of a sky.

use super::*;
use image::Rgb32FImage;

#[test]
fn the_six_faces_lie_as_those_of_a_background() {
    let map = environment(under(cube()));
    assert_eq!((map.width, map.height), (256, 128), "edges of faces are sharper than their pixels");
    for (face, _, colour, direction) in FACES {
        assert!(is(seen(&map, direction), colour), "{face}");
    }
    // Named without `Texture` in X3D 3.
    let old = node("ComposedCubeMapTexture", FACES.map(|(field, image, ..)| (&field[..field.len() - 7], pixel(image))));
    assert_eq!(environment(under(old)), map);
}

/// The right upper pixel of each face, from the lower left on.
#[test]
fn faces_are_upright_and_not_mirrored_seen_from_within() {
    let places = [[0.5, 0.5, -1.0], [-0.5, 0.5, 1.0], [-1.0, 0.5, -0.5], [1.0, 0.5, 0.5], [0.5, 1.0, 0.5], [0.5, -1.0, -0.5]];
    for (marked, place) in places.into_iter().enumerate() {
        let image = |at| if at == marked { "2 2 3 0 0 0 0xFF0000" } else { "2 2 3 0 0 0 0" };
        let faces = FACES.iter().enumerate().map(|(at, (field, ..))| (*field, pixel(image(at))));
        let map = environment(under(node("ComposedCubeMapTexture", faces)));
        assert!(seen(&map, place)[0] > 0.95, "{}", FACES[marked].0);
        let lit: Vec<usize> = (0..6).filter(|at| seen(&map, places[*at])[0] > 0.0).collect();
        assert_eq!(lit, [marked]);
    }
}

#[test]
fn a_panorama_keeps_its_texels_and_looks_at_the_front() {
    for kind in ["ImageCubeMapTexture", "ImageTexture"] {
        let map = environment(under(picture(kind, 4, &PANORAMA)));
        assert_eq!((map.width, map.height), (4, 2), "{kind}");
        assert!((map.rotation - FRAC_PI_2).abs() < 1e-6);
        assert_eq!(map.rgb, [BLACK, BLACK, BLACK, RED, BLACK, WHITE, WHITE, BLACK]);
        assert_eq!((seen(&map, [0.1, 0.5, -1.0]), seen(&map, [-0.1, 0.5, -1.0])), (WHITE, WHITE));
        assert_eq!(seen(&map, [0.5, -0.5, 1.0]), RED, "right of the front, and behind");
    }
    let turned = environment(under(picture("ImageTexture", 4, &PANORAMA)).with("rotation", One("0 2 0 1")));
    assert!((turned.rotation - FRAC_PI_2 - 1.0).abs() < 1e-6 && turned.rgb[3] == RED);
    let tilted = environment(under(picture("ImageTexture", 4, &PANORAMA)).with("rotation", One("1 0 0 3.141592653589793")));
    assert_eq!(tilted.rotation, 0.0);
    assert!(seen(&tilted, [0.0, -0.5, 1.0])[0] > 0.5 && seen(&tilted, [0.0, 0.5, 1.0])[0] < 0.2, "{tilted:?}");
}

#[test]
fn crosses_are_cut_into_faces() {
    const K: [u8; 3] = [9; 3];
    let [f, b, l, r, t, u] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [0, 255, 255], [255, 0, 255], [255, 255, 0]];
    let whole = environment(under(cube()));
    let lying = [K, t, K, K, l, f, r, b, K, u, K, K];
    assert_eq!(environment(under(picture("ImageCubeMapTexture", 4, &lying))), whole);
    let standing = [K, t, K, l, f, r, K, u, K, K, b, K];
    assert_eq!(environment(under(picture("ImageCubeMapTexture", 3, &standing))), whole);
    // In a standing cross the back is on its head: what is up there lies at its lower edge.
    let mut pixels = vec![[0; 3]; 6 * 8];
    pixels[7 * 6 + 2] = [255; 3];
    let map = environment(under(picture("ImageCubeMapTexture", 6, &pixels)));
    assert!(seen(&map, [-0.5, 0.5, 1.0])[0] > 0.95, "left below in the picture is right above in the world");
    refused(under(picture("ImageCubeMapTexture", 5, &[[0; 3]; 35])), "5x7 pixels: it is no panorama (2:1) and no cross");
}

#[test]
fn what_is_no_picture_of_a_sky_is_named() {
    let with = |cube: Node| under(cube);
    let missing = node("ComposedCubeMapTexture", FACES[1..].iter().map(|(field, image, ..)| (*field, pixel(image))));
    let map = environment(with(missing.clone()));
    assert!(is(seen(&map, [0.0, 0.0, -1.0]), BLACK) && is(seen(&map, [0.0, 0.0, 1.0]), [0.0, 1.0, 0.0]));
    warned(with(missing.clone()), "no frontTexture; there it is black");
    let unequal = missing.clone().with("frontTexture", pixel("2 2 3 1 2 3 4"));
    refused(with(unequal), "the backTexture has 1x1 pixels, the frontTexture 2x2; faces of a cube are equal");
    refused(with(missing.with("frontTexture", pixel("2 1 3 1 2"))), "the frontTexture has 2x1 pixels; faces of a cube are square");
    for (nothing, wanted) in [
        (node("ComposedCubeMapTexture", []), "no faces; the EnvironmentLight was left out"),
        (node("GeneratedCubeMapTexture", []), "GeneratedCubeMapTexture cannot be an environment"),
    ] {
        assert!(scene_of(&[with(nothing.clone()), shape(vec![])]).environment.is_none());
        warned(with(nothing), wanted);
    }
    refused(with(node("ImageCubeMapTexture", [("url", Texts(&["sky.png"]))])), "`sky.png` is not in the bundle");
    refused(with(node("ImageCubeMapTexture", [])), "ImageCubeMapTexture has no url");
    let dds = "data:application/octet-stream;base64,RERTIHwAAAA=";
    refused(with(node("ImageCubeMapTexture", [("url", Texts(Box::leak(Box::new([dds]))))])), "is a DDS file, which is not read");
    let both: Vec<&str> = [dds].iter().chain(data(4, &PANORAMA)).copied().collect();
    assert_eq!(environment(with(node("ImageCubeMapTexture", [("url", Texts(both.leak()))]))).rgb[3], RED, "the next address is read");
}

/// An HDR panorama beside the file: radiance as it is, whatever its name says.
#[test]
fn pictures_with_radiance_are_read_from_the_bundle() {
    let image = Rgb32FImage::from_pixel(4, 2, image::Rgb([4.0, 2.0, 0.5]));
    let mut bytes = Cursor::new(vec![]);
    DynamicImage::from(image).write_to(&mut bytes, ImageFormat::Hdr).unwrap();
    let root = under(node("ImageCubeMapTexture", [("url", Texts(&["sky%20one.hdr"]))])).with("intensity", One("3"));
    for (name, text) in files(&[root, shape(vec![])]) {
        let part = |name: &str, bytes: &[u8]| Part { name: name.into(), content: Content::Bytes(bytes.to_vec()) };
        let parts = vec![part(name, text.as_bytes()), part("sky one.hdr", bytes.get_ref())];
        let bundle = Bundle::from_parts(parts, Some(name), &std::env::temp_dir()).unwrap();
        let imported = import_bundle(&bundle, &ImportOptions::default()).unwrap();
        assert!(is(seen(&imported.scene.environment.unwrap(), [0.0, 1.0, 0.0]), [12.0, 6.0, 1.5]), "{name}");
        // The options' environment comes first.
        let options = ImportOptions { environment: Some("sky one.hdr".into()), ..ImportOptions::default() };
        let imported = import_bundle(&bundle, &options).unwrap();
        assert!(is(imported.scene.environment.unwrap().rgb[0], [4.0, 2.0, 0.5]));
        assert!(imported.warnings.iter().any(|w| w.message.contains("`EnvironmentLight` gives way")), "{:?}", imported.warnings);
    }
}

#[test]
fn an_empty_face_is_a_missing_one() {
    let empty = || Child(node("PixelTexture", []));
    let rest = FACES[1..].iter().map(|(field, image, ..)| (*field, pixel(image)));
    let cube = node("ComposedCubeMapTexture", rest.chain([("frontTexture", empty())]));
    let map = environment(under(cube.clone()));
    assert!(is(seen(&map, [0.0, 0.0, -1.0]), BLACK) && is(seen(&map, [0.0, 0.0, 1.0]), [0.0, 1.0, 0.0]));
    warned(under(cube), "the frontTexture has no pixels; there it is black");
    let nothing = light([("specularTexture", empty())]);
    assert!(scene_of(&[nothing.clone(), shape(vec![])]).environment.is_none());
    warned(nothing, "PixelTexture has no pixels; the EnvironmentLight was left out");
}

/// What is skipped was named; of the empty node in its place nothing is said.
#[test]
fn a_texture_that_stands_in_for_another_is_passed_over() {
    let film = node("MovieTexture", [("url", Texts(&["a.mpg"]))]);
    let textures = Children(vec![film, node("PixelTexture", [("image", One("1 1 3 0x808080"))])]);
    let root = shape(vec![("texture", Child(node("MultiTexture", [("texture", textures)])))]);
    let said = warnings(&[root, light([])], &ImportOptions::default());
    assert!(said.iter().any(|w| w.contains("`MovieTexture` is not supported")), "{said:?}");
    assert!(!said.iter().any(|w| w.contains("has no pixels")), "{said:?}");
}

/// One light in five places: its picture is read once, and what is odd about it is said once.
#[test]
fn a_light_that_stands_in_many_places_is_read_once() {
    let sky = node("ImageTexture", [("url", Texts(data(4, &[[255; 3]; 8]))), ("flipVertically", One("TRUE"))]);
    let place = |turn: &'static str, light: Value| node("Transform", [("rotation", One(turn)), ("children", light)]);
    let mut roots = vec![place("0 1 0 0", Children(vec![under(sky).def("Sky")]))];
    roots.extend((0..3).map(|_| place("0 1 0 0", Uses("EnvironmentLight", "Sky"))));
    roots.extend([place("1 0 0 3.141592653589793", Uses("EnvironmentLight", "Sky")), shape(vec![])]);
    let said = warnings(&roots, &ImportOptions::default());
    assert!(said.iter().any(|w| w.contains("flipVertically was not used in pictures of an environment: 1, here")), "{said:?}");
    let map = scene_of(&roots).environment.unwrap();
    assert!(map.rgb.iter().all(|texel| is(*texel, [5.0; 3])), "{map:?}");
    // And one that cannot be read is one error.
    let gone = under(node("ImageTexture", [("url", Texts(&["gone.png"]))])).def("Gone");
    let roots = [place("0 1 0 0", Children(vec![gone])), place("0 1 0 0", Uses("EnvironmentLight", "Gone")), shape(vec![])];
    for errors in refusals(&roots) {
        assert_eq!(errors.len(), 1, "{errors:?}");
    }
}

/// The name says HDR, the bytes say PNG.
#[test]
fn pictures_are_known_by_their_bytes_whatever_they_are_called() {
    let png = BASE64_STANDARD.decode(data(4, &PANORAMA)[0].rsplit(',').next().unwrap()).unwrap();
    for name in ["front.pic", "sky.hdr"] {
        let root = under(node("ImageTexture", [("url", Texts(Box::leak(Box::new([name]))))]));
        for (main, text) in files(&[root, shape(vec![])]) {
            let scene = import_files(&[(main, text.as_bytes()), (name, &png)], &ImportOptions::default()).unwrap().0;
            assert_eq!(scene.environment.unwrap().rgb[3], RED, "{name} in {main}");
        }
    }
}

/// What the options replace is not read, and so cannot be at fault.
#[test]
fn an_environment_that_gives_way_refuses_nothing() {
    let image = Rgb32FImage::from_pixel(4, 2, image::Rgb([4.0, 2.0, 0.5]));
    let mut bytes = Cursor::new(vec![]);
    DynamicImage::from(image).write_to(&mut bytes, ImageFormat::Hdr).unwrap();
    let options = ImportOptions { environment: Some("SKY.hdr".into()), ..ImportOptions::default() };
    let root = under(node("ImageTexture", [("url", Texts(&["gone.png"]))])).with("intensity", One("-1")).def("Own");
    for (main, text) in files(&[root, shape(vec![])]) {
        let (scene, warnings) = import_files(&[(main, text.as_bytes()), ("sky.hdr", bytes.get_ref())], &options).unwrap();
        assert_eq!(scene.environment.unwrap().name, "sky.hdr");
        assert!(warnings.iter().any(|w| w.starts_with(&format!("{main}:")) && w.contains("`Own` gives way")), "{warnings:?}");
        let near = "the environment `SKY.hdr` is not in the bundle; `sky.hdr` is used instead";
        assert!(warnings.iter().any(|w| w.contains(near)), "{warnings:?}");
    }
}
