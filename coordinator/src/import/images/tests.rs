//! Images by small pictures made in memory.

use super::*;
use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use std::io::Cursor;

fn png() -> Vec<u8> {
    let mut out = Cursor::new(vec![]);
    DynamicImage::from(RgbaImage::from_pixel(2, 1, Rgba([1, 2, 3, 9]))).write_to(&mut out, ImageFormat::Png).unwrap();
    out.into_inner()
}

#[test]
fn an_image_is_decoded_once_for_each_meaning_and_keeps_alpha_on_demand() {
    let (mut images, mut findings, bytes) = (Images::default(), Findings::default(), png());
    let mut ask = |coding, alpha| {
        let wanted = Wanted { coding, alpha };
        let image = images.bytes("a.png", wanted, At::file("s"), &mut findings, || Ok(Cow::Borrowed(&bytes))).unwrap();
        (image.id, image.transparent, images.textures[image.id as usize].has_alpha)
    };
    assert_eq!(ask(Coding::Srgb, false), (0, true, false));
    assert_eq!(ask(Coding::Linear, false), (1, true, false));
    assert_eq!(ask(Coding::Srgb, true), (0, true, true));
    assert_eq!(ask(Coding::Srgb, false), (0, true, true));
    assert_eq!((images.textures.len(), images.bytes), (2, 8 + 6));
    assert_eq!((images.textures[0].coding, images.textures[1].coding), (Coding::Srgb, Coding::Linear));
}

/// A file may be called like what is made of another one.
#[test]
fn what_is_made_is_told_from_files() {
    let (mut images, mut findings, bytes) = (Images::default(), Findings::default(), png());
    let wanted = Wanted { coding: Coding::Linear, alpha: false };
    let file = images.bytes("a~rough", wanted, At::file("s"), &mut findings, || Ok(Cow::Borrowed(&bytes))).unwrap();
    let mut derive = |texel: [u8; 3]| images.derive("a~rough", file.id, |_| texel, At::file("s"), &mut findings).unwrap().id;
    assert_eq!((derive([7; 3]), derive([8; 3])), (1, 1), "made once");
    assert_eq!(images.textures[1].texels, [7; 6]);
}

#[test]
fn means_are_those_of_light() {
    let (mut images, mut findings) = (Images::default(), Findings::default());
    let mut push = |coding, has_alpha, texels: &[u8]| {
        let texture = Texture { name: "t".into(), width: 2, height: 1, coding, has_alpha, texels: texels.to_vec() };
        images.push(texture, has_alpha, At::file("s"), &mut findings).unwrap().id
    };
    let (linear, srgb) =
        (push(Coding::Linear, false, &[0, 51, 255, 255, 51, 0]), push(Coding::Srgb, true, &[0, 188, 255, 51, 0, 188, 255, 0]));
    let near = |a: [f32; 4], b: [f32; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 4e-3);
    assert!(near(images.mean(linear), [0.5, 0.2, 0.5, 1.0]), "{:?}", images.mean(linear));
    assert!(near(images.mean(srgb), [0.0, 0.5, 1.0, 0.1]), "{:?}", images.mean(srgb));
    assert_eq!(images.mean(7), [1.0; 4]);
}

#[test]
fn a_broken_image_is_told_once() {
    let (mut images, mut findings) = (Images::default(), Findings::default());
    for _ in 0..2 {
        let wanted = Wanted { coding: Coding::Srgb, alpha: false };
        assert!(images.bytes("a.png", wanted, At::line("s", 3), &mut findings, || Ok(Cow::Borrowed(&[1, 2]))).is_none());
    }
    let errors = findings.into_errors("s");
    assert_eq!((errors.len(), errors[0].line), (1, Some(3)));
}

/// A file may call the same broken picture by a thousand names: when nobody is told of more errors, no more are looked for.
#[test]
fn broken_images_are_not_decoded_without_end() {
    let (mut images, mut findings, mut looks) = (Images::default(), Findings::default(), 0);
    for i in 0..50 {
        let wanted = Wanted { coding: Coding::Srgb, alpha: false };
        let read = || {
            looks += 1;
            Ok(Cow::Borrowed(b"none".as_slice()))
        };
        assert!(images.bytes(&format!("{i}.png"), wanted, At::file("s"), &mut findings, read).is_none());
    }
    assert!(findings.is_full() && looks == 20, "{looks}");
}

#[test]
fn what_is_all_or_nothing_is_cut_out_and_the_rest_blends() {
    let mut images = Images::default();
    let mut image = |alphas: [u8; 4]| {
        let texels = alphas.iter().flat_map(|a| [0, 0, 0, *a]).collect();
        let texture = Texture { name: "t".into(), width: 4, height: 1, coding: Coding::Srgb, has_alpha: true, texels };
        images.push(texture, alphas != [255; 4], At::file("s"), &mut Findings::default())
    };
    let (cut, soft, whole) = (image([0, 255, 3, 255]), image([0, 128, 255, 255]), image([255; 4]));
    // Known since they were decoded: materials that share a picture do not look at it again.
    images.textures.iter_mut().for_each(|t| t.texels.fill(128));
    let mode = |factor, image| images.alpha_mode(factor, image, 0.5);
    assert_eq!((mode(1.0, cut), mode(1.0, soft)), (AlphaMode::Mask { cutoff: 0.5 }, AlphaMode::Blend));
    assert_eq!((mode(1.0, whole), mode(1.0, None)), (AlphaMode::Opaque, AlphaMode::Opaque));
    assert_eq!((mode(0.5, cut), mode(0.5, None)), (AlphaMode::Blend, AlphaMode::Blend));
}
