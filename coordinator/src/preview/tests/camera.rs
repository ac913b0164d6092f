use super::*;
use crate::preview::camera::default_view;

#[test]
fn rays_go_through_the_pixels_of_an_upright_picture() {
    let camera = Camera::new(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 90.0, size(3, 3)).unwrap();
    assert_eq!(camera.direction(1, 1), Vec3::NEG_Z);
    let corner = camera.direction(0, 0);
    // The centre of the upper left pixel of three: two thirds of the way to the corner, at 45 degrees each way.
    let expected = Vec3::new(-2.0 / 3.0, 2.0 / 3.0, -1.0).normalize();
    assert!(corner.distance(expected) < 1e-6, "{corner}");
    assert!(camera.direction(2, 1).x > 0.5 && camera.direction(1, 2).y < -0.5);
    let wide = Camera::new(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, 90.0, size(4, 2)).unwrap();
    let right = wide.direction(3, 0);
    assert!((right.x / -right.z - 1.5).abs() < 1e-6 && (right.y / -right.z - 0.5).abs() < 1e-6, "pixels are square: {right}");
}

#[test]
fn a_vertical_view_has_a_top_too() {
    let camera = Camera::new(Vec3::new(0.0, 5.0, 0.0), Vec3::ZERO, 90.0, size(2, 2)).unwrap();
    let upper_left = camera.direction(0, 0);
    assert!(upper_left.distance(Vec3::new(-0.5, -1.0, -0.5).normalize()) < 1e-6, "{upper_left}");
    let nearly = Camera::new(Vec3::new(0.0, 5.0, 4e-3), Vec3::ZERO, 90.0, size(2, 2)).unwrap();
    assert!(nearly.direction(0, 0).distance(upper_left) < 2e-3, "no jump where the rule changes over");
}

#[test]
fn up_may_be_said_for_scenes_that_stand_on_another_side() {
    let camera = Camera::new(Vec3::new(0.0, -5.0, 0.0), Vec3::ZERO, 90.0, size(2, 2)).unwrap();
    let upright = camera.upright(Vec3::new(0.0, 0.0, 7.0)).unwrap();
    let corner = upright.direction(0, 0);
    assert!(corner.z > 0.0 && corner.x < 0.0, "the upper left pixel: {corner}");
    for bad in [Vec3::ZERO, Vec3::Y, Vec3::NAN] {
        assert!(camera.upright(bad).unwrap_err().to_string().contains("line of sight"), "{bad}");
    }
    let scene = scene_of(&[[[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]], 1.0);
    let query = |up: &'static str| {
        let view = View::from_query(|name| match name {
            "eye" => Some("0,-5,0".to_owned()),
            "target" => Some("0,0,0".to_owned()),
            "up" => Some(up.to_owned()),
            _ => None,
        });
        view.map_err(|e| e.to_string()).and_then(|v| v.camera(&scene).map_err(|e| e.to_string()))
    };
    assert!(query("0,0,1").unwrap().direction(0, 0).z > 0.0);
    assert!(query("0,2,0").unwrap_err().starts_with("up ") && query("up").unwrap_err().starts_with("up:"));
}

#[test]
fn cameras_that_cannot_see_are_refused() {
    let make = |eye: Vec3, fov| Camera::new(eye, Vec3::ONE, fov, size(4, 4));
    for (eye, fov) in [
        (Vec3::new(f32::NAN, 0.0, 0.0), 45.0),
        (Vec3::new(0.0, f32::INFINITY, 0.0), 45.0),
        (Vec3::new(0.0, 0.0, 1e16), 45.0),
        (Vec3::ONE, 45.0),
        (Vec3::ZERO, 0.99),
        (Vec3::ZERO, 170.1),
        (Vec3::ZERO, f32::NAN),
    ] {
        assert!(make(eye, fov).is_err(), "{eye} {fov}");
    }
    assert!(make(Vec3::ZERO, 1.0).is_ok() && make(Vec3::ZERO, 170.0).is_ok());
    for (width, height) in [(0, 1), (1, 0), (4_097, 1), (4_096, 2_049), (100_000, 100_000)] {
        assert!(PictureSize::new(width, height).is_err(), "{width} {height}");
    }
    assert!(PictureSize::new(4_096, 2_048).is_ok());
    for bad in ["", "640", "640x", "x480", "-1x4", "640x480x3", "1e3x4"] {
        assert!(bad.parse::<PictureSize>().is_err(), "{bad}");
    }
}

/// The corner's fronts face up and toward +z: azimuth 0, and the elevation that sees more of both.
#[test]
fn the_default_view_shows_the_whole_scene_from_its_fronts() {
    let scene = corner();
    let (eye, target) = default_view(&scene, 60.0, size(200, 100)).unwrap();
    assert_eq!(target, Vec3::new(0.0, 1.5, 0.0));
    let offset = eye - target;
    // The floor has 16 m² and the wall 12: the score 16 sin e + 12 cos e is 17.2 at 40 degrees, 16.5 at 20.
    assert!(offset.x.abs() < 1e-5 && (offset.y / offset.length() - 0.642_787_6).abs() < 1e-6, "{offset}");
    let radius = (16.0f32 + 9.0 + 16.0).sqrt() / 2.0;
    assert!((offset.length() - radius / 0.5).abs() < 1e-4, "{}", offset.length());
    // In an upright picture the width is what limits: tan of half the horizontal angle is half of tan 30 degrees.
    let (eye, _) = default_view(&scene, 60.0, size(100, 200)).unwrap();
    let tangent = 0.5 / 3.0f32.sqrt();
    assert!((eye.distance(target) - radius * (1.0 + tangent * tangent).sqrt() / tangent).abs() < 1e-4);
}

#[test]
fn of_equally_good_views_the_first_is_taken() {
    let floor = scene_of(&[[[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]]], 1.0);
    let (eye, target) = default_view(&floor, 45.0, size(10, 10)).unwrap();
    assert!((eye - target).x == 0.0 && (eye - target).z > 0.0, "azimuth 0: {eye}");
}

#[test]
fn a_default_eye_that_is_too_far_blames_no_eye() {
    let mut huge = corner();
    huge.positions.iter_mut().flatten().for_each(|c| *c *= 1e9);
    let view = View { fov: 1.0, size: size(1, 4_096), ..View::default() };
    let error = view.camera(&huge).unwrap_err();
    let said = BadView::from(error.clone()).to_string();
    assert!(matches!(error, BadCamera::TooFar { .. }) && said.starts_with("fov: ") && said.contains("1x4096"), "{said}");
    let named = View { eye: Some(Vec3::new(0.0, 1e9, 1e10)), ..view.clone() };
    assert!(named.camera(&huge).is_ok() && view.camera(&corner()).is_ok());
}

#[test]
fn what_is_asked_of_rays_is_read_or_refused() {
    let ask = |pairs: &[(&str, &str)]| View::from_query(|name| pairs.iter().find(|(n, _)| *n == name).map(|(_, text)| (*text).to_owned()));
    for (pairs, expected) in [
        (&[][..], 2),
        (&[("w", "641")], 1),
        (&[("w", "641"), ("antialias", "3")], 3),
        (&[("w", "4096"), ("h", "2048")], 1),
        (&[("w", "1024"), ("h", "512"), ("antialias", "4")], 4),
    ] {
        assert_eq!(ask(pairs).unwrap().antialias, expected, "{pairs:?}");
    }
    for pairs in
        [&[("antialias", "0")][..], &[("antialias", "5")], &[("antialias", "x")], &[("w", "1025"), ("h", "512"), ("antialias", "4")]]
    {
        assert_eq!(ask(pairs).unwrap_err().field, "antialias", "{pairs:?}");
    }
    let far = ask(&[("eye", "1e20,0,0")]).unwrap_err().to_string();
    assert_eq!(far.matches("eye").count(), 1, "{far}");
}

fn authors(lens: kiln_proto::scene::Lens) -> kiln_proto::scene::Camera {
    kiln_proto::scene::Camera { name: "door".into(), eye: [1.0, 2.0, 3.0], forward: [0.0, 0.0, -1.0], up: [1.0, 0.0, 0.0], lens }
}

#[test]
fn the_author_s_cameras_look_as_they_were_placed() {
    use kiln_proto::scene::Lens;
    let (fov, upright) = (std::f32::consts::FRAC_PI_2, size(2, 4));
    let of = |lens, size| Camera::of_author(&authors(lens), size).unwrap();
    // +X is up, so +Y is to the left.
    let camera = of(Lens::Perspective { fov, of_smaller: false }, upright);
    let upper_left = camera.direction(0, 0);
    assert!((upper_left / -upper_left.z).distance(Vec3::new(0.75, 0.25, -1.0)) < 1e-6, "{upper_left}");
    let smaller = of(Lens::Perspective { fov, of_smaller: true }, upright).direction(0, 0);
    assert!((smaller / -smaller.z).distance(Vec3::new(1.5, 0.5, -1.0)) < 1e-6, "{smaller}");
    let parallel = of(Lens::Orthographic { half_height: 2.0 }, upright);
    assert_eq!((parallel.direction(0, 0), parallel.direction(1, 3)), (Vec3::NEG_Z, Vec3::NEG_Z));
    assert!(parallel.origin(0, 0).as_vec3().distance(Vec3::new(2.5, 2.5, 3.0)) < 1e-6, "{}", parallel.origin(0, 0));
    assert_eq!(camera.origin(0, 0).as_vec3(), Vec3::new(1.0, 2.0, 3.0));
    let blind = kiln_proto::scene::Camera { forward: [0.0; 3], ..authors(Lens::Perspective { fov, of_smaller: false }) };
    assert!(matches!(Camera::of_author(&blind, upright), Err(BadCamera::NoDirection { .. })));
}

#[test]
fn parallel_rays_see_what_lies_before_them() {
    let mut scene = corner();
    let lens = kiln_proto::scene::Lens::Orthographic { half_height: 1.0 };
    scene.cameras.push(kiln_proto::scene::Camera { up: [0.0, 1.0, 0.0], ..authors(lens) });
    let view = View { camera: Some("door".into()), size: size(8, 8), ..View::default() };
    let camera = view.camera(&scene).unwrap();
    let plan = plan_of(&scene, "16x16", "2x2");
    let seen = nearest(&look(&scene, &plan, &camera, &Stop::default()).unwrap());
    // Two metres of the wall, from x = 0 to 2: every step is a quarter of a metre.
    let u: Vec<f32> = seen[..8].iter().map(|s| s.unwrap().uv[0]).collect();
    assert!(u.windows(2).all(|w| (w[1] - w[0] - 0.75 * 0.25 / 4.0).abs() < 1e-6), "{u:?}");
    let missing = View { camera: Some("Door".into()), ..view }.camera(&scene).unwrap_err();
    assert_eq!(BadView::from(missing).to_string(), "camera: the scene has no camera `Door`; it has door");
    let both = |name: &str| matches!(name, "camera" | "eye").then(|| "0,1,2".to_owned());
    assert_eq!(View::from_query(both).unwrap_err().field, "camera");
}
