//! Environments: Radiance HDR and OpenEXR pictures, decoded within the limits to linear radiance, row 0 at the bottom.
//!
//! The picture is a lat-long map as [`Environment`] has it, seen from inside: up is up, right is to the right. Its size is read and checked
//! before a pixel is decoded. Numbers that are no radiance (negative, not finite, beyond [`limits::BRIGHTEST`]) are clamped and counted:
//! one broken pixel must not turn every texel of a bake into NaN.

pub(super) mod picture;

use super::{
    Bundle,
    findings::{At, Findings},
};
use kiln_proto::{limits, options::ImportOptions, scene::Environment};
use picture::Picture;

/// The environment that the options name, turned and scaled as they say; `None` where they name none or it was refused.
pub(super) fn import(bundle: &Bundle, options: &ImportOptions, findings: &mut Findings) -> Option<Environment> {
    let name = options.environment.as_deref()?;
    let main = At::file(bundle.main().as_str());
    let Some(found) = bundle.find(bundle.main(), name) else {
        findings.error(main, format!("the environment `{name}` is not among the files; send it with the scene"));
        return None;
    };
    let path = found.told("the environment", name, |message| findings.warn(main, message));
    let at = At::file(path.as_str());
    let bytes = match bundle.read(path, limits::BUNDLE_BYTES) {
        Ok(bytes) => bytes,
        Err(problem) => {
            findings.push_error(problem);
            return None;
        }
    };
    match picture::decode(path.as_str(), &bytes) {
        Ok(picture) => Some(finish(path.as_str(), picture, options, at, findings)),
        Err(error) => {
            findings.error(at, format!("the environment {error}"));
            None
        }
    }
}

fn finish(name: &str, mut picture: Picture, options: &ImportOptions, at: At<'_>, findings: &mut Findings) -> Environment {
    let (width, height) = (picture.width, picture.height);
    settle(&mut picture, at, findings);
    if width != 2 * height {
        findings.warn(at, format!("the environment has {width}x{height} pixels; a lat-long map is twice as wide as high; it is stretched"));
    }
    if picture.rgb.as_flattened().iter().all(|v| *v == 0.0) {
        findings.warn(at, "the environment is black");
    }
    Environment {
        name: name.to_owned(),
        width: width as u32,
        height: height as u32,
        rgb: picture.rgb,
        rotation: options.environment_rotation.to_radians(),
        intensity: options.environment_intensity.unwrap_or(1.0),
    }
}

/// Makes radiance of what a picture has, and says what that took.
pub(super) fn settle(picture: &mut Picture, at: At<'_>, findings: &mut Findings) {
    if let Some(windows) = &picture.windows {
        findings.warn(at, format!("the environment has {windows}: what is missing is black, what lies outside is cut off"));
    }
    clamp(&mut picture.rgb, at, findings);
}

/// Brings what is no radiance into [0, [`limits::BRIGHTEST`]], and counts it.
pub(super) fn clamp(rgb: &mut [[f32; 3]], at: At<'_>, findings: &mut Findings) {
    let mut clamped = 0u64;
    for value in rgb.as_flattened_mut() {
        if !(0.0..=limits::BRIGHTEST).contains(value) {
            clamped += 1;
            // NaN is not larger than zero either.
            *value = if *value > 0.0 { limits::BRIGHTEST } else { 0.0 };
        }
    }
    let what = "numbers of the environment that are negative, not finite or beyond any radiance, clamped";
    findings.count_lazily(what, clamped, || (at, String::new()));
}

#[cfg(test)]
mod tests;
