//! Import: an uploaded bundle becomes a canonical [`Scene`] or a list of located problems.
//!
//! `bundle` gathers files without trusting a path or a size in them, `format` decides by content and name what they are, and one module
//! per format makes the scene. An error costs its author a walk back to the modelling program, so an import does not stop at the first:
//! it reports as many as it can tell apart, each with file and line. What is merely unusual is repaired, and said as a warning.
//! The alternative, passing parser errors through, is a page shorter and leaves "face parse error" as the whole answer.

pub mod bundle;
mod coat;
mod environment;
mod findings;
mod flat;
pub mod format;
mod gltf;
mod group;
mod guard;
mod images;
pub mod mesh;
mod name;
pub mod obj;
mod slerp;
mod statistics;
mod surfaces;
mod tangents;
mod texture;
mod two_sided;
mod up;
pub(crate) mod uri;
mod weld;
mod x3d;

pub use bundle::{Bundle, BundlePath, Content, Part};
pub use statistics::statistics;
pub use x3d::{Rewritten, X3dEncoding, rewrite as rewrite_x3d};

use crate::records::{Problem, SceneStatistics};
use findings::{At, Findings};
use format::Format;
use images::Images;
use kiln_proto::{
    limits,
    options::ImportOptions,
    scene::{Coding, Scene},
};

/// The key of the warning that a scene has no light, which is said once.
const NO_LIGHT: &str = "no light";

/// What an import yields.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The validated scene.
    pub scene: Scene,
    /// What was repaired, ignored or approximated.
    pub warnings: Vec<Problem>,
    /// Its counts.
    pub statistics: SceneStatistics,
}

/// Imports the main file of a bundle with everything it refers to, and the environment that the options name. Cost: linear in the bytes of
/// the bundle and in the triangles and texels that they describe, but for concave polygons of n corners, which take about n log n.
///
/// # Errors
/// The faults found, located, by file and line; at least one. Reading stops after twenty, which is then the last thing said.
pub fn import_bundle(bundle: &Bundle, options: &ImportOptions) -> Result<Imported, Vec<Problem>> {
    let mut findings = Findings::default();
    let scene = import(bundle, options, &mut findings);
    match scene {
        Some(scene) if !findings.has_errors() => {
            let statistics = statistics(&scene);
            Ok(Imported { scene, warnings: findings.into_warnings(), statistics })
        }
        _ => Err(findings.into_errors(bundle.main().as_str())),
    }
}

fn import(bundle: &Bundle, options: &ImportOptions, findings: &mut Findings) -> Option<Scene> {
    let main = bundle.main();
    if let Err(bad) = options.check() {
        findings.error(At::file(main.as_str()), format!("the option {bad}"));
        return None;
    }
    let mut images = Images::default();
    let mut scene = import_file(bundle, main, options, &mut images, findings)?;
    scene.textures = images.textures;
    up::turn(&mut scene, options.up);
    if let Some(environment) = environment::import(bundle, options, findings) {
        scene.environment = Some(environment);
    }
    if findings.has_errors() {
        return None;
    }
    tangents::complete(&mut scene);
    flat::flatten(&mut scene);
    if let Some(group::Grouped { surfaces, atlases }) = group::group(&mut scene) {
        let message = format!("{surfaces} small surfaces share the textures of {}: {}", atlases.len(), listed(&atlases));
        findings.warn(At::file(main.as_str()), message);
    }
    if !scene.has_light() {
        let message = "nothing in the scene emits light (no light, no environment, no material in use that shines): it will be black";
        findings.warn_once(At::file(main.as_str()), NO_LIGHT, message);
    }
    if let Err(invalid) = scene.validate() {
        findings.error(At::file(main.as_str()), format!("the scene is not valid: {invalid}"));
        return None;
    }
    Some(scene)
}

/// The scene of one file of the bundle, the main one or one that it inlines. Its textures are those of `images`, which all files share: a
/// picture that many of them use is decoded and kept once, and what they hold together has one bound.
fn import_file(bundle: &Bundle, file: &BundlePath, options: &ImportOptions, images: &mut Images, findings: &mut Findings) -> Option<Scene> {
    let bytes = match bundle.read(file, limits::TEXT_BYTES) {
        Ok(bytes) => bytes,
        Err(problem) => {
            findings.push_error(problem);
            return None;
        }
    };
    match format::detect(file.as_str(), &bytes) {
        Format::Obj => obj::import(bundle, file, &bytes, images, findings),
        Format::Gltf => gltf::import(bundle, file, &bytes, options.time, images, findings),
        Format::X3d => x3d::import(bundle, file, &bytes, options, images, findings),
        Format::Zip => {
            findings.error(At::file(file.as_str()), "this is a ZIP inside the bundle; send it by itself");
            None
        }
        Format::Unsupported(what) => {
            findings.push_error(format::refusal(file.as_str(), what));
            None
        }
    }
}

/// The first names of a list.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 8;
    let more = if names.len() > SHOWN { ", …" } else { "" };
    format!("{}{more}", names[..names.len().min(SHOWN)].join(", "))
}

/// Decodes an image as materials do, by its content and as TGA, which only a name tells: for fuzzing.
pub(crate) fn fuzz_image(bytes: &[u8]) {
    for (name, coding) in [("image", Coding::Srgb), ("image.tga", Coding::Linear)] {
        drop(texture::decode(name, bytes, coding, true));
    }
}

#[cfg(test)]
mod tests;
