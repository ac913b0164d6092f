//! Gathering a scene from a folder, as the command line does before it uploads: the main file and everything it refers to.
//!
//! Only files inside one folder are taken, the main file's own unless its author names a larger one: a scene that someone else made must
//! not be able to name `/etc/passwd` or `../../.ssh/id_ed25519`, nor to reach them through a link, and have them uploaded. What is outside
//! is reported as missing.

use super::{Bundle, BundlePath, Content, Format, Part, format, problem, unreadable};
use crate::{
    import::{
        gltf, obj,
        x3d::{self, Reference},
    },
    records::Problem,
};
use kiln_proto::limits;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

/// The scene file `main` with the files it refers to, and those it refers to in vain. Files of `root` may be taken, a folder around the
/// main file; `None` is the main file's own. A ZIP is unpacked into `scratch` instead.
///
/// # Errors
/// A main file that cannot be read, does not import or lies outside `root`, or more than a bundle may hold.
pub fn collect(main: &Path, root: Option<&Path>, scratch: &Path) -> Result<(Bundle, Vec<Problem>), Problem> {
    let shown = main.display().to_string();
    let name = main.file_name().and_then(|n| n.to_str()).ok_or_else(|| problem(&shown, "this is not the name of a file"))?;
    if !main.is_file() {
        return Err(problem(&shown, if main.exists() { "this is not a file" } else { "there is no such file" }));
    }
    let part = Part { name: name.to_owned(), content: Content::File(main.to_owned()) };
    let format = format::detect(name, &super::head(&part)?);
    match format {
        Format::Zip => return Ok((Bundle::from_parts(vec![part], None, scratch)?, vec![])),
        Format::Unsupported(what) => return Err(format::refusal(&shown, what)),
        Format::Obj | Format::Gltf | Format::X3d => {}
    }
    let (folder, root) = place(main, name, root)?;
    let mut walk = Walk { folder, files: BTreeMap::new(), missing: vec![], main: root.clone(), open: vec![root.clone()] };
    walk.files.insert(root.clone(), Content::File(main.to_owned()));
    while let Some(path) = walk.open.pop() {
        walk.scene(&path)?;
    }
    let bundle = Bundle::new(walk.files, Some(root.as_str()), None)?;
    Ok((bundle, walk.missing))
}

/// The folder whose files may be taken, without links, and the path of the main file in it.
fn place(main: &Path, name: &str, root: Option<&Path>) -> Result<(PathBuf, BundlePath), Problem> {
    let real = |path: &Path| path.canonicalize().map_err(|e| unreadable(&path.display().to_string(), &e));
    let parent = real(main.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")))?;
    let folder = root.map_or(Ok(parent.clone()), real)?;
    let shown = main.display().to_string();
    let Ok(within) = parent.strip_prefix(&folder) else {
        return Err(problem(&shown, format!("the scene does not lie in the folder {}", folder.display())));
    };
    let path = within.join(name);
    let path = path.to_str().ok_or_else(|| problem(&shown, "a folder around it has a name that is not text"))?;
    Ok((folder, BundlePath::parse(path).map_err(|e| problem(&shown, e.to_string()))?))
}

struct Walk {
    /// Without links.
    folder: PathBuf,
    files: BTreeMap<BundlePath, Content>,
    missing: Vec<Problem>,
    main: BundlePath,
    /// Files that nobody has looked into yet: the main one and those that may be inlined.
    open: Vec<BundlePath>,
}

impl Walk {
    /// Adds what one file of the folder refers to, where it is a scene.
    fn scene(&mut self, path: &BundlePath) -> Result<(), Problem> {
        if self.files.len() > limits::BUNDLE_FILES {
            return Ok(()); // Which the bundle will refuse.
        }
        if *path != self.main && !format::is_scene(path.as_str()) {
            return Ok(());
        }
        let local = self.folder.join(path.as_str());
        let part = Part { name: path.as_str().to_owned(), content: Content::File(local.clone()) };
        let format = format::detect(path.as_str(), &super::head(&part)?);
        if !matches!(format, Format::Obj | Format::Gltf | Format::X3d) {
            return Ok(());
        }
        let bytes = read(&local, path.as_str())?;
        match format {
            Format::Obj => self.materials(path, &String::from_utf8_lossy(&bytes))?,
            Format::Gltf => self.references(path, gltf::references(path.as_str(), &bytes)),
            _ => self.alternatives(path, x3d::references(&bytes)),
        }
        Ok(())
    }

    /// Adds the first file that exists of each reference.
    fn alternatives(&mut self, from: &BundlePath, references: Vec<x3d::Reference>) {
        for Reference { line, names, certain } in references {
            let found = names.iter().find_map(|name| self.locate(from, name, certain));
            match found {
                Some(path) => drop(self.insert(path)),
                None if certain => self.report(from, line, &names.join("`, `")),
                None => {}
            }
        }
    }

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

    /// Adds a file of the folder.
    fn add(&mut self, from: &BundlePath, name: &str) -> Option<BundlePath> {
        self.locate(from, name, true).map(|path| self.insert(path))
    }

    fn insert(&mut self, path: BundlePath) -> BundlePath {
        let content = Content::File(self.folder.join(path.as_str()));
        if self.files.insert(path.clone(), content).is_none() {
            self.open.push(path.clone());
        }
        path
    }

    /// The file that a name means. Where the very path is not there, the file name beside the referring file or beside the scene will do,
    /// if `near`: exporters write absolute paths of machines long gone.
    fn locate(&self, from: &BundlePath, name: &str, near: bool) -> Option<BundlePath> {
        let bare = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let exact = std::iter::once(from.join(name));
        let others = [from.join(bare), BundlePath::parse(bare).ok()].into_iter().take(if near { 2 } else { 0 });
        exact.chain(others).flatten().find(|p| self.is_inside(p))
    }

    fn report(&mut self, from: &BundlePath, line: u32, name: &str) {
        if self.missing.len() < 100 {
            let message = format!("`{name}` is not in the folder whose files the scene may use");
            self.missing.push(Problem { message, file: Some(from.as_str().to_owned()), line: Some(line) });
        }
    }
}

fn read(path: &Path, shown: &str) -> Result<Vec<u8>, Problem> {
    let length = path.metadata().map_err(|e| unreadable(shown, &e))?.len();
    if length > limits::TEXT_BYTES {
        return Err(Problem::new(format!("{shown} has {length} bytes; at most {} are allowed", limits::TEXT_BYTES)));
    }
    std::fs::read(path).map_err(|e| unreadable(shown, &e))
}
