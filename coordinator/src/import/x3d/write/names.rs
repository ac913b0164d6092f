//! Which nodes need a name, and which they get.

use crate::import::{
    name::Names as Unique,
    x3d::document::{Document, NodeId},
};
use std::collections::{BTreeMap, BTreeSet};

/// Words that ClassicVRML keeps for itself.
const KEYWORDS: [&str; 24] = [
    "AS",
    "COMPONENT",
    "DEF",
    "EXPORT",
    "EXTERNPROTO",
    "FALSE",
    "IMPORT",
    "IS",
    "META",
    "NULL",
    "PROFILE",
    "PROTO",
    "ROUTE",
    "TO",
    "TRUE",
    "UNIT",
    "USE",
    "eventIn",
    "eventOut",
    "exposedField",
    "field",
    "initializeOnly",
    "inputOnly",
    "inputOutput",
];

/// The names of the nodes that are written.
#[derive(Debug, Default)]
pub(super) struct Names(BTreeMap<NodeId, String>);

impl Names {
    /// Names for what a document's roots reach: authors' names first come, first served in the order of writing.
    pub(super) fn of(document: &Document) -> Self {
        let mut found = Found::default();
        let mut stack: Vec<NodeId> = document.roots.iter().rev().copied().collect();
        while let Some(id) = stack.pop() {
            if !found.seen.insert(id) {
                found.shared.insert(id);
                continue;
            }
            found.order.push(id);
            let node = &document.nodes[id.0 as usize];
            stack.extend(node.fields.iter().rev().flat_map(|set| set.value.nodes().iter().rev()));
        }
        let ends = document.routes.iter().flat_map(|r| [r.from.0, r.to.0]);
        found.shared.extend(ends.filter(|id| found.seen.contains(id)));
        let (mut unique, mut names) = (Unique::default(), BTreeMap::new());
        for id in found.order {
            let node = &document.nodes[id.0 as usize];
            let wanted = match &node.def {
                Some(def) => legal(def),
                None if found.shared.contains(&id) => format!("{}-shared", node.kind.name),
                None => continue,
            };
            names.insert(id, unique.take(&wanted));
        }
        Self(names)
    }

    /// The name of a node; `None` where it needs none, or is not written.
    pub(super) fn get(&self, id: NodeId) -> Option<&str> {
        self.0.get(&id).map(String::as_str)
    }
}

#[derive(Default)]
struct Found {
    seen: BTreeSet<NodeId>,
    /// What is reached twice or is the end of a route.
    shared: BTreeSet<NodeId>,
    order: Vec<NodeId>,
}

/// A name that every encoding can say (ISO/IEC 19776-2, 4.2: what an Id may begin and go on with).
fn legal(name: &str) -> String {
    let is_mark = |c: char| c.is_whitespace() || c.is_control() || "\"#',.[]\\{}".contains(c);
    let mut legal: String = name.chars().map(|c| if is_mark(c) { '_' } else { c }).collect();
    if legal.starts_with(|c: char| c.is_ascii_digit() || c == '+' || c == '-') || legal.is_empty() || KEYWORDS.contains(&legal.as_str()) {
        legal.insert(0, '_');
    }
    legal
}
