//! Wavefront OBJ with MTL: `scan` checks the text, `tobj` reads it, `mtl` and `material` say what surfaces are made of, `build` makes
//! them.

mod build;
mod map;
mod material;
mod mtl;
mod scan;
mod text;

use super::{
    Bundle, BundlePath,
    bundle::Found,
    findings::{At, Findings},
};
use kiln_proto::{limits, scene::Scene};
use std::io::Read;

/// Words of `mtllib` that are tried as one file name with blanks.
const NAME_WORDS: usize = 32;

/// Imports the OBJ text of a file of a bundle; `None` where there were errors.
pub(super) fn import(bundle: &Bundle, main: &BundlePath, bytes: &[u8], findings: &mut Findings) -> Option<Scene> {
    let text = text::decode(main.as_str(), bytes, findings)?;
    let scan = scan::scan(main.as_str(), &text, findings);
    let library = read_libraries(bundle, main, &scan.libraries, findings);
    if findings.has_errors() {
        return None;
    }
    let models = read_models(main, &scan, findings)?;
    let mut materials = material::Materials::new(bundle, &library);
    let mut builder = build::Builder::new(main.as_str(), &scan);
    builder.add(&models, &mut materials, findings);
    drop(models);
    let (positions, surfaces) = builder.into_surfaces(main.stem(), findings);
    Some(Scene { positions, surfaces, materials: materials.materials, textures: materials.images.textures, ..Scene::empty() })
}

/// Has `tobj` read what the scan wrote.
fn read_models(main: &BundlePath, scan: &scan::Scan, findings: &mut Findings) -> Option<Vec<tobj::Model>> {
    let mut reader = scan.vertices.as_bytes().chain(scan.faces.as_bytes());
    let keep_polygons = tobj::LoadOptions::default();
    match tobj::load_obj_buf(&mut reader, &keep_polygons, |_| Err(tobj::LoadError::OpenFileFailed)) {
        Ok((models, _)) => Some(models),
        Err(e) => {
            findings.error(At::file(main.as_str()), format!("the geometry cannot be read: {e}"));
            None
        }
    }
}

fn read_libraries(bundle: &Bundle, main: &BundlePath, statements: &[(u32, String)], findings: &mut Findings) -> mtl::Library {
    let mut library = mtl::Library::new();
    let mut read = std::collections::BTreeSet::new();
    for (line, operands) in statements {
        for name in split_names(operands, |n| matches!(bundle.find(main, n), Some(Found::Exact(_)))) {
            let at = At::line(main.as_str(), *line);
            let path = match bundle.find(main, &name) {
                Some(Found::Exact(path)) => path,
                Some(Found::Near(path)) => {
                    findings.warn(at, format!("the material library `{name}` is not in the bundle; `{path}` is used instead"));
                    path
                }
                None => {
                    findings.warn(at, format!("the material library `{name}` is not in the bundle; its materials are taken as grey"));
                    continue;
                }
            };
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
    let files = text::statements(text).filter_map(|s| match s.split() {
        ("map_Kd" | "map_kd" | "map_Ke" | "map_ke", rest) => Some((s.line, map::parse(rest).file)),
        _ => None,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn library_names_may_hold_blanks() {
        let files = ["a b.mtl", "c.mtl", "d e"];
        let split = |operands: &str| split_names(operands, |n| files.contains(&n));
        assert_eq!(split("a b.mtl c.mtl"), ["a b.mtl", "c.mtl"]);
        assert_eq!(split("\"a b.mtl\" d e"), ["a b.mtl", "d e"]);
        assert_eq!(split("gone.mtl c.mtl"), ["gone.mtl", "c.mtl"]);
        assert_eq!(split("also gone.MTL x y"), ["also gone.MTL", "x y"]);
        assert_eq!(split(""), [""; 0]);
    }
}
