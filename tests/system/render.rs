//! `kiln render` as its users meet it: a package becomes a picture, and what cannot is said in a sentence.

use crate::harness::{bake_room, fail, kiln, succeed};
use serde_json::Value;
use std::os::unix::fs::PermissionsExt;
use tempfile::TempDir;

#[test]
fn a_baked_room_becomes_a_picture() {
    let dir = TempDir::new().unwrap();
    let package = dir.path().join("package");
    bake_room(&package, &[]);
    let (package, png) = (package.to_str().unwrap(), dir.path().join("view.png"));
    let png = png.to_str().unwrap();
    let said: Value = serde_json::from_str(&succeed(["--json", "render", package, "--size", "160x120", "-o", png])).unwrap();
    assert_eq!((&said["width"], &said["height"], &said["pixels_without_light"]), (&160.into(), &120.into(), &0.into()), "{said}");
    let picture = image::open(png).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (160, 120));
    let background = picture.pixels().filter(|p| p.0 == [0x20, 0x24, 0x28]).count();
    assert!((160 * 120 / 10..160 * 120 * 9 / 10).contains(&background), "{background} pixels of background");
    // Red is the wall at x = 0, blue the one at z = 0; from +x and +z the red one is on the left.
    let excess = |x: u32, y: u32| i32::from(picture.get_pixel(x, y).0[0]) - i32::from(picture.get_pixel(x, y).0[2]);
    let half = |columns: std::ops::Range<u32>| columns.flat_map(|x| (0..120).map(move |y| (x, y))).map(|(x, y)| excess(x, y)).sum::<i32>();
    assert!(half(0..80) > half(80..160), "the room stands the right way round");

    // Another eye, with a coordinate below zero, and what the kept samples say of it.
    let first = std::fs::read(png).unwrap();
    for from in ["codec", "raw"] {
        let view = ["--eye", "-1,8,14", "--target=5,0,5", "--fov", "60", "--exposure", "-1", "--size", "80x60", "--from", from];
        succeed(["render", package, "-o", png].iter().chain(&view));
        assert_ne!(std::fs::read(png).unwrap(), first);
        assert_eq!(image::open(png).unwrap().to_rgb8().dimensions(), (80, 60));
    }

    // A bare name is a file of the working folder, and as open to others as any new file there.
    let output = kiln(["render", package, "-o", "bare.png", "--size", "8x6"]).current_dir(dir.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(image::open(dir.path().join("bare.png")).unwrap().to_rgb8().dimensions(), (8, 6));
    let mode = |name: &str| std::fs::metadata(dir.path().join(name)).unwrap().permissions().mode();
    std::fs::write(dir.path().join("usual"), "").unwrap();
    assert_eq!(mode("bare.png"), mode("usual"), "the umask decides");

    fail(2, &["does not exist"], ["render", package, "-o", dir.path().join("no/view.png").to_str().unwrap()]);
    fail(2, &["100000x100000", "4096"], ["render", package, "-o", png, "--size", "100000x100000"]);
    fail(2, &["finite"], ["render", package, "-o", png, "--eye", "NaN,0,0"]);
    fail(2, &["direction to look in"], ["render", package, "-o", png, "--eye", "1,1,1", "--target", "1,1,1"]);
    fail(2, &["1 to 170"], ["render", package, "-o", png, "--fov", "171"]);
    fail(1, &["manifest.json"], ["render", dir.path().to_str().unwrap(), "-o", png]);
}
