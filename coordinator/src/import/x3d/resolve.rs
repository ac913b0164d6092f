//! From what files say to what they mean: names, prototypes, files in files, units, types.
//!
//! Items are walked in the order of the file, because X3D's names mean the last thing that had them: the same DEF twice is two nodes, and
//! a prototype sees only what was declared before it. Each file and each instance of a prototype is a [`Frame`] with names of its own; all
//! of them fill one document. Whatever can multiply (prototypes in prototypes, files in files, nodes in nodes) is counted against
//! `limits`, so the cost is linear in the files but for what instances honestly multiply.

mod file;
mod frame;
mod instance;
mod node;
mod proto;
mod route;
mod skip;
mod tally;
#[cfg(test)]
mod tests;
mod value;

use super::{
    document::{Document, Node, NodeId, Place, Set},
    limits::{MAX_DEPTH, MAX_NODES, MAX_STEPS},
    syntax::File,
    value::Value,
};
use crate::import::{
    Bundle, BundlePath,
    findings::{At, Findings},
};
use frame::{Frame, Target};
use proto::{Library, Prototype, Scope};
use std::{collections::BTreeMap, rc::Rc};
use tally::Tally;

/// Reads the main file with all that it refers to; `None` where it cannot be read at all.
pub(super) fn resolve(bundle: &Bundle, main: &BundlePath, bytes: &[u8], findings: &mut Findings) -> Option<Document> {
    let mut resolver = Resolver::new(bundle, findings);
    let roots = resolver.main(main, bytes);
    let Resolver { mut document, tally, findings, .. } = resolver;
    tally.report(&document, findings);
    document.roots = roots?;
    Some(document)
}

struct Resolver<'a> {
    bundle: &'a Bundle,
    findings: &'a mut Findings,
    document: Document,
    tally: Tally,
    /// Files by path; `None` for those that cannot be read, which is said once.
    files: BTreeMap<BundlePath, Option<Rc<File>>>,
    /// Whether files that are inlined are X3D; `None` for those that cannot be read.
    kinds: BTreeMap<BundlePath, Option<bool>>,
    /// What a file inlined without a DEF came to, by its path and scale: the same nodes for every such Inline.
    inlined: BTreeMap<(BundlePath, u64), Vec<NodeId>>,
    /// The files being inlined, outermost first.
    inlining: Vec<BundlePath>,
    libraries: BTreeMap<BundlePath, Option<Library>>,
    prototypes: Vec<Prototype>,
    scopes: Vec<Scope>,
    /// The prototypes being instantiated, outermost first.
    instancing: Vec<usize>,
    /// The nodes whose bodies are being read, outermost first.
    open: Vec<NodeId>,
    /// Nodes being read inside one another, with instances and defaults.
    depth: usize,
    /// What Inline nodes export.
    exports: BTreeMap<NodeId, BTreeMap<Box<str>, Target>>,
    /// What may still be looked at: [`MAX_STEPS`] and a step for each byte of text, in which nothing takes less.
    steps_left: u64,
    /// Whether a bound was met, so that what is missing is no one's fault.
    exhausted: bool,
}

impl<'a> Resolver<'a> {
    fn new(bundle: &'a Bundle, findings: &'a mut Findings) -> Self {
        Self {
            bundle,
            findings,
            document: Document::default(),
            tally: Tally::default(),
            files: BTreeMap::new(),
            kinds: BTreeMap::new(),
            inlined: BTreeMap::new(),
            inlining: vec![],
            libraries: BTreeMap::new(),
            prototypes: vec![],
            scopes: vec![],
            instancing: vec![],
            open: vec![],
            depth: 0,
            exports: BTreeMap::new(),
            steps_left: MAX_STEPS,
            exhausted: false,
        }
    }

    fn error(&mut self, place: Place, message: impl Into<String>) {
        let file = &self.document.files[place.file as usize];
        self.findings.error(At::column(file.as_str(), place.line, place.column), message);
    }

    fn warn(&mut self, place: Place, message: impl Into<String>) {
        let file = &self.document.files[place.file as usize];
        self.findings.warn(At::column(file.as_str(), place.line, place.column), message);
    }

    /// Counts a thing to do; whether to do it.
    fn step(&mut self, place: Place) -> bool {
        self.steps(place, 1)
    }

    fn steps(&mut self, place: Place, count: u64) -> bool {
        self.steps_left = self.steps_left.saturating_sub(count);
        if self.steps_left == 0 && !self.exhausted {
            self.exhausted = true;
            self.error(place, format!("the prototypes expand to more than {MAX_STEPS} fields, nodes and routes beyond those in the files"));
        }
        !self.exhausted && !self.findings.is_full()
    }

    /// Adds a node to the document.
    fn push(&mut self, node: Node) -> Option<NodeId> {
        if self.document.nodes.len() >= MAX_NODES {
            if !self.exhausted {
                self.exhausted = true;
                self.error(
                    node.place,
                    format!("the scene has more than {MAX_NODES} nodes, with its prototypes expanded and files inlined"),
                );
            }
            return None;
        }
        let id = NodeId(self.document.nodes.len() as u32);
        self.document.nodes.push(node);
        Some(id)
    }

    fn node_mut(&mut self, id: NodeId) -> &mut Node {
        &mut self.document.nodes[id.0 as usize]
    }

    fn node_of(&self, id: NodeId) -> &Node {
        &self.document.nodes[id.0 as usize]
    }

    /// Sets a field of a node that has `above` nodes above it. Nodes in the value that would make a path too long are left out.
    fn set(&mut self, id: NodeId, field: u16, place: Place, value: Value, above: u16) {
        let value = if let Value::Nodes(children) = &value {
            let kept: Vec<NodeId> = children.iter().copied().filter(|c| self.fits(*c, place, above + 1)).collect();
            let height = kept.iter().map(|c| self.node_of(*c).height).max().unwrap_or_default();
            let node = self.node_mut(id);
            node.height = node.height.max(height + 1);
            if kept.len() == children.len() { value } else { Value::Nodes(kept.into()) }
        } else {
            value
        };
        self.node_mut(id).set(Set { field, place, value });
    }

    /// Whether a node may hang below `above` others.
    fn fits(&mut self, id: NodeId, place: Place, above: u16) -> bool {
        let fits = above.saturating_add(self.node_of(id).height) <= MAX_DEPTH;
        if !fits {
            self.error(place, format!("more than {MAX_DEPTH} nodes inside one another, with what is used and instantiated here"));
        }
        fits
    }

    fn is_open(&self, id: NodeId) -> bool {
        self.open.contains(&id)
    }

    /// The names of a file or an instance are complete: what referred forward is looked up again.
    fn finish(&mut self, frame: &mut Frame) -> BTreeMap<Box<str>, Target> {
        for route in std::mem::take(&mut frame.late_routes) {
            self.route(frame, &route, true);
        }
        self.export(frame)
    }
}
