//! A bundle: the files of one upload under safe relative paths.
//!
//! Whatever comes in (one body, several files, a folder, a ZIP) becomes the same thing: paths that cannot leave the bundle, and contents
//! in memory or in a scratch file whose name has nothing to do with the path. References between files are resolved inside the bundle
//! and nowhere else: no path of a scene ever reaches the file system.

mod archive;
mod collect;
mod find;
mod path;

pub use collect::collect;
pub use find::Found;
pub use path::{BadPath, BundlePath, Paths};

use super::format::{self, Format};
use crate::records::Problem;
use kiln_proto::limits;
use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs::File,
    io::{Cursor, Read},
    path::{Path, PathBuf},
};
use tempfile::TempDir;

/// What a scene sent without a name is called.
const UNNAMED: &str = "scene.obj";

/// The bytes of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// In memory.
    Bytes(Vec<u8>),
    /// In a local file.
    File(PathBuf),
}

/// One file of an upload: the name that the client gave, and its content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// As the client wrote it: not to be believed.
    pub name: String,
    /// Its bytes.
    pub content: Content,
}

/// The files of one upload and which of them is the scene.
#[derive(Debug)]
pub struct Bundle {
    main: BundlePath,
    files: BTreeMap<BundlePath, Content>,
    /// Paths in lower case, for references written on systems that ignore case.
    folded: BTreeMap<String, Vec<BundlePath>>,
    /// File names in lower case, for absolute references of another machine.
    names: BTreeMap<String, Vec<BundlePath>>,
    /// Holds the files of an unpacked archive until the bundle is dropped.
    _scratch: Option<TempDir>,
}

impl Bundle {
    /// A bundle from the parts of an upload: one scene file, several files, or one ZIP, which is unpacked into a folder inside `scratch`.
    /// `choice` names the main file where there are several scenes. A lone part may have an empty name.
    ///
    /// # Errors
    /// Unsafe or duplicate paths, too many files or bytes, a broken archive, no scene or more than one, a format that is not read.
    pub fn from_parts(parts: Vec<Part>, choice: Option<&str>, scratch: &Path) -> Result<Self, Problem> {
        if let [part] = parts.as_slice()
            && format::detect(&part.name, &head(part)?) == Format::Zip
        {
            return match &part.content {
                Content::Bytes(bytes) => Self::from_zip(Cursor::new(bytes), choice, scratch),
                Content::File(path) => Self::from_zip(File::open(path).map_err(|e| unreadable(&part.name, &e))?, choice, scratch),
            };
        }
        let only = parts.len() == 1;
        let (mut files, mut paths) = (BTreeMap::new(), Paths::default());
        for part in parts {
            let name = if only && part.name.is_empty() { UNNAMED } else { &part.name };
            let path = paths.take(name).map_err(|e| problem(&part.name, e.to_string()))?;
            refuse_archive(&path, &head(&part)?)?;
            files.insert(path, part.content);
        }
        Self::new(files, choice, None)
    }

    fn new(files: BTreeMap<BundlePath, Content>, choice: Option<&str>, scratch: Option<TempDir>) -> Result<Self, Problem> {
        let main = choose_main(&files, choice)?;
        let mut bundle = Self { main, files, folded: BTreeMap::new(), names: BTreeMap::new(), _scratch: scratch };
        bundle.index()?;
        Ok(bundle)
    }

    /// Checks the bounds and makes the tables by which references are found.
    fn index(&mut self) -> Result<(), Problem> {
        if self.files.len() > limits::BUNDLE_FILES {
            return Err(Problem::new(format!("the bundle has {} files; at most {} are allowed", self.files.len(), limits::BUNDLE_FILES)));
        }
        let total = self.files.iter().try_fold(0u64, |sum, (path, content)| Ok::<u64, Problem>(sum + length(path, content)?))?;
        if total > limits::BUNDLE_BYTES {
            return Err(Problem::new(format!("the bundle has {total} bytes; at most {} are allowed", limits::BUNDLE_BYTES)));
        }
        self.folded.clear();
        self.names.clear();
        for path in self.files.keys() {
            self.folded.entry(path.as_str().to_lowercase()).or_default().push(path.clone());
            self.names.entry(path.file_name().to_lowercase()).or_default().push(path.clone());
        }
        Ok(())
    }

    /// The scene file.
    #[must_use]
    pub fn main(&self) -> &BundlePath {
        &self.main
    }

    /// All paths with their contents, in order of path.
    pub fn files(&self) -> impl Iterator<Item = (&BundlePath, &Content)> {
        self.files.iter()
    }

    /// Adds a local file that the scene itself does not name, beside its main file, under its own name or, where that is taken by another
    /// file, under one with a number. Returns the name by which [`Bundle::find`] finds it from the main file.
    ///
    /// # Errors
    /// A name that cannot be one in a bundle, a file that cannot be read, or more than a bundle may hold.
    pub fn add(&mut self, local: &Path) -> Result<String, Problem> {
        let shown = local.display().to_string();
        let name = local.file_name().and_then(|n| n.to_str()).ok_or_else(|| problem(&shown, "this is not the name of a file"))?;
        if !local.is_file() {
            return Err(problem(&shown, if local.exists() { "this is not a file" } else { "there is no such file" }));
        }
        let content = Content::File(local.to_owned());
        let numbered = (0..=self.files.len()).map(|k| if k == 0 { name.to_owned() } else { format!("{k}-{name}") });
        let free = numbered.map(|name| (self.main.join(&name), name)).find(|(path, _)| {
            let taken = path.as_ref().and_then(|p| self.files.get(p));
            taken.is_none_or(|found| same_file(found, local))
        });
        let Some((Some(path), name)) = free else { return Err(problem(&shown, "this cannot be the name of a file in a bundle")) };
        self.files.insert(path, content);
        self.index()?;
        Ok(name)
    }

    /// The bytes of a file of at most `max` bytes.
    ///
    /// # Errors
    /// A file that is not there, is longer than `max`, or cannot be read.
    pub fn read(&self, path: &BundlePath, max: u64) -> Result<Cow<'_, [u8]>, Problem> {
        let content = self.files.get(path).ok_or_else(|| problem(path.as_str(), "the bundle has no such file"))?;
        let found = length(path, content)?;
        if found > max {
            return Err(problem(path.as_str(), format!("the file has {found} bytes; at most {max} are allowed")));
        }
        match content {
            Content::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
            Content::File(local) => std::fs::read(local).map(Cow::Owned).map_err(|e| unreadable(path.as_str(), &e)),
        }
    }
}

/// Archives inside a bundle would have to be unpacked to be of use, and theirs in turn.
fn refuse_archive(path: &BundlePath, head: &[u8]) -> Result<(), Problem> {
    if format::detect(path.as_str(), head) == Format::Zip {
        return Err(problem(path.as_str(), "this is a ZIP inside the bundle, which is not unpacked; send its files themselves"));
    }
    Ok(())
}

fn choose_main(files: &BTreeMap<BundlePath, Content>, choice: Option<&str>) -> Result<BundlePath, Problem> {
    if let Some(choice) = choice {
        let path = BundlePath::parse(choice).map_err(|e| problem(choice, e.to_string()))?;
        return if files.contains_key(&path) { Ok(path) } else { Err(problem(choice, "the bundle has no such file")) };
    }
    let scenes: Vec<&BundlePath> = files.keys().filter(|p| format::is_scene(p.as_str())).collect();
    match scenes.as_slice() {
        [one] => Ok((*one).clone()),
        [] => Err(no_scene(files)),
        [first, second, ..] => Err(Problem::new(format!(
            "the bundle has {} scenes ({first}, {second}{}); send one, or say which it is",
            scenes.len(),
            if scenes.len() > 2 { ", …" } else { "" }
        ))),
    }
}

fn no_scene(files: &BTreeMap<BundlePath, Content>) -> Problem {
    let other = files.keys().find_map(|p| format::unsupported_by_name(p.as_str()).map(|what| (p, what)));
    match other {
        Some((path, what)) => format::refusal(path.as_str(), what),
        None if files.is_empty() => Problem::new("the bundle is empty"),
        None => Problem::new("the bundle has no scene (.obj, .gltf, .glb, .x3d, .x3dv, .x3dj, .wrl or one of these packed by gzip)"),
    }
}

fn head(part: &Part) -> Result<Vec<u8>, Problem> {
    let mut head = vec![];
    match &part.content {
        Content::Bytes(bytes) => head.extend(bytes.iter().take(64)),
        Content::File(path) => {
            let file = File::open(path).map_err(|e| unreadable(&part.name, &e))?;
            file.take(64).read_to_end(&mut head).map_err(|e| unreadable(&part.name, &e))?;
        }
    }
    Ok(head)
}

/// Whether a content is this very local file.
fn same_file(content: &Content, local: &Path) -> bool {
    let Content::File(own) = content else { return false };
    own.canonicalize().is_ok_and(|own| local.canonicalize().is_ok_and(|local| own == local))
}

fn length(path: &BundlePath, content: &Content) -> Result<u64, Problem> {
    match content {
        Content::Bytes(bytes) => Ok(bytes.len() as u64),
        Content::File(local) => local.metadata().map(|m| m.len()).map_err(|e| unreadable(path.as_str(), &e)),
    }
}

fn problem(file: &str, message: impl Into<String>) -> Problem {
    Problem { message: message.into(), file: Some(file.chars().take(200).collect()), line: None }
}

fn unreadable(file: &str, error: &std::io::Error) -> Problem {
    problem(file, format!("the file cannot be read: {error}"))
}

#[cfg(test)]
mod tests;
