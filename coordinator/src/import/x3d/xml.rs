//! The XML encoding (ISO/IEC 19776-1), read by `roxmltree`; a document type may be declared and is never fetched.
//!
//! Elements are nodes, but for a dozen statements; attributes are fields; a child goes to the field that `containerField` or the table
//! names, which is not decided here. A page of HTML around the scene is passed by.

mod guards;
mod proto;

use super::{
    document::Place,
    limits::{MAX_DEPTH, MAX_NODES},
    literal::shown,
    syntax::{FieldItem, Item, Locator, NodeItem, RouteItem, Span, SyntaxError, Unit, Written},
};
use roxmltree::{Attribute, Document, Error, Node, ParsingOptions};

/// Attributes of elements of HTML and of X3D 4 that are no fields of nodes.
const STYLING: [&str; 4] = ["class", "id", "style", "is"];

/// Reads a text. Memory: about 100 bytes an element and an attribute while it is read.
///
/// # Errors
/// Text that is not XML, XML that is not X3D, nodes too deep or too many.
pub(super) fn read(text: &str, file: u32) -> Result<super::classic::Read, SyntaxError> {
    guards::check(text).map_err(|(at, message)| SyntaxError { place: Locator::new(text, file).place(at), message })?;
    let options = ParsingOptions { allow_dtd: true, nodes_limit: 4 * MAX_NODES as u32, entity_resolver: None };
    let document = Document::parse_with_options(text, options).map_err(|e| {
        let place = match e {
            // It has no place of its own: the text ends too early.
            Error::UnclosedRootNode => Locator::new(text, file).place(text.len()),
            _ => Place { file, line: e.pos().row, column: e.pos().col },
        };
        let message = e.to_string();
        let what = message.rsplit_once(" at ").map_or(message.as_str(), |(what, _)| what);
        SyntaxError { place, message: format!("this is not well-formed XML: {what}") }
    })?;
    let mut reader = Reader { text, locator: Locator::new(text, file), nodes: 0 };
    let root = document.root_element();
    let Some(x3d) = root.descendants().find(|n| is(*n, "X3D")) else {
        return Err(SyntaxError { place: reader.place(root), message: other_root(root) });
    };
    let mut units = vec![];
    let mut items = vec![];
    for child in x3d.children().filter(Node::is_element) {
        if is(child, "head") {
            units.extend(child.children().filter(|n| is(*n, "unit")).map(|n| reader.unit(n)));
        } else if is(child, "Scene") {
            reader.items(child, &mut items, 0)?;
        } else {
            return Err(reader.error(child, format!("`{}` where `head` or `Scene` should be", shown(child.tag_name().name()))));
        }
    }
    Ok((x3d.attribute("version").map_or(0, super::parse_version), units, items))
}

/// Whether a text is XML about X3D, as far as it can be read.
pub(super) fn has_x3d_root(text: &str) -> bool {
    let options = ParsingOptions { allow_dtd: true, nodes_limit: 4 * MAX_NODES as u32, entity_resolver: None };
    guards::check(text).is_ok()
        && Document::parse_with_options(text, options).is_ok_and(|d| d.root_element().descendants().any(|n| is(n, "X3D")))
}

fn other_root(root: Node<'_, '_>) -> String {
    match root.tag_name().name() {
        "COLLADA" => "this is COLLADA, which is not supported; convert it to glTF".to_owned(),
        other => format!("this is XML with the root `{}` and not X3D: it has no element `X3D`", shown(other)),
    }
}

/// Pages of HTML write these in any case.
fn is(node: Node<'_, '_>, name: &str) -> bool {
    node.is_element() && node.tag_name().name().eq_ignore_ascii_case(name)
}

/// An attribute, whose name pages of HTML may also write without capitals.
fn attribute<'n>(node: Node<'n, '_>, name: &str) -> Option<&'n str> {
    let any_case = || node.attributes().find(|a| a.name().eq_ignore_ascii_case(name)).map(|a| a.value());
    node.attribute(name).or_else(any_case)
}

struct Reader<'a> {
    text: &'a str,
    locator: Locator<'a>,
    nodes: usize,
}

impl Reader<'_> {
    fn place(&mut self, node: Node<'_, '_>) -> Place {
        self.locator.place(node.range().start)
    }

    fn error(&mut self, node: Node<'_, '_>, message: String) -> SyntaxError {
        SyntaxError { place: self.place(node), message }
    }

    /// An attribute that has to be there.
    fn required(&mut self, node: Node<'_, '_>, name: &str) -> Result<Box<str>, SyntaxError> {
        match attribute(node, name) {
            Some(value) => Ok(value.trim().into()),
            None => Err(self.error(node, format!("`{}` has no attribute `{name}`", shown(node.tag_name().name())))),
        }
    }

    fn unit(&mut self, node: Node<'_, '_>) -> Unit {
        let of = |name: &str| node.attribute(name).unwrap_or_default().trim().into();
        Unit { place: self.place(node), category: of("category"), factor: of("conversionFactor") }
    }

    /// What stands inside an element: nodes and statements.
    fn items(&mut self, parent: Node<'_, '_>, items: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        for child in parent.children().filter(Node::is_element) {
            self.item(child, items, depth)?;
        }
        Ok(())
    }

    fn item(&mut self, node: Node<'_, '_>, items: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        let place = self.place(node);
        match node.tag_name().name() {
            "ROUTE" | "route" => {
                let from = (self.required(node, "fromNode")?, self.required(node, "fromField")?);
                let to = (self.required(node, "toNode")?, self.required(node, "toField")?);
                items.push(Item::Route(RouteItem { place, from, to }));
            }
            "ProtoDeclare" | "ExternProtoDeclare" => items.push(self.proto(node, depth)?),
            "IMPORT" => {
                let inline = self.required(node, "inlineDEF")?;
                let exported = self.required(node, if node.has_attribute("importedDEF") { "importedDEF" } else { "exportedDEF" })?;
                let local = node.attribute("AS").map_or_else(|| exported.clone(), |n| n.trim().into());
                items.push(Item::Import { place, inline, exported, local });
            }
            "EXPORT" => {
                let local = self.required(node, "localDEF")?;
                let exported = node.attribute("AS").map_or_else(|| local.clone(), |n| n.trim().into());
                items.push(Item::Export { place, local, exported });
            }
            _ => items.push(Item::Node(self.node(node, depth)?)),
        }
        Ok(())
    }

    /// A node, a `USE`, or a `ProtoInstance`.
    fn node(&mut self, node: Node<'_, '_>, depth: u16) -> Result<NodeItem, SyntaxError> {
        if depth >= MAX_DEPTH {
            return Err(self.error(node, format!("more than {MAX_DEPTH} nodes inside one another")));
        }
        self.nodes += 1;
        if self.nodes > MAX_NODES {
            return Err(self.error(node, format!("more than {MAX_NODES} nodes")));
        }
        let instance = node.tag_name().name() == "ProtoInstance";
        let usage: Option<Box<str>> = attribute(node, "USE").map(|n| n.trim().into());
        let name = match (instance, &usage) {
            (false, _) => node.tag_name().name().into(),
            (true, None) => self.required(node, "name")?,
            (true, Some(_)) => node.attribute("name").unwrap_or_default().into(),
        };
        let place = self.place(node);
        let mut body = vec![];
        for attribute in node.attributes().filter(|a| a.namespace().is_none()) {
            match attribute.name() {
                known if ["DEF", "USE", "containerField"].iter().any(|k| known.eq_ignore_ascii_case(k)) => {}
                "name" if instance => {}
                styling if STYLING.contains(&styling) || usage.is_some() => {}
                field => body.push(Item::Field(self.attribute(&attribute, field))),
            }
        }
        self.children(node, instance, &mut body, depth)?;
        let of = |name: &str| attribute(node, name).map(|n| n.trim().into());
        Ok(NodeItem { place, name, def: of("DEF"), usage, container: of("containerField"), body })
    }

    /// The children of a node: fields written as elements, text, statements and nodes.
    fn children(&mut self, node: Node<'_, '_>, instance: bool, body: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        for child in node.children() {
            if child.is_text() {
                // The source of a script or a shader, as text or CDATA.
                let text = child.text().unwrap_or_default();
                if !text.trim().is_empty() {
                    let place = self.place(child);
                    body.push(Item::Field(FieldItem::new(place, "sourceCode", Written::Text(Span::Owned(text.into())))));
                }
                continue;
            }
            match child.tag_name().name() {
                _ if !child.is_element() => {}
                "IS" => self.connections(child, body)?,
                "fieldValue" => body.push(Item::Field(self.field_value(child, depth)?)),
                "field" if !instance => {
                    let (place, mut nodes) = (self.place(child), vec![]);
                    self.items(child, &mut nodes, depth + 1)?;
                    body.push(Item::Declared { place, nodes });
                }
                _ => self.item(child, body, depth + 1)?,
            }
        }
        Ok(())
    }

    /// A field from an attribute; its value is a piece of the text unless it has entities.
    fn attribute(&mut self, attribute: &Attribute<'_, '_>, name: &str) -> FieldItem {
        let range = attribute.range_value();
        let place = self.locator.place(range.start);
        let whole = self.text.get(range.clone()).filter(|raw| !raw.contains('&'));
        let span = whole.map_or_else(|| Span::Owned(attribute.value().into()), |_| Span::Range(range));
        FieldItem::new(place, name, Written::Text(span))
    }
}

#[cfg(test)]
mod tests;
