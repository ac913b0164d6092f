//! X3D in, X3D out: a document by itself, its files inlined, and the shadow shortcut written out where that is asked for.

use super::{
    document::{Document, Inlined, NodeId, Set},
    limits::MAX_DEPTH,
    lower, read, table,
    value::Value,
    write::{self, X3dEncoding},
};
use crate::{
    import::{
        Bundle, BundlePath,
        bundle::Found,
        findings::{At, Findings},
        uri,
    },
    records::Problem,
};
use kiln_proto::limits;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

/// An X3D file that was written anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rewritten {
    /// The file.
    pub text: String,
    /// What was left out or changed.
    pub warnings: Vec<Problem>,
    /// Appearances whose `receiveShadows` was written out.
    pub lowered: usize,
    /// Files that it still refers to: paths from the folder of the main file.
    pub files: Vec<String>,
}

/// Reads the main file of a bundle, X3D or VRML97, at `time` (see [`ImportOptions`](kiln_proto::options::ImportOptions)), and writes it in
/// another encoding, with its prototypes expanded and its X3D files inlined; with `lower_shadows`, `receiveShadows` is written out as
/// shadow maps and projected coordinates (Kamburelis 4.7).
///
/// # Errors
/// Every fault found in the file, located, as for an import.
pub fn rewrite(bundle: &Bundle, time: Option<f64>, lower_shadows: bool, encoding: X3dEncoding) -> Result<Rewritten, Vec<Problem>> {
    let mut findings = Findings::default();
    let main = bundle.main();
    let bytes = bundle.read(main, limits::TEXT_BYTES).map_err(|problem| vec![problem])?;
    let document = read(bundle, main, &bytes, time, &mut findings).filter(|_| !findings.has_errors());
    let Some(mut document) = document else { return Err(findings.into_errors(main.as_str())) };
    let files = flatten(bundle, &mut document, &mut findings);
    let lowered = if lower_shadows { lower::lower(&mut document, &mut findings) } else { 0 };
    if depth(&document) > MAX_DEPTH {
        let message =
            format!("with its files inlined and its shadows written out the scene has more than {MAX_DEPTH} nodes inside one another");
        findings.error(At::file(main.as_str()), message);
        return Err(findings.into_errors(main.as_str()));
    }
    let written = write::write(&document, encoding);
    if written.lost_routes > 0 {
        let message = "ROUTEs from or to nodes that stand nowhere in the scene, or between angles of other units, were left out";
        findings.warn(At::file(main.as_str()), format!("{message}: {}", written.lost_routes));
    }
    if written.lost_characters > 0 {
        let message = "control characters in strings, which X3D cannot say, were replaced by U+FFFD";
        findings.warn(At::file(main.as_str()), format!("{message}: {}", written.lost_characters));
    }
    Ok(Rewritten { text: written.text, warnings: findings.into_warnings(), lowered, files })
}

/// Nodes on the longest path of a document. Cost: linear; recursion as deep.
fn depth(document: &Document) -> u16 {
    fn of(document: &Document, id: NodeId, known: &mut [u16]) -> u16 {
        let at = id.0 as usize;
        if known[at] == 0 {
            let children = document.nodes[at].fields.iter().flat_map(|set| set.value.nodes());
            known[at] = children.map(|child| of(document, *child, known)).max().unwrap_or_default().saturating_add(1);
        }
        known[at]
    }
    let mut known = vec![0; document.nodes.len()];
    document.roots.iter().map(|root| of(document, *root, &mut known)).max().unwrap_or_default()
}

/// Makes one file of a document: what Inline nodes brought in becomes a Group in their place, addresses count from the main file. Returns
/// the files that are still referred to.
pub(super) fn flatten(bundle: &Bundle, document: &mut Document, findings: &mut Findings) -> Vec<String> {
    let main = document.files.first().cloned();
    let mut files = vec![];
    for index in 0..document.nodes.len() {
        let id = NodeId(index as u32);
        match document.inlines.remove(&id) {
            Some(Inlined::Nodes(children)) => {
                findings.count(document.at(document.nodes[index].place), "Inline nodes were replaced by a Group with what they bring in");
                group(document, id, children);
            }
            Some(file @ Inlined::File(_)) => {
                document.inlines.insert(id, file);
            }
            None => {}
        }
        if let Some(main) = &main {
            files.extend(addresses(bundle, document, index, main));
        }
    }
    files.sort();
    files.dedup();
    files
}

/// Makes a Group of an Inline. Fields that a Group has too are kept, and ROUTEs to them.
fn group(document: &mut Document, id: NodeId, children: Vec<NodeId>) {
    let Some(kind) = table::lookup("Group") else { return };
    let Some((field, _)) = kind.field("children") else { return };
    let node = &mut document.nodes[id.0 as usize];
    let old = std::mem::replace(&mut node.kind, kind);
    let kept: BTreeMap<u16, u16> = old.fields.iter().enumerate().filter_map(|(i, f)| Some((i as u16, kind.field(f.name)?.0))).collect();
    let fields = std::mem::take(&mut node.fields);
    node.fields = fields.into_iter().filter_map(|set| Some(Set { field: *kept.get(&set.field)?, ..set })).collect();
    let place = node.place;
    node.set(Set { field, place, value: Value::Nodes(children.into()) });
    document.routes.retain_mut(|route| {
        [&mut route.from, &mut route.to].into_iter().filter(|end| end.0 == id).all(|end| {
            let new = kept.get(&end.1);
            end.1 = new.copied().unwrap_or(end.1);
            new.is_some()
        })
    });
}

/// Writes the addresses of a node anew that were written in another file than the main one; returns the files that are meant.
fn addresses(bundle: &Bundle, document: &mut Document, index: usize, main: &BundlePath) -> Vec<String> {
    let mut files = vec![];
    let node = &mut document.nodes[index];
    for set in &mut node.fields {
        let Value::Strings(list) = &set.value else { continue };
        if !node.kind.fields[usize::from(set.field)].name.to_ascii_lowercase().ends_with("url") {
            continue;
        }
        let from = document.files.get(set.place.file as usize).unwrap_or(main);
        let (mut anew, mut written): (Vec<Arc<str>>, BTreeSet<Arc<str>>) = (vec![], BTreeSet::new());
        for url in list.iter() {
            let address = match meant(bundle, from, url.trim()) {
                None => Arc::clone(url),
                Some((path, fragment)) => {
                    let relative = relative(main, path);
                    let address = format!("{}{fragment}", uri::encoded(&relative));
                    files.push(relative);
                    if set.place.file == 0 { Arc::clone(url) } else { Arc::from(address) }
                }
            };
            // Archives list a file beside its copies on the web, which are the same here.
            if written.insert(Arc::clone(&address)) {
                anew.push(address);
            }
        }
        set.value = Value::Strings(anew.into());
    }
    files
}

/// The file of the bundle that an address means, found as an import finds it, and what follows from its `#`.
fn meant<'b, 'u>(bundle: &'b Bundle, from: &BundlePath, url: &'u str) -> Option<(&'b BundlePath, &'u str)> {
    if uri::is_data(url) {
        return None;
    }
    let path = |address| bundle.find_address(from, address).map(Found::path);
    let whole = path(url).map(|path| (path, ""));
    whole.or_else(|| {
        let at = url.find('#').filter(|at| *at > 0)?;
        Some((path(&url[..at])?, &url[at..]))
    })
}

/// The address of a file of the bundle as written in another.
fn relative(from: &BundlePath, to: &BundlePath) -> String {
    let folders: Vec<&str> = from.as_str().split('/').collect();
    let folders = &folders[..folders.len() - 1];
    let parts: Vec<&str> = to.as_str().split('/').collect();
    let shared = folders.iter().zip(&parts[..parts.len() - 1]).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..", folders.len() - shared);
    up.chain(parts[shared..].iter().copied()).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_lead_from_one_folder_to_another() {
        let of = |from: &str, to: &str| relative(&BundlePath::parse(from).unwrap(), &BundlePath::parse(to).unwrap());
        assert_eq!(of("a.x3d", "b.png"), "b.png");
        assert_eq!(of("s/a.x3d", "s/t/b.png"), "t/b.png");
        assert_eq!(of("s/a.x3d", "t/b.png"), "../t/b.png");
        assert_eq!(of("s/t/a.x3d", "b.png"), "../../b.png");
    }
}
