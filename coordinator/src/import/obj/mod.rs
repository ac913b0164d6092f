//! Wavefront OBJ with MTL.
//!
//! ```text
//! OBJ text ─ scan, vertices ─► lists ─ shade ─► one mesh with normals ─ build ─► surfaces
//! MTL text ─ mtl, map ─► raw materials ─ material, pictures, facts ─► materials and textures, as surfaces ask for them
//! ```

mod build;
mod count;
mod facts;
mod map;
mod material;
mod mtl;
mod pictures;
mod polypaint;
mod raw;
mod scan;
mod shade;
mod text;
mod vertices;

#[cfg(test)]
mod tests;

use super::{
    Bundle, BundlePath,
    bundle::Found,
    findings::{At, Findings},
    images::Images,
};
use kiln_proto::{limits, scene::Scene};

/// Words of `mtllib` that are tried as one file name with blanks.
const NAME_WORDS: usize = 32;

/// Imports the OBJ text of a file of a bundle; `None` where there were errors.
pub(super) fn import(bundle: &Bundle, main: &BundlePath, bytes: &[u8], images: &mut Images, findings: &mut Findings) -> Option<Scene> {
    let text = text::decode(main.as_str(), bytes, findings)?;
    let scan = scan::scan(main.as_str(), &text, findings);
    let library = read_libraries(bundle, main, &scan.libraries, findings);
    if findings.has_errors() {
        return None;
    }
    let shaded = shade::shade(main.as_str(), scan, findings);
    let mut materials = material::Materials::new(bundle, &library, images);
    let mut scene = Scene::empty();
    build::build(main.as_str(), main.stem(), &shaded, &mut materials, &mut scene, findings);
    scene.materials = materials.materials;
    Some(scene)
}

fn read_libraries(bundle: &Bundle, main: &BundlePath, statements: &[(u32, String)], findings: &mut Findings) -> raw::Library {
    let mut library = raw::Library::new();
    let mut read = std::collections::BTreeSet::new();
    for (line, operands) in statements {
        for name in split_names(operands, |n| matches!(bundle.find(main, n), Some(Found::Exact(_)))) {
            let at = At::line(main.as_str(), *line);
            let Some(found) = bundle.find(main, &name) else {
                findings.warn(at, format!("the material library `{name}` is not in the bundle; its materials are taken as grey"));
                continue;
            };
            let path = found.told("the material library", &name, |message| findings.warn(at, message));
            if !read.insert(path.clone()) {
                continue;
            }
            match bundle.read(path, limits::TEXT_BYTES) {
                Ok(bytes) => {
                    if let Some(text) = text::decode(path.as_str(), &bytes, findings) {
                        mtl::read(path, &text, &mut library, findings);
                    }
                }
                Err(problem) => findings.push_error(problem),
            }
        }
    }
    library
}

/// The `mtllib` statements of a text: line and operands.
pub(super) fn library_lines(text: &str) -> Vec<(u32, String)> {
    let operands = text::statements(text).filter_map(|s| match s.split() {
        ("mtllib", rest) if !rest.is_empty() => Some((s.line, rest.to_owned())),
        _ => None,
    });
    operands.take(limits::BUNDLE_FILES).collect()
}

/// The files that an MTL text uses: line and name.
pub(super) fn texture_lines(text: &str) -> Vec<(u32, String)> {
    let files = text::statements(text).filter_map(|s| {
        let (word, rest) = s.split();
        raw::role(word).map(|_| (s.line, map::parse(rest).file))
    });
    files.filter(|(_, f)| !f.is_empty()).take(limits::BUNDLE_FILES).collect()
}

/// Splits the operands of `mtllib` into file names. Names may hold blanks, so the longest run of words that `exists` is one name; where
/// none does, words up to the next `.mtl` are.
pub(super) fn split_names(operands: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let words: Vec<(usize, &str)> = operands.split_whitespace().map(|w| (w.as_ptr() as usize - operands.as_ptr() as usize, w)).collect();
    let joined = |from: usize, to: usize| operands[words[from].0..words[to].0 + words[to].1.len()].trim_matches('"');
    let mut names = vec![];
    let mut at = 0;
    while at < words.len() && names.len() < limits::BUNDLE_FILES {
        let last = (at + NAME_WORDS).min(words.len());
        let found = (at..last).rev().find(|to| exists(joined(at, *to)));
        let guess = || (at..last).find(|to| words[*to].1.to_lowercase().ends_with(".mtl")).unwrap_or(last - 1);
        let to = found.unwrap_or_else(guess);
        names.push(joined(at, to).to_owned());
        at = to + 1;
    }
    names
}
