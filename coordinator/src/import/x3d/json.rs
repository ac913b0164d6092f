//! The JSON encoding (ISO/IEC 19776-5 and X3dToJson): `@` before fields, `-` before fields of nodes, `#` before text, and the elements of
//! the XML encoding for the rest.

mod proto;
mod tree;

use super::{
    document::Place,
    limits::{MAX_DEPTH, MAX_NODES},
    literal::shown,
    syntax::{FieldItem, Item, NodeItem, RouteItem, Span, SyntaxError, Unit, Written},
};
use tree::{Entry, Tree};

/// Reads a text. Memory: about 50 bytes an object or key while it is read.
///
/// # Errors
/// Text that is not JSON, JSON that is not X3D, nodes too deep or too many.
pub(super) fn read(text: &str, file: u32) -> Result<super::classic::Read, SyntaxError> {
    let root = tree::parse(text, file)?;
    let mut reader = Reader { text, nodes: 0 };
    let start = Place { file, line: 1, column: 1 };
    let Some(x3d) = root.get("X3D").filter(|e| matches!(e.tree, Tree::Object(_))) else {
        return Err(SyntaxError { place: start, message: "this is JSON and not X3D: it has no object `X3D`".to_owned() });
    };
    let version = reader.string(&x3d.tree, "@version").map_or(0, |v| super::parse_version(&v));
    let mut units = vec![];
    for unit in x3d.tree.get("head").and_then(|h| h.tree.get("unit")).map_or(&[][..], |u| u.tree.elements()) {
        let of = |name: &str| reader.string(unit, name).unwrap_or_default();
        let place = unit.entries().first().map_or(start, |e| e.place);
        units.push(Unit { place, category: of("@category"), factor: of("@conversionFactor") });
    }
    let mut items = vec![];
    for entry in x3d.tree.get("Scene").map_or(&[][..], |s| s.tree.entries()) {
        match entry.key.strip_prefix('-') {
            Some(_) => reader.list(&entry.tree, &mut items, 0)?,
            None => reader.item(entry, &mut items, 0)?,
        }
    }
    Ok((version, units, items))
}

struct Reader<'a> {
    text: &'a str,
    nodes: usize,
}

impl Reader<'_> {
    /// A string (or a number as it is written) behind a key.
    fn string(&self, tree: &Tree<'_>, key: &str) -> Option<Box<str>> {
        let Tree::Text(range) = &tree.get(key)?.tree else { return None };
        let raw = &self.text[range.clone()];
        let text = serde_json::from_str::<String>(raw).unwrap_or_else(|_| raw.to_owned());
        Some(text.trim().into())
    }

    /// The same where it has to be there.
    fn required(&self, entry: &Entry<'_>, tree: &Tree<'_>, key: &str) -> Result<Box<str>, SyntaxError> {
        let place = tree.entries().first().map_or(entry.place, |e| e.place);
        let missing = || SyntaxError { place, message: format!("`{}` has no `{key}`", shown(&entry.key)) };
        self.string(tree, key).ok_or_else(missing)
    }

    /// The nodes and statements of an array of objects, or of one object.
    fn list(&mut self, tree: &Tree<'_>, items: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        for entry in tree.elements().iter().flat_map(Tree::entries) {
            self.item(entry, items, depth)?;
        }
        Ok(())
    }

    /// `{"Type": {...}}`: a node or a statement.
    fn item(&mut self, entry: &Entry<'_>, items: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        if entry.key.starts_with(['#', '@']) {
            return Ok(());
        }
        for tree in entry.tree.elements() {
            let of = |key: &str| self.required(entry, tree, key);
            let place = entry.place;
            match entry.key.as_ref() {
                "ROUTE" => {
                    let (from, to) = ((of("@fromNode")?, of("@fromField")?), (of("@toNode")?, of("@toField")?));
                    items.push(Item::Route(RouteItem { place, from, to }));
                }
                "IMPORT" => {
                    let exported = of("@importedDEF").or_else(|_| of("@exportedDEF"))?;
                    let local = self.string(tree, "@AS").unwrap_or_else(|| exported.clone());
                    items.push(Item::Import { place, inline: of("@inlineDEF")?, exported, local });
                }
                "EXPORT" => {
                    let local = of("@localDEF")?;
                    let exported = self.string(tree, "@AS").unwrap_or_else(|| local.clone());
                    items.push(Item::Export { place, local, exported });
                }
                "ProtoDeclare" | "ExternProtoDeclare" => items.push(self.proto(entry, tree, depth)?),
                _ => items.push(Item::Node(self.node(entry, tree, depth)?)),
            }
        }
        Ok(())
    }

    fn node(&mut self, entry: &Entry<'_>, tree: &Tree<'_>, depth: u16) -> Result<NodeItem, SyntaxError> {
        let place = entry.place;
        let fail = |message: String| Err(SyntaxError { place, message });
        if depth >= MAX_DEPTH {
            return fail(format!("more than {MAX_DEPTH} nodes inside one another"));
        }
        self.nodes += 1;
        if self.nodes > MAX_NODES {
            return fail(format!("more than {MAX_NODES} nodes"));
        }
        if !matches!(tree, Tree::Object(_)) {
            return fail(format!("`{}` is no object", shown(&entry.key)));
        }
        let instance = entry.key == "ProtoInstance";
        let usage = self.string(tree, "@USE");
        let name = match (instance, &usage) {
            (false, _) => entry.key.as_ref().into(),
            (true, None) => self.required(entry, tree, "@name")?,
            (true, Some(_)) => self.string(tree, "@name").unwrap_or_default(),
        };
        let mut body = vec![];
        for field in tree.entries() {
            self.field(field, instance, usage.is_some(), &mut body, depth)?;
        }
        Ok(NodeItem { place, name, def: self.string(tree, "@DEF"), usage, container: None, body })
    }

    /// What a key in the object of a node stands for.
    fn field(&mut self, entry: &Entry<'_>, instance: bool, usage: bool, body: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        let key = entry.key.as_ref();
        match (key, &entry.tree) {
            ("@DEF" | "@USE" | "@containerField" | "@class" | "@id" | "@style", _) => {}
            ("@name", _) if instance => {}
            ("#sourceCode", Tree::Text(range)) => body.push(self.source_code(entry.place, range.clone())),
            (_, Tree::Text(range)) if key.starts_with('@') => {
                if !usage && &self.text[range.clone()] != "null" {
                    let written = Written::Text(Span::Range(range.clone()));
                    body.push(Item::Field(FieldItem::new(entry.place, &key[1..], written)));
                }
            }
            ("IS", tree) => self.connections(tree, body)?,
            ("fieldValue", tree) => {
                for value in tree.elements() {
                    body.push(Item::Field(self.field_value(entry, value, depth)?));
                }
            }
            ("field", tree) if !instance => {
                let mut nodes = vec![];
                for entry in tree.elements().iter().flat_map(Tree::entries).filter(|e| e.key.starts_with('-')) {
                    self.list(&entry.tree, &mut nodes, depth + 1)?;
                }
                body.push(Item::Declared { place: entry.place, nodes });
            }
            ("ROUTE" | "ProtoDeclare" | "ExternProtoDeclare" | "IMPORT" | "EXPORT", _) => self.item(entry, body, depth + 1)?,
            (_, Tree::Other | Tree::Text(_)) => {}
            (_, tree) => {
                let mut items = vec![];
                self.list(tree, &mut items, depth + 1)?;
                body.push(Item::Field(FieldItem::new(entry.place, key.strip_prefix('-').unwrap_or(key), Written::Nodes(items))));
            }
        }
        Ok(())
    }

    /// The source of a script or a shader: one string, or one a line.
    fn source_code(&self, place: Place, range: std::ops::Range<usize>) -> Item {
        let raw = &self.text[range.clone()];
        let span = match serde_json::from_str::<Vec<String>>(raw) {
            Ok(lines) => Span::Owned(serde_json::Value::String(lines.join("\n")).to_string().into()),
            Err(_) => Span::Range(range),
        };
        Item::Field(FieldItem::new(place, "sourceCode", Written::Text(span)))
    }
}

#[cfg(test)]
mod tests;
