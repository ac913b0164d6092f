//! The document: nodes in one list, referring to each other by number.
//!
//! `USE` is the same number twice, so a node is read, animated and baked into memory once however often it stands in the scene. The graph
//! has no cycles and no path longer than [`MAX_DEPTH`](super::limits::MAX_DEPTH) nodes: whoever walks it may recurse. It is not a tree:
//! a node may be reached by exponentially many paths, so whoever copies what hangs below a node has to count.

use super::{node::NodeRef, table::NodeType, value::Value};
use crate::import::{BundlePath, findings::At};
use std::{collections::BTreeMap, sync::Arc};

/// A node's number in its document.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct NodeId(pub(super) u32);

/// A place in one of the document's files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(crate) struct Place {
    /// Index into [`Document::files`].
    pub(crate) file: u32,
    /// From 1.
    pub(crate) line: u32,
    /// In characters, from 1.
    pub(crate) column: u32,
}

/// A field as the file or an event set it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Set {
    /// Index into the fields of the node's type.
    pub(super) field: u16,
    /// Where the value stands.
    pub(super) place: Place,
    pub(super) value: Value,
}

/// One node.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub(super) kind: &'static NodeType,
    /// Where its type name stands.
    pub(super) place: Place,
    pub(super) def: Option<Arc<str>>,
    /// The fields that have a value of their own.
    pub(super) fields: Vec<Set>,
    /// Nodes on the longest path down from here, itself included.
    pub(super) height: u16,
}

impl Node {
    pub(super) fn get(&self, field: u16) -> Option<&Set> {
        self.fields.iter().find(|s| s.field == field)
    }

    /// Sets a field, in place of an earlier value.
    pub(super) fn set(&mut self, set: Set) {
        match self.fields.iter_mut().find(|s| s.field == set.field) {
            Some(old) => *old = set,
            None => self.fields.push(set),
        }
    }
}

/// What an Inline node brought in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Inlined {
    /// X3D: the roots of the file, in metres as seen from the Inline.
    Nodes(Vec<NodeId>),
    /// A file of another format, for the importer of that format.
    File(BundlePath),
}

/// One way of an event, from a field that can send to a field of the same type that can receive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Route {
    /// The sender and the index of its field.
    pub(super) from: (NodeId, u16),
    /// The receiver and the index of its field.
    pub(super) to: (NodeId, u16),
    /// What values are multiplied by on the way: radians per unit where plain numbers become angles in a file with a unit of its own.
    pub(super) factor: f32,
    pub(super) place: Place,
}

/// A scene as its files say it, units converted to metres and radians, prototypes expanded, files inlined.
#[derive(Debug, Default)]
pub(crate) struct Document {
    /// That of the main file, times ten: 20 for VRML97, 33 for X3D 3.3; 0 where it says none.
    pub(super) version: u32,
    pub(super) nodes: Vec<Node>,
    pub(super) roots: Vec<NodeId>,
    pub(super) routes: Vec<Route>,
    pub(super) files: Vec<BundlePath>,
    pub(super) inlines: BTreeMap<NodeId, Inlined>,
}

impl Document {
    /// The nodes at the top of the main file, in their order.
    pub(crate) fn roots(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.roots.iter().map(|id| self.node(*id))
    }

    /// A node by number.
    pub(crate) fn node(&self, id: NodeId) -> NodeRef<'_> {
        NodeRef { document: self, id }
    }

    /// Every node that was read, reachable or not, in the order of the files.
    #[cfg(test)]
    pub(crate) fn nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        (0..self.nodes.len()).map(|i| self.node(NodeId(i as u32)))
    }

    /// The files read, the main one first.
    pub(crate) fn files(&self) -> &[BundlePath] {
        &self.files
    }

    /// The file of a place.
    pub(crate) fn file(&self, place: Place) -> &BundlePath {
        &self.files[place.file as usize]
    }

    /// A place for findings.
    pub(crate) fn at(&self, place: Place) -> At<'_> {
        At::column(self.file(place).as_str(), place.line, place.column)
    }
}
