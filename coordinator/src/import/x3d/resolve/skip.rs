//! What is passed by: nodes that nobody knows or that are not supported, with all that is in them, except what may be used elsewhere.

use super::{
    Resolver,
    frame::{Frame, Target},
};
use crate::import::x3d::{
    literal::shown,
    syntax::{FieldItem, Item, NodeItem, Written},
    table::{self, NodeType},
};

impl Resolver<'_> {
    /// Passes a node by. Nodes with a DEF inside it are read all the same: they may be used elsewhere.
    pub(super) fn skip(&mut self, frame: &mut Frame, item: &NodeItem, kind: Option<&'static NodeType>, above: u16) {
        if let Some(def) = &item.def {
            frame.names.insert(def.clone(), Target::Skipped(kind));
        }
        self.skip_items(frame, &item.body, above + 1);
    }

    pub(super) fn skip_items(&mut self, frame: &mut Frame, items: &[Item], above: u16) {
        for item in items {
            match item {
                Item::Node(node) if node.usage.is_some() => {}
                Item::Node(node) => self.skip_inner(frame, node, above),
                Item::Field(FieldItem { written: Written::Nodes(nodes), .. }) | Item::Declared { nodes, .. } => {
                    self.skip_items(frame, nodes, above);
                }
                other => self.statement(frame, other),
            }
        }
    }

    /// A node inside one that is passed by: what nobody knows is named all the same, what is only not supported goes without saying.
    fn skip_inner(&mut self, frame: &mut Frame, node: &NodeItem, above: u16) {
        if self.descend(node.place, above) {
            self.skip_one(frame, node, above);
            self.depth -= 1;
        }
    }

    fn skip_one(&mut self, frame: &mut Frame, node: &NodeItem, above: u16) {
        let known = table::lookup(&node.name);
        let prototype = self.prototype(frame.scope, &node.name).filter(|_| known.is_none());
        match known {
            Some(kind) if kind.skipped => {
                self.skip(frame, node, Some(kind), above);
            }
            _ if node.def.is_some() => {
                self.node(frame, node, above);
            }
            None if prototype.is_none_or(|p| self.definition(p).is_none()) => self.unknown(frame, node, prototype, above),
            _ => self.skip_items(frame, &node.body, above + 1),
        }
    }

    /// Names a node that nobody knows, and passes it by.
    pub(super) fn unknown(&mut self, frame: &mut Frame, node: &NodeItem, prototype: Option<usize>, above: u16) {
        let name = shown(&node.name);
        let what = match prototype {
            Some(_) => format!("the external prototype `{name}` was not found and its instances were skipped"),
            None => format!("the node `{name}` is unknown and was skipped"),
        };
        self.tally.add(node.place, what);
        self.skip(frame, node, None, above);
    }
}
