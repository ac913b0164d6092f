//! Gathering a scene from a folder, as the command line does before it uploads: the main file and everything it refers to.
//!
//! Only files inside the main file's folder are taken: a scene that someone else made must not be able to name `/etc/passwd` or
//! `../../.ssh/id_ed25519`, nor to reach them through a link, and have them uploaded. What is outside is reported as missing.

use super::{Bundle, BundlePath, Content, Format, plain, problem, unreadable};
use crate::{
    import::{gltf, obj},
    records::Problem,
};
use kiln_proto::limits;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

/// The scene file `main` with the files it refers to, and those it refers to in vain. A ZIP is unpacked into `scratch` instead.
///
/// # Errors
/// A main file that cannot be read or does not import, or more than a bundle may hold.
pub fn collect(main: &Path, scratch: &Path) -> Result<(Bundle, Vec<Problem>), Problem> {
    let shown = main.display().to_string();
    let name = main.file_name().and_then(|n| n.to_str()).ok_or_else(|| problem(&shown, "this is not the name of a file"))?;
    if !main.is_file() {
        return Err(problem(&shown, if main.exists() { "this is not a file" } else { "there is no such file" }));
    }
    let part = super::Part { name: name.to_owned(), content: Content::File(main.to_owned()) };
    let format = super::format::detect(name, &super::head(&part)?);
    match format {
        Format::Zip => return Ok((Bundle::from_parts(vec![part], None, scratch)?, vec![])),
        Format::Unsupported(what) => return Err(super::format::refusal(&shown, what)),
        Format::Obj | Format::Gltf | Format::X3d => {}
    }
    let root = BundlePath::parse(name).map_err(|e| problem(&shown, e.to_string()))?;
    let parent = main.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = parent.canonicalize().map_err(|e| unreadable(&parent.display().to_string(), &e))?;
    let mut walk = Walk { folder, files: BTreeMap::new(), missing: vec![] };
    let bytes = read(main, &shown)?;
    walk.files.insert(root.clone(), Content::File(main.to_owned()));
    if format == Format::Gltf {
        walk.references(&root, gltf::references(name, &bytes));
    } else {
        walk.materials(&root, &String::from_utf8_lossy(&bytes))?;
    }
    let bundle = Bundle::new(walk.files, Some(root.as_str()), None)?;
    Ok((bundle, walk.missing))
}

struct Walk {
    /// Without links.
    folder: PathBuf,
    files: BTreeMap<BundlePath, Content>,
    missing: Vec<Problem>,
}

impl Walk {
    /// Adds the material libraries of an OBJ and what they refer to.
    fn materials(&mut self, root: &BundlePath, text: &str) -> Result<(), Problem> {
        for path in self.libraries(root, text) {
            let library = read(&self.folder.join(path.as_str()), path.as_str())?;
            self.references(&path, obj::texture_lines(&String::from_utf8_lossy(&library)));
        }
        Ok(())
    }

    /// Adds the material libraries of an OBJ and returns their paths.
    fn libraries(&mut self, root: &BundlePath, text: &str) -> BTreeSet<BundlePath> {
        let mut libraries = BTreeSet::new();
        for (line, names) in obj::library_lines(text) {
            for name in obj::split_names(&names, |n| self.exists(root, n)) {
                match self.add(root, &name) {
                    Some(path) => drop(libraries.insert(path)),
                    None => self.report(root, line, &name),
                }
            }
        }
        libraries
    }

    fn references(&mut self, from: &BundlePath, names: Vec<(u32, String)>) {
        for (line, name) in names {
            if self.add(from, &name).is_none() {
                self.report(from, line, &name);
            }
        }
    }

    fn exists(&self, from: &BundlePath, name: &str) -> bool {
        from.join(name).is_some_and(|p| self.is_inside(&p))
    }

    /// Whether the path is a file of the folder, also after its links are followed.
    fn is_inside(&self, path: &BundlePath) -> bool {
        let real = self.folder.join(path.as_str()).canonicalize();
        real.is_ok_and(|real| real.starts_with(&self.folder) && real.is_file())
    }

    /// Adds a file of the folder. Where the very path is not there, the file name beside the referring file or beside the scene will
    /// do: exporters write absolute paths of machines long gone.
    fn add(&mut self, from: &BundlePath, name: &str) -> Option<BundlePath> {
        let bare = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let candidates = [from.join(name), from.join(bare), BundlePath::parse(bare).ok()];
        let path = candidates.into_iter().flatten().find(|p| self.is_inside(p))?;
        self.files.insert(path.clone(), Content::File(self.folder.join(path.as_str())));
        Some(path)
    }

    fn report(&mut self, from: &BundlePath, line: u32, name: &str) {
        if self.missing.len() < 100 {
            let message = format!("`{name}` is not in the folder of the scene");
            self.missing.push(Problem { message, file: Some(from.as_str().to_owned()), line: Some(line) });
        }
    }
}

fn read(path: &Path, shown: &str) -> Result<Vec<u8>, Problem> {
    let length = path.metadata().map_err(|e| unreadable(shown, &e))?.len();
    if length > limits::TEXT_BYTES {
        return Err(plain(format!("{shown} has {length} bytes; at most {} are allowed", limits::TEXT_BYTES)));
    }
    std::fs::read(path).map_err(|e| unreadable(shown, &e))
}
