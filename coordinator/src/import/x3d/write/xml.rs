//! XML (ISO/IEC 19776-1).

use super::{Fields, Writer, literal};
use crate::import::x3d::{
    document::{NodeId, Route},
    table::Field,
    value::{Base, Value},
};

impl Writer<'_> {
    pub(super) fn xml(&mut self, version: u32, routes: &[&Route]) {
        self.out.push_str("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        self.line(&format!("<X3D profile='Full' version='{}.{}'>", version / 10, version % 10));
        self.depth += 1;
        self.line("<Scene>");
        self.depth += 1;
        for root in &self.document.roots {
            self.xml_node(*root, None);
        }
        for route in routes {
            let [(from, out), (to, into)] = self.ends(route).map(|(name, field)| (attribute(&name), field));
            self.line(&format!("<ROUTE fromNode='{from}' fromField='{out}' toNode='{to}' toField='{into}'/>"));
        }
        self.depth -= 1;
        self.line("</Scene>");
        self.depth -= 1;
        self.line("</X3D>");
    }

    /// A node in a field of its parent, or at the top.
    fn xml_node(&mut self, id: NodeId, field: Option<&Field>) {
        let kind = self.document.nodes[id.0 as usize].kind;
        let container = field.filter(|f| f.name != kind.container).map_or_else(String::new, |f| format!(" containerField='{}'", f.name));
        if let Some(name) = self.usage(id) {
            self.line(&format!("<{} USE='{}'{container}/>", kind.name, attribute(&name)));
            return;
        }
        self.indent();
        self.out.push('<');
        self.out.push_str(kind.name);
        if let Some(name) = self.names.get(id) {
            self.out.push_str(&format!(" DEF='{}'", attribute(name)));
        }
        self.out.push_str(&container);
        let Fields { simple, nodes } = self.fields(id);
        for (field, value) in simple {
            let text = self.xml_value(field, value);
            self.out.push_str(&format!(" {}='{text}'", field.name));
        }
        if nodes.is_empty() {
            self.out.push_str("/>\n");
            return;
        }
        self.out.push_str(">\n");
        self.depth += 1;
        for (field, ids) in nodes {
            ids.iter().for_each(|id| self.xml_node(*id, Some(field)));
        }
        self.depth -= 1;
        self.line(&format!("</{}>", kind.name));
    }

    /// The text of an attribute: one string stands bare, a list of them in quotes.
    fn xml_value(&mut self, field: &Field, value: &Value) -> String {
        let text = match value {
            Value::Strings(list) if field.ty.base == Base::String && !field.ty.many => {
                list.first().map_or_else(String::new, |s| s.to_string())
            }
            Value::Strings(_) => literal::elements(field.ty, value, false, ""),
            // Digits, blanks and line ends, which may stand as they are.
            value => return literal::elements(field.ty, value, false, &"  ".repeat(self.depth + 1)),
        };
        let (text, lost) = literal::sayable(&text);
        self.lost += lost;
        attribute(&text)
    }
}

/// Text as the value of an attribute in single quotes. Line ends are written as references, or a parser would make blanks of them.
fn attribute(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '\'' => out.push_str("&apos;"),
            '\t' => out.push_str("&#9;"),
            '\n' => out.push_str("&#10;"),
            '\r' => out.push_str("&#13;"),
            c => out.push(c),
        }
    }
    out
}
