//! EnvironmentLight: every field from each encoding, and where what its textures show comes to lie.

mod sky;

use super::{Node, Value::*, *};
use crate::import::x3d::{X3dEncoding, rewrite};
use base64::{Engine, prelude::BASE64_STANDARD};
use image::{DynamicImage, ImageFormat, RgbImage};
use kiln_proto::{
    math,
    options::{LightUnits, ShadowMode, UpAxis},
    scene::Environment,
};
use std::{
    f32::consts::{FRAC_PI_2, PI},
    io::Cursor,
};

fn light(fields: impl IntoIterator<Item = (&'static str, Value)>) -> Node {
    node("EnvironmentLight", fields)
}

fn environment(root: Node) -> Environment {
    scene_of(&[root, shape(vec![])]).environment.unwrap()
}

/// What each encoding says of a scene that it imports; the same in all.
fn warnings(roots: &[Node], options: &ImportOptions) -> Vec<String> {
    let [classic, xml, json] = files(roots).map(|(name, text)| {
        let all = import(name, &text, options).unwrap().1;
        // Without the place, which is another in each encoding.
        let message = |w: &String| {
            let (_, message) = w.split_once(": ").unwrap();
            message.split_once(": ").map_or(message, |(column, rest)| if column.starts_with("column") { rest } else { message }).to_owned()
        };
        all.iter().map(message).collect::<Vec<_>>()
    });
    assert_eq!((&classic, &classic), (&xml, &json));
    classic
}

fn warned(root: Node, wanted: &str) {
    let all = warnings(&[root, shape(vec![])], &ImportOptions::default());
    assert!(all.iter().any(|w| w.contains(wanted)), "{wanted} is not in {all:?}");
}

fn refused(root: Node, wanted: &str) {
    for errors in refusals(&[root, shape(vec![])]) {
        assert!(errors.iter().any(|e| e.contains(wanted)), "{wanted} is not in {errors:?}");
    }
}

/// The texel toward a direction, as the canonical scene says where it is.
fn seen(map: &Environment, [x, y, z]: [f64; 3]) -> [f32; 3] {
    let (sin, cos) = math::sin_cos_degrees(-f64::from(map.rotation).to_degrees());
    let (x, z) = (x * cos + z * sin, z * cos - x * sin);
    let u = 0.5 + math::atan2(z, x) / std::f64::consts::TAU;
    let v = 0.5 + math::atan2(y, (x * x + z * z).sqrt()) / std::f64::consts::PI;
    let place = |v: f64, texels: u32| ((v * f64::from(texels)) as usize).min(texels as usize - 1);
    map.rgb[place(v, map.height) * map.width as usize + place(u, map.width)].map(|c| c * map.intensity)
}

fn is(found: [f32; 3], expected: [f32; 3]) -> bool {
    found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3)
}

const RED: [f32; 3] = [1.0, 0.0, 0.0];
const BLACK: [f32; 3] = [0.0; 3];
const WHITE: [f32; 3] = [1.0; 3];

/// Faces of one pixel: red, green, blue, cyan, magenta, yellow.
const FACES: [(&str, &str, [f32; 3], [f64; 3]); 6] = [
    ("frontTexture", "1 1 3 0xFF0000", RED, [0.0, 0.0, -1.0]),
    ("backTexture", "1 1 3 0x00FF00", [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
    ("leftTexture", "1 1 3 0x0000FF", [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]),
    ("rightTexture", "1 1 3 0x00FFFF", [0.0, 1.0, 1.0], [1.0, 0.0, 0.0]),
    ("topTexture", "1 1 3 0xFF00FF", [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
    ("bottomTexture", "1 1 3 0xFFFF00", [1.0, 1.0, 0.0], [0.0, -1.0, 0.0]),
];

fn pixel(image: &'static str) -> Value {
    Child(node("PixelTexture", [("image", One(image))]))
}

fn cube() -> Node {
    node("ComposedCubeMapTexture", FACES.map(|(field, image, ..)| (field, pixel(image))))
}

fn under(cube: Node) -> Node {
    light([("specularTexture", Child(cube))])
}

/// A picture of these pixels from the top row down, as a data URI.
fn data(width: u32, pixels: &[[u8; 3]]) -> &'static [&'static str] {
    let image = RgbImage::from_raw(width, pixels.len() as u32 / width, pixels.as_flattened().to_vec()).unwrap();
    let mut bytes = Cursor::new(vec![]);
    DynamicImage::from(image).write_to(&mut bytes, ImageFormat::Png).unwrap();
    let uri = format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes.into_inner()));
    // Scenes of tests hold texts that live as long as the program.
    Box::leak(Box::new([&*uri.leak()]))
}

fn picture(kind: &'static str, width: u32, pixels: &[[u8; 3]]) -> Node {
    node(kind, [("url", Texts(data(width, pixels)))])
}

#[test]
fn color_and_intensity_are_radiance_from_everywhere_in_all_units() {
    let one = light([("color", One("1 0.5 0.25")), ("intensity", One("2"))]);
    for units in [LightUnits::X3d, LightUnits::Physical] {
        let options = ImportOptions { light_units: units, ..ImportOptions::default() };
        let scene = scene_with(&[one.clone(), shape(vec![])], &options);
        let map = scene.environment.unwrap();
        assert!(map.rgb.iter().all(|texel| *texel == [2.0, 1.0, 0.5]) && map.intensity == 1.0, "{map:?}");
    }
    assert_eq!(environment(light([])).rgb, [WHITE; 2], "an irradiance of pi, which a white Lambert surface shows as 1");
    assert_eq!(environment(light([]).def("Sky")).name, "Sky");
    refused(light([("intensity", One("-1"))]), "EnvironmentLight has the intensity -1");
    refused(light([("color", One("1 -1 0"))]), "EnvironmentLight has a negative color");
}

#[test]
fn a_light_that_is_off_does_not_shine() {
    assert!(scene_of(&[light([("on", One("FALSE"))]), shape(vec![])]).environment.is_none());
    assert!(scene_of(&[light([("on", One("TRUE"))]), shape(vec![])]).environment.is_some());
}

#[test]
fn an_ambient_term_shines_from_all_around() {
    let dim = || light([("ambientIntensity", One("0.25")), ("intensity", One("0.5")), ("color", One("1 0 1"))]);
    assert_eq!(environment(dim()).rgb[0], [0.75, 0.0, 0.75]);
    warned(dim(), "an ambient term, which became light from all around");
    refused(light([("ambientIntensity", One("-1"))]), "ambientIntensity -1");
}

#[test]
fn rotation_and_that_of_groups_turn_the_light() {
    let turned = |group: &'static str, own: &'static str| {
        let inner = under(cube()).with("rotation", One(own));
        environment(node("Transform", [("rotation", One(group)), ("scale", One("3 3 3")), ("children", Children(vec![inner]))]))
    };
    let quarter_up = turned("0 1 0 1.5707963267948966", "0 0 1 0");
    assert!(is(seen(&quarter_up, [-1.0, 0.0, 0.0]), RED), "front goes from -Z to -X");
    assert!(is(seen(&turned("0 0 1 0", "0 1 0 1.5707963267948966"), [-1.0, 0.0, 0.0]), RED));
    assert!(is(seen(&turned("0 0 1 0", "1 0 0 1.5707963267948966"), [0.0, 1.0, 0.0]), RED), "front goes from -Z to +Y");
    // First the light's own turn, then the group's: up, then about the up axis, which keeps it.
    let both = turned("0 1 0 1.5707963267948966", "1 0 0 1.5707963267948966");
    assert!(is(seen(&both, [0.0, 1.0, 0.0]), RED) && is(seen(&both, [0.0, 0.0, -1.0]), [0.0, 1.0, 1.0]), "right goes to -Z");
    let z_up = ImportOptions { up: UpAxis::Z, ..ImportOptions::default() };
    for (name, text) in files(&[under(cube()), shape(vec![])]) {
        let map = import(name, &text, &z_up).unwrap().0.environment.unwrap();
        assert!(is(seen(&map, [0.0, 1.0, 0.0]), [0.0, 1.0, 0.0]), "what was at +Z is above in {name}");
    }
    let inner = Children(vec![under(cube())]);
    let mirrored = environment(node("Transform", [("scale", One("-1 1 1")), ("children", inner.clone())]));
    assert!(is(seen(&mirrored, [-1.0, 0.0, 0.0]), [0.0, 1.0, 1.0]) && is(seen(&mirrored, [0.0, 0.0, -1.0]), RED));
    warned(node("Transform", [("scale", One("1 2 1")), ("children", inner.clone())]), "turned with the group and not stretched");
    refused(node("Transform", [("scale", One("0 0 0")), ("children", inner)]), "scaled to nothing");
}

/// Four columns, two rows: white above the front, red in the middle of the right half below.
const PANORAMA: [[u8; 3]; 8] = [[0; 3], [255; 3], [255; 3], [0; 3], [0; 3], [0; 3], [0; 3], [255, 0, 0]];

#[test]
fn coefficients_of_irradiance_become_radiance() {
    // E00 = pi/0.282095 is an irradiance of pi everywhere; E10 is brighter toward +Z.
    let even = "11.13665 11.13665 11.13665 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0";
    let map = environment(light([("diffuseCoefficients", Many(even))]));
    assert!(map.rgb.iter().all(|texel| is(*texel, WHITE)), "{:?}", map.rgb[0]);
    let leaning = "11.13665 11.13665 11.13665 0 0 0 2 2 2 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0";
    let map = environment(light([("diffuseCoefficients", Many(leaning)), ("intensity", One("2"))]));
    let expected = |cosine: f32| 2.0 * (1.0 + cosine * 0.488_603 * 2.0 / (2.0 * PI / 3.0));
    for (direction, cosine) in [([0.0, 0.0, 1.0], 1.0), ([0.0, 0.0, -1.0], -1.0), ([1.0, 0.0, 0.0], 0.0)] {
        assert!((seen(&map, direction)[1] - expected(cosine)).abs() < 0.03, "{direction:?} {:?}", seen(&map, direction));
    }
    warned(light([("diffuseCoefficients", Many(even))]), "the nine harmonics of their irradiance");
    let dark = "1 1 1 0 0 0 8 8 8 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0";
    assert_eq!(seen(&environment(light([("diffuseCoefficients", Many(dark))])), [0.0, 0.0, -1.0]), BLACK);
    warned(light([("diffuseCoefficients", Many(dark))]), "less light than none, which were made black");
    refused(light([("diffuseCoefficients", Many("1 2 3"))]), "diffuseCoefficients has 3 numbers; it has 27");
}

#[test]
fn a_diffuse_texture_is_irradiance_over_pi_and_gives_way_to_a_specular_one() {
    let grey = FACES.map(|(field, ..)| (field, pixel("1 1 3 0xFF8000")));
    let diffuse = node("ComposedCubeMapTexture", grey);
    let only = light([("diffuseTexture", Child(diffuse.clone()))]);
    let map = environment(only.clone());
    let expected = [1.0, math::srgb_eotf(128.0 / 255.0), 0.0];
    assert!(map.rgb.iter().all(|texel| is(*texel, expected)), "{:?}", map.rgb[0]);
    warned(only, "the nine harmonics of their irradiance");
    let both = under(cube()).with("diffuseTexture", Child(diffuse));
    assert_eq!(environment(both.clone()), environment(under(cube())));
    warned(both, "a diffuse part beside their specularTexture, which a bake works out by itself");
}

#[test]
fn several_lights_add_up() {
    let add = |lights: Vec<Node>| scene_of(&lights.into_iter().chain([shape(vec![])]).collect::<Vec<_>>()).environment.unwrap();
    let even = || light([("color", One("0 0 0.5"))]);
    let map = add(vec![even(), under(picture("ImageTexture", 4, &PANORAMA)).with("rotation", One("0 1 0 -1.5707963267948966")), even()]);
    // Turned by so much the panorama looks toward +X, and its texels are where they were: sampled between them only.
    assert_eq!((map.width, map.height), (4, 2));
    assert!(map.rgb[3][0] > 0.5 && map.rgb.iter().all(|texel| texel[2] >= 1.0), "{:?}", map.rgb);
    let cubes = add(vec![under(cube()), even(), light([("on", One("FALSE"))])]);
    for (face, _, [r, g, b], direction) in FACES {
        assert!(is(seen(&cubes, direction), [r, g, b + 0.5]), "{face}");
    }
    let seventeen: Vec<Node> = (0..17).map(|_| even()).chain([shape(vec![])]).collect();
    for errors in refusals(&seventeen) {
        assert!(errors[0].contains("more than 16 EnvironmentLight nodes"), "{errors:?}");
    }
}

#[test]
fn what_light_from_all_around_cannot_obey_is_said() {
    let here = |fields: Vec<(&'static str, Value)>| node("Group", [("children", Children(vec![light(fields), shape(vec![])]))]);
    let scoped = "light the whole scene";
    warned(here(vec![]), scoped);
    for quiet in [here(vec![("global", One("TRUE"))]), light([])] {
        let all = warnings(&[quiet, shape(vec![])], &ImportOptions::default());
        assert!(!all.iter().any(|w| w.contains(scoped)), "{all:?}");
    }
    assert_eq!(warnings(&[here(vec![])], &ImportOptions::default()), [""; 0], "its group holds all");
    warned(light([("shadowIntensity", One("0.5"))]), "throw whole shadows");
    let strict = ImportOptions { x3d_shadows: ShadowMode::Strict, ..ImportOptions::default() };
    let said = |root| warnings(&[root, shape(vec![])], &strict).iter().any(|w| w.contains("throw whole shadows"));
    assert!(said(light([])) && !said(light([("shadows", One("TRUE"))])));
    warned(light([("origin", One("0 1 0"))]), "an origin, which was not used");
    for field in ["projectionNear", "projectionFar"] {
        warned(light([(field, One("2"))]), "fields of a light as a camera");
    }
    warned(light([("up", One("0 0 1"))]), "fields of a light as a camera");
    warned(light([("defaultShadowMap", Child(node("GeneratedShadowMap", [])))]), "fields of a light as a camera");
}

/// `kiln convert` from X3D to X3D.
#[test]
fn the_node_stays_what_it_is_when_a_file_is_written_anew() {
    let whole =
        under(cube()).with("rotation", One("1 0 0 0.5")).with("diffuseTexture", Child(picture("ImageCubeMapTexture", 4, &PANORAMA)));
    let roots = [whole.with("intensity", One("0.75")).def("Sky"), shape(vec![])];
    let scene = scene_of(&roots);
    for (name, text) in files(&roots) {
        let parts = vec![Part { name: name.into(), content: Content::Bytes(text.into_bytes()) }];
        let bundle = Bundle::from_parts(parts, Some(name), &std::env::temp_dir()).unwrap();
        for encoding in [X3dEncoding::Xml, X3dEncoding::Classic] {
            let anew = rewrite(&bundle, None, false, encoding).unwrap();
            assert!(anew.warnings.is_empty() && anew.text.contains("ImageCubeMapTexture"), "{anew:?}");
            let (again, _) = import("b", &anew.text, &ImportOptions::default()).unwrap();
            assert_eq!(again.environment, scene.environment, "{name} {encoding:?}");
        }
    }
}
