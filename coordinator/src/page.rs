//! The page as it is built into the binary: the dashboard, the page of a job, the viewer, and what they load.
//!
//! Files come from `build.rs` and are embedded in debug builds too, so that a test sees what a user gets. The table is made once, at the
//! first question; a file is compressed when the first browser asks for it, once a process (the largest, three.js, takes about 50 ms).
//! Compressing at build time lost: it makes the binary larger and every build slower. Without the feature `page` there is no file at all.

use flate2::{Compression, write::GzEncoder};
use sha2::{Digest, Sha256};
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
    io::Write,
    sync::{LazyLock, OnceLock},
};

#[cfg(feature = "page")]
include!(concat!(env!("OUT_DIR"), "/page.rs"));

/// The exported viewer's page, as the build names it.
const VIEWER: &str = "viewer.html";
/// The viewer as a library for other pages, under a name that does not change.
const LIBRARY: &str = "kiln-viewer.js";

/// A file of the page.
#[derive(Debug)]
pub struct PageFile {
    /// Its content.
    pub bytes: Cow<'static, [u8]>,
    /// SHA-256 of the content, hexadecimal.
    pub sha256: String,
    /// Its media type.
    pub media_type: &'static str,
    gzip: OnceLock<Option<Vec<u8>>>,
}

impl PageFile {
    fn new(path: &str, bytes: Cow<'static, [u8]>) -> Self {
        let sha256 = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        Self { bytes, sha256, media_type: media_type(path), gzip: OnceLock::new() }
    }

    /// The content compressed, where that makes it smaller.
    #[must_use]
    pub fn gzip(&self) -> Option<&[u8]> {
        let smaller = self.gzip.get_or_init(|| compress(&self.bytes).filter(|packed| packed.len() < self.bytes.len()));
        smaller.as_deref()
    }
}

static FILES: LazyLock<BTreeMap<String, PageFile>> = LazyLock::new(|| {
    let files = embedded().into_iter();
    files.map(|(path, bytes)| (path.clone(), PageFile::new(&path, bytes))).collect()
});

#[cfg(feature = "page")]
fn embedded() -> Vec<(String, Cow<'static, [u8]>)> {
    Dist::iter().filter_map(|path| Dist::get(&path).map(|file| (path.into_owned(), file.data))).collect()
}

#[cfg(not(feature = "page"))]
fn embedded() -> Vec<(String, Cow<'static, [u8]>)> {
    Vec::new()
}

/// A file by its path in the built page, such as `assets/viewer-1a2b3c4d.js`; nothing where there is none, or no page.
#[must_use]
pub fn file(path: &str) -> Option<&'static PageFile> {
    FILES.get(path)
}

/// The paths and files that the viewer needs to stand in a folder by itself, its page under the name `index.html`; none in a build without
/// the page. What belongs to the dashboard and the page of a job is left out.
#[must_use]
pub fn viewer() -> Vec<(&'static str, &'static PageFile)> {
    let texts = FILES.iter().map(|(path, file)| (path.as_str(), &*file.bytes)).collect();
    let needed = reachable(&texts, &[VIEWER, LIBRARY]);
    let files = FILES.iter().filter(|(path, _)| needed.contains(path.as_str()));
    files.map(|(path, file)| (if path == VIEWER { "index.html" } else { path.as_str() }, file)).collect()
}

/// The files that `roots` load, themselves included. A file loads whatever it names: names of built files end in a hash of their content,
/// so that none is found in a text by chance.
fn reachable<'a>(files: &BTreeMap<&'a str, &[u8]>, roots: &[&str]) -> BTreeSet<&'a str> {
    let mut found: BTreeSet<&str> = files.keys().copied().filter(|path| roots.contains(path)).collect();
    let mut open: Vec<&str> = found.iter().copied().collect();
    while let Some(path) = open.pop() {
        let text = String::from_utf8_lossy(files[path]);
        for name in files.keys().copied().filter(|name| name.starts_with("assets/")) {
            if text.contains(name.trim_start_matches("assets/")) && found.insert(name) {
                open.push(name);
            }
        }
    }
    found
}

fn compress(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).ok()?;
    encoder.finish().ok()
}

/// The media types that Vite's output can have here.
fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map(|(_, extension)| extension) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json" | "map") => "application/json",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("jpg") => "image/jpeg",
        Some("ico") => "image/vnd.microsoft.icon",
        Some("woff2") => "font/woff2",
        Some("wasm") => "application/wasm",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use std::io::Read;

    #[test]
    fn the_viewer_s_files_are_those_that_it_names() {
        let files: BTreeMap<&str, &[u8]> = [
            ("viewer.html", &b"<script src=\"./assets/viewer-a1.js\">"[..]),
            ("assets/viewer-a1.js", b"import './three-b2.js'; new URL('expand-c3.js', import.meta.url)"),
            ("assets/three-b2.js", b"import './viewer-a1.js'"),
            ("assets/expand-c3.js", b""),
            ("assets/job-d4.js", b"import './three-b2.js'"),
            ("index.html", b""),
        ]
        .into();
        let expected = ["assets/expand-c3.js", "assets/three-b2.js", "assets/viewer-a1.js", "viewer.html"];
        assert_eq!(reachable(&files, &["viewer.html"]), expected.into());
    }

    #[test]
    fn compression_is_kept_only_where_it_helps() {
        let text = PageFile::new("a.js", Cow::from(vec![b'x'; 10_000]));
        let mut plain = Vec::new();
        GzDecoder::new(text.gzip().unwrap()).read_to_end(&mut plain).unwrap();
        assert_eq!((plain.as_slice(), text.media_type), (&*text.bytes, "text/javascript; charset=utf-8"));
        assert_eq!(PageFile::new("a.png", Cow::from(b"x".to_vec())).gzip(), None);
    }

    #[test]
    #[cfg(feature = "page")]
    fn the_exported_viewer_stands_by_itself() {
        let names: Vec<&str> = viewer().into_iter().map(|(path, _)| path).collect();
        assert!(names.contains(&"index.html") && names.contains(&LIBRARY) && !names.contains(&VIEWER), "{names:?}");
        assert!(!names.contains(&"job.html"), "{names:?}");
    }
}
