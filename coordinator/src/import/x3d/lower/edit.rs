//! Changes to a document by names of types and fields.
//!
//! A name that the table does not have changes nothing: that is a slip of the caller, which tests catch.

use crate::import::{
    findings::At,
    x3d::{
        document::{Document, Inlined, Node, NodeId, Route, Set},
        table,
        value::Value,
    },
};
use std::sync::Arc;

/// A document that is being changed.
pub(super) struct Editor<'d> {
    document: &'d mut Document,
    /// How often each node of the original stands somewhere.
    uses: Vec<usize>,
}

impl<'d> Editor<'d> {
    pub(super) fn new(document: &'d mut Document) -> Self {
        let mut uses = vec![0; document.nodes.len()];
        let fields = document.nodes.iter().flat_map(|n| &n.fields).flat_map(|set| set.value.nodes());
        let inlined = document.inlines.values().flat_map(|i| if let Inlined::Nodes(ids) = i { &ids[..] } else { &[] });
        for id in fields.chain(&document.roots).chain(inlined) {
            uses[id.0 as usize] += 1;
        }
        Self { document, uses }
    }

    fn raw(&self, id: NodeId) -> &Node {
        &self.document.nodes[id.0 as usize]
    }

    /// All nodes of a type, in the order of the file.
    pub(super) fn of_kind(&self, kind: &str) -> Vec<NodeId> {
        let all = self.document.nodes.iter().enumerate();
        all.filter(|(_, node)| node.kind.name == kind).map(|(i, _)| NodeId(i as u32)).collect()
    }

    pub(super) fn kind(&self, id: NodeId) -> &'static str {
        self.raw(id).kind.name
    }

    pub(super) fn at(&self, id: NodeId) -> At<'_> {
        self.document.at(self.raw(id).place)
    }

    /// Whether nodes of its type have such a field.
    pub(super) fn has(&self, id: NodeId, field: &str) -> bool {
        self.raw(id).kind.field(field).is_some()
    }

    /// The nodes of a field.
    pub(super) fn nodes(&self, id: NodeId, field: &str) -> Vec<NodeId> {
        self.document.node(id).children(field).map(|n| n.id).collect()
    }

    /// The node of a field.
    pub(super) fn node(&self, id: NodeId, field: &str) -> Option<NodeId> {
        self.document.node(id).node(field).map(|n| n.id)
    }

    /// The strings of a field.
    pub(super) fn strings(&self, id: NodeId, field: &str) -> Vec<Arc<str>> {
        self.document.node(id).mf_string(field).to_vec()
    }

    /// Gives a field a value, said to stand where the node begins.
    pub(super) fn set(&mut self, id: NodeId, field: &str, value: Value) {
        let below = value.nodes().iter().map(|n| self.raw(*n).height + 1).max().unwrap_or(1);
        let node = &mut self.document.nodes[id.0 as usize];
        if let Some((field, _)) = node.kind.field(field) {
            node.height = node.height.max(below);
            node.set(Set { field, place: node.place, value });
        }
    }

    /// A new node, said to stand where `like` does; `like` itself if the table has no such type.
    pub(super) fn create(&mut self, kind: &str, like: NodeId) -> NodeId {
        let Some(kind) = table::lookup(kind) else { return like };
        let place = self.raw(like).place;
        self.push(Node { kind, place, def: None, fields: vec![], height: 1 })
    }

    fn push(&mut self, node: Node) -> NodeId {
        self.document.nodes.push(node);
        NodeId(self.document.nodes.len() as u32 - 1)
    }

    /// Copies what a node of the same type sets.
    pub(super) fn copy_fields(&mut self, from: NodeId, to: NodeId) {
        if self.raw(from).kind == self.raw(to).kind {
            self.document.nodes[to.0 as usize].fields = self.raw(from).fields.clone();
        }
    }

    /// The node itself if all its uses are the caller's, a copy with the same ROUTEs otherwise.
    pub(super) fn own(&mut self, id: NodeId, mine: usize) -> NodeId {
        if self.uses.get(id.0 as usize).is_none_or(|uses| *uses <= mine) {
            return id;
        }
        self.uses[id.0 as usize] -= mine;
        let copy = Node { def: None, ..self.raw(id).clone() };
        for child in copy.fields.iter().flat_map(|set| set.value.nodes()) {
            if let Some(uses) = self.uses.get_mut(child.0 as usize) {
                *uses += 1;
            }
        }
        let copy = self.push(copy);
        let moved = |end: (NodeId, u16)| if end.0 == id { (copy, end.1) } else { end };
        let routes = self.document.routes.iter().filter(|r| r.from.0 == id || r.to.0 == id);
        let more: Vec<Route> = routes.map(|r| Route { from: moved(r.from), to: moved(r.to), ..*r }).collect();
        self.document.routes.extend(more);
        copy
    }
}
