//! Pictures are decoded as often as they must be, whoever asks.

use super::*;
use crate::import::{
    images::Images,
    obj::{
        map,
        pictures::{Named, Pictures},
    },
};

/// Asks for something of a picture by the options of a map.
fn ask<T>(
    pictures: &mut Pictures<'_>,
    bundle: &Bundle,
    options: &str,
    what: impl Fn(&mut Pictures<'_>, Named<'_>, &mut Findings) -> T,
) -> T {
    let (map, mut findings) = (map::parse(options), Findings::default());
    let answer = what(pictures, Named { from: bundle.main(), at: At::line("m.mtl", 1), map: &map }, &mut findings);
    assert!(!findings.has_errors(), "{:?}", findings.into_errors("m.mtl"));
    answer
}

/// The file is gone after the first questions, so whatever is answered then was not decoded again.
#[test]
fn a_picture_that_was_decoded_is_not_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let [grey, leaf] = ["grey.png", "leaf.png"].map(|name| folder.path().join(name));
    RgbaImage::from_fn(2, 1, |x, _| Rgba([51 + 204 * x as u8, 51, 51, 255])).save(&grey).unwrap();
    RgbaImage::from_fn(2, 1, |x, _| Rgba([9, 99, 9, 255 * x as u8])).save(&leaf).unwrap();
    let disk =
        |path: &std::path::Path| Part { name: path.file_name().unwrap().to_str().unwrap().into(), content: Content::File(path.to_owned()) };
    let bundle = Bundle::from_parts(vec![file("a.obj", SQUARE), disk(&grey), disk(&leaf)], Some("a.obj"), folder.path()).unwrap();
    let mut images = Images::default();
    let mut pictures = Pictures::new(&bundle, &mut images);
    let mean = |pictures: &mut Pictures<'_>, options: &str| ask(pictures, &bundle, options, |p, n, f| p.mean(n, f)).unwrap();
    let opacity = |pictures: &mut Pictures<'_>, options: &str| ask(pictures, &bundle, options, |p, n, f| p.opacity(n, f)).unwrap().0;
    let packed =
        |pictures: &mut Pictures<'_>| ask(pictures, &bundle, "-imfchan g grey.png", |p, n, f| p.surface(Some(n), None, f)).unwrap();
    assert!((mean(&mut pictures, "-imfchan g grey.png") - 0.2).abs() < 1e-6);
    let (cut, made, rough) = (opacity(&mut pictures, "leaf.png"), opacity(&mut pictures, "grey.png"), packed(&mut pictures));
    [&grey, &leaf].into_iter().for_each(|path| std::fs::remove_file(path).unwrap());
    assert!((mean(&mut pictures, "-imfchan r grey.png") - 0.6).abs() < 1e-6);
    assert!((mean(&mut pictures, "-imfchan g -mm 0.5 1 grey.png") - 0.7).abs() < 2e-3);
    assert_eq!((opacity(&mut pictures, "leaf.png"), opacity(&mut pictures, "grey.png"), packed(&mut pictures)), (cut, made, rough));
    assert!(ask(&mut pictures, &bundle, "leaf.png", |p, n, f| p.bump(n, f)).is_none(), "no normals, and known without a look");
}

/// A picture that is none is looked at once, and told once.
#[test]
fn a_broken_picture_is_told_once_for_all_materials() {
    let mtl: String = (0..9).map(|i| format!("newmtl m{i}\nmap_d x.png\nmap_Pr x.png\nbump x.png\n")).collect();
    let faces: String = (0..9).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    let parts = vec![file("a.obj", format!("mtllib m.mtl\n{SQUARE}{faces}")), file("m.mtl", mtl), file("x.png", "no picture")];
    let errors = import_parts(parts).unwrap_err();
    assert!(errors.len() == 1 && errors[0].contains("m.mtl:2: the image `x.png`"), "{errors:?}");
}

/// Two hundred materials that share a map of heights say so once.
#[test]
fn a_shared_bump_map_is_said_once() {
    let mtl: String = (0..9).map(|i| format!("newmtl m{i}\nKe 1\nbump x.png\n")).collect();
    let faces: String = (0..9).map(|i| format!("v {i} 9 9\nusemtl m{i}\nf 1 2 -1\n")).collect();
    let mut grey = Cursor::new(vec![]);
    DynamicImage::from(RgbaImage::from_pixel(1, 1, Rgba([9; 4]))).write_to(&mut grey, ImageFormat::Png).unwrap();
    let parts = vec![file("a.obj", format!("mtllib m.mtl\n{SQUARE}{faces}")), file("m.mtl", mtl), file("x.png", grey.into_inner())];
    let imported = import_parts(parts).unwrap();
    assert_eq!(imported.warnings.iter().filter(|w| w.to_string().contains("holds heights")).count(), 1);
}
