//! A document as a text again, in XML or ClassicVRML.
//!
//! Prototypes are expanded and files inlined in a document, units are metres and radians, so the text stands by itself and says the same. A
//! field that has its default is not written, unless the standard has changed that default. A node that stands in several places, or is
//! an end of a ROUTE, has a DEF: its author's name where that is free, else one made for it. Both encodings are written by one walk, in one
//! order, so that names come out alike; what differs is brackets and quotes.

mod classic;
mod literal;
mod names;
#[cfg(test)]
mod tests;
mod xml;

use super::{
    document::{Document, NodeId, Route, Set},
    table::Field,
    value::Value,
};
use names::Names;
use std::collections::BTreeSet;

/// The encodings that can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum X3dEncoding {
    /// ISO/IEC 19776-1, `.x3d`.
    Xml,
    /// ISO/IEC 19776-2, `.x3dv`.
    Classic,
}

/// The earliest version that is X3D and not VRML97.
const EARLIEST: u32 = 30;

/// A text, and what could not be said in it.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) text: String,
    /// ROUTEs from or to nodes that stand nowhere in the scene.
    pub(super) lost_routes: usize,
    /// Characters of strings that no text may have.
    pub(super) lost_characters: usize,
}

/// The text of a document. Cost: linear in what is written; recursion as deep as the document.
pub(super) fn write(document: &Document, encoding: X3dEncoding) -> Written {
    let names = Names::of(document);
    let routes: Vec<&Route> =
        document.routes.iter().filter(|r| r.factor == 1.0 && names.get(r.from.0).is_some() && names.get(r.to.0).is_some()).collect();
    let lost_routes = document.routes.len() - routes.len();
    let mut writer = Writer { document, names, begun: BTreeSet::new(), out: String::new(), depth: 0, lost: 0 };
    let version = document.version.max(EARLIEST);
    match encoding {
        X3dEncoding::Xml => writer.xml(version, &routes),
        X3dEncoding::Classic => writer.classic(version, &routes),
    }
    Written { text: writer.out, lost_routes, lost_characters: writer.lost }
}

struct Writer<'d> {
    document: &'d Document,
    names: Names,
    /// Nodes written so far, or being written.
    begun: BTreeSet<NodeId>,
    out: String,
    depth: usize,
    lost: usize,
}

/// The fields of a node that have to be written: the simple ones, then those that hold nodes.
struct Fields<'d> {
    simple: Vec<(&'d Field, &'d Value)>,
    nodes: Vec<(&'d Field, &'d [NodeId])>,
}

impl<'d> Writer<'d> {
    /// The name by which a node is used, if it stands further above.
    fn usage(&mut self, id: NodeId) -> Option<String> {
        if self.begun.insert(id) { None } else { self.names.get(id).map(str::to_owned) }
    }

    fn fields(&self, id: NodeId) -> Fields<'d> {
        let node = &self.document.nodes[id.0 as usize];
        let mut fields = Fields { simple: vec![], nodes: vec![] };
        for Set { field, value, .. } in &node.fields {
            let field = &node.kind.fields[usize::from(*field)];
            if !field.access.has_value() {
                continue;
            }
            match value {
                Value::Nodes(ids) => fields.nodes.extend((!ids.is_empty()).then_some((field, &ids[..]))),
                value if *value != field.default || field.since.is_some() => fields.simple.push((field, value)),
                _ => {}
            }
        }
        fields
    }

    /// A line of its own, indented.
    fn line(&mut self, text: &str) {
        self.indent();
        self.out.push_str(text);
        self.out.push('\n');
    }

    fn indent(&mut self) {
        self.out.extend(std::iter::repeat_n("  ", self.depth));
    }

    /// The two ends of a ROUTE: names of nodes and fields.
    fn ends(&self, route: &Route) -> [(String, &'static str); 2] {
        [route.from, route.to].map(|(id, field)| {
            let name = self.names.get(id).unwrap_or_default().to_owned();
            (name, self.document.nodes[id.0 as usize].kind.fields[usize::from(field)].name)
        })
    }
}
