//! What a file says, before anyone knows what it means: nodes, fields and statements in the order of the file, the same for every
//! encoding. Values are ranges of the text.

use super::{
    document::Place,
    literal::Form,
    table::Access,
    value::{FieldType, Value},
};
use std::{cell::OnceCell, ops::Range, rc::Rc};

/// The text of a file.
#[derive(Debug)]
pub(super) struct Source {
    /// Index into the document's files.
    pub(super) file: u32,
    pub(super) text: String,
    pub(super) form: Form,
}

/// One file.
#[derive(Debug)]
pub(super) struct File {
    pub(super) source: Source,
    /// Times ten: 20 for VRML97, 33 for X3D 3.3.
    pub(super) version: u32,
    pub(super) units: Vec<Unit>,
    pub(super) items: Vec<Item>,
}

/// `UNIT category name factor`.
#[derive(Debug)]
pub(super) struct Unit {
    pub(super) place: Place,
    pub(super) category: Box<str>,
    pub(super) factor: Box<str>,
}

/// What can stand in a file or in the body of a node.
#[derive(Debug)]
pub(super) enum Item {
    Node(NodeItem),
    Field(FieldItem),
    Route(RouteItem),
    Proto(Rc<ProtoItem>),
    /// `IMPORT inline.exported AS local`.
    Import {
        place: Place,
        inline: Box<str>,
        exported: Box<str>,
        local: Box<str>,
    },
    /// `EXPORT local AS exported`.
    Export {
        place: Place,
        local: Box<str>,
        exported: Box<str>,
    },
    /// A field that a node declares for itself, as scripts and shaders do, and the nodes in its value.
    Declared {
        place: Place,
        nodes: Vec<Item>,
    },
}

/// A node, or the use of one.
#[derive(Debug)]
pub(super) struct NodeItem {
    pub(super) place: Place,
    /// Its type; empty for a `USE` that names none.
    pub(super) name: Box<str>,
    pub(super) def: Option<Box<str>>,
    pub(super) usage: Option<Box<str>>,
    /// The field of the parent, where the encoding puts it here.
    pub(super) container: Option<Box<str>>,
    pub(super) body: Vec<Item>,
}

/// A field and its value.
#[derive(Debug)]
pub(super) struct FieldItem {
    /// Where the value begins.
    pub(super) place: Place,
    pub(super) name: Box<str>,
    pub(super) written: Written,
    /// The value, once it was read: the body of a prototype is read once and not for every instance. `None` if there was none in it.
    pub(super) read: OnceCell<Option<Value>>,
}

impl FieldItem {
    pub(super) fn new(place: Place, name: impl Into<Box<str>>, written: Written) -> Self {
        Self { place, name: name.into(), written, read: OnceCell::new() }
    }
}

/// A value as written.
#[derive(Debug)]
pub(super) enum Written {
    /// Anything but nodes.
    Text(Span),
    /// Nodes; statements may stand among them.
    Nodes(Vec<Item>),
    /// The field of this name of the prototype that the node is part of.
    Is(Box<str>),
}

/// A piece of a text.
#[derive(Debug)]
pub(super) enum Span {
    Range(Range<usize>),
    /// Put together from pieces of it.
    Owned(Box<str>),
}

impl Span {
    pub(super) fn of<'a>(&'a self, source: &'a Source) -> &'a str {
        match self {
            Self::Range(range) => &source.text[range.clone()],
            Self::Owned(text) => text,
        }
    }
}

/// `ROUTE node.field TO node.field`.
#[derive(Debug, Clone)]
pub(super) struct RouteItem {
    pub(super) place: Place,
    pub(super) from: (Box<str>, Box<str>),
    pub(super) to: (Box<str>, Box<str>),
}

/// A prototype.
#[derive(Debug)]
pub(super) struct ProtoItem {
    pub(super) place: Place,
    pub(super) name: Box<str>,
    pub(super) interface: Vec<InterfaceItem>,
    pub(super) body: ProtoBody,
}

/// What a prototype stands for.
#[derive(Debug)]
pub(super) enum ProtoBody {
    /// Nodes, of which the first counts, and statements.
    Items(Vec<Item>),
    /// A prototype in another file: its addresses, an `MFString`.
    Extern(FieldItem),
}

/// A field of a prototype.
#[derive(Debug)]
pub(super) struct InterfaceItem {
    pub(super) place: Place,
    pub(super) name: Box<str>,
    pub(super) access: Access,
    pub(super) ty: FieldType,
    /// Its default.
    pub(super) value: Option<FieldItem>,
}

/// A file that cannot be read further.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub(super) struct SyntaxError {
    pub(super) place: Place,
    pub(super) message: String,
}

/// Turns bytes of a text into places, going forward only, so that all places of a file cost one pass over it.
#[derive(Debug)]
pub(super) struct Locator<'a> {
    text: &'a str,
    at: usize,
    place: Place,
}

impl<'a> Locator<'a> {
    pub(super) fn new(text: &'a str, file: u32) -> Self {
        Self { text, at: 0, place: Place { file, line: 1, column: 1 } }
    }

    /// The place of a byte that is not before the last one asked for (else the last one's).
    pub(super) fn place(&mut self, at: usize) -> Place {
        if at > self.at {
            self.place = self.place.behind(&self.text[self.at..at]);
            self.at = at;
        }
        self.place
    }
}

impl Place {
    /// The place behind `text`, which begins here.
    pub(super) fn behind(self, text: &str) -> Self {
        let mut place = self;
        let mut previous = ' ';
        for c in text.chars() {
            match c {
                '\n' if previous == '\r' => {}
                '\n' | '\r' => (place.line, place.column) = (place.line + 1, 1),
                _ => place.column += 1,
            }
            previous = c;
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_three_ways_and_columns_count_characters() {
        let text = "a\u{e4}b\r\nc\rd\ne";
        let mut locator = Locator::new(text, 7);
        let mut at = |needle: &str| {
            let p = locator.place(text.find(needle).unwrap());
            assert_eq!(p.file, 7);
            (p.line, p.column)
        };
        assert_eq!([at("a"), at("b"), at("c"), at("d"), at("e"), at("a")], [(1, 1), (1, 3), (2, 1), (3, 1), (4, 1), (4, 1)]);
    }
}
