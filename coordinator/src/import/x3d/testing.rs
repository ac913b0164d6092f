//! What tests of X3D share: scenes from texts, and documents as texts to compare.

use super::{Document, Inlined, NodeRef, read, value::Value};
use crate::import::{Bundle, Content, Part, findings::Findings};
use std::fmt::Write;

/// What came of a bundle.
pub(super) struct Outcome {
    pub(super) document: Option<Document>,
    /// Empty where the scene could be imported.
    pub(super) errors: Vec<String>,
    /// Empty where it could not.
    pub(super) warnings: Vec<String>,
}

impl Outcome {
    /// The document of a scene without errors or warnings.
    pub(super) fn clean(self) -> Document {
        assert_eq!((self.errors, self.warnings), (vec![], vec![]));
        self.document.unwrap()
    }

    /// The document of a scene with exactly one warning, which begins so.
    pub(super) fn warned(self, beginning: &str) -> Document {
        assert_eq!(self.errors, [""; 0]);
        assert!(self.warnings.len() == 1 && self.warnings[0].starts_with(beginning), "{:#?} is not {beginning}", self.warnings);
        self.document.unwrap()
    }

    /// The one error, which begins so.
    pub(super) fn failed(self, beginning: &str) {
        assert!(self.errors.len() == 1 && self.errors[0].starts_with(beginning), "{:#?} is not {beginning}", self.errors);
    }
}

/// Reads the first of some files.
pub(super) fn outcome_of(files: &[(&str, &[u8])], time: Option<f64>) -> Outcome {
    let parts = files.iter().map(|(name, bytes)| Part { name: (*name).into(), content: Content::Bytes(bytes.to_vec()) }).collect();
    let bundle = Bundle::from_parts(parts, Some(files[0].0), &std::env::temp_dir()).unwrap();
    let mut findings = Findings::default();
    let document = read(&bundle, bundle.main(), files[0].1, time, &mut findings);
    let said = |problems: Vec<crate::records::Problem>| problems.iter().map(ToString::to_string).collect();
    let (errors, warnings) =
        if findings.has_errors() { (said(findings.into_errors(files[0].0)), vec![]) } else { (vec![], said(findings.into_warnings())) };
    Outcome { document, errors, warnings }
}

/// Reads ClassicVRML of version 3.0; the text begins on line 2 of `a`.
pub(super) fn classic(text: &str) -> Outcome {
    outcome_of(&[("a", format!("#X3D V3.0 utf8\n{text}").as_bytes())], None)
}

/// Reads the inside of a `Scene` of version 3.0, which begins on line 2 of `a`.
pub(super) fn xml(text: &str) -> Outcome {
    outcome_of(&[("a", format!("<X3D version='3.0'><Scene>\n{text}</Scene></X3D>").as_bytes())], None)
}

/// Reads the children of a `Scene` of version 3.0, which begin on line 2 of `a`.
pub(super) fn json(text: &str) -> Outcome {
    let text = format!(r#"{{"X3D": {{"@version": "3.0", "Scene": {{"-children": [{}{text}]}}}}}}"#, '\n');
    outcome_of(&[("a", text.as_bytes())], None)
}

/// A document as text: types, names, fields with values, without places.
pub(super) fn dump(document: &Document) -> String {
    let mut out = String::new();
    for root in document.roots() {
        node(root, 0, &mut out);
    }
    for route in &document.routes {
        let _ = writeln!(out, "{:?} -> {:?} x {}", route.from, route.to, route.factor);
    }
    out
}

fn node(node_ref: NodeRef<'_>, depth: usize, out: &mut String) {
    let raw = &node_ref.document.nodes[node_ref.id.0 as usize];
    let pad = "  ".repeat(depth);
    let _ = writeln!(out, "{pad}{} {} {:?}", node_ref.id.0, raw.kind.name, raw.def);
    let mut fields: Vec<_> = raw.fields.iter().collect();
    fields.sort_by_key(|f| f.field);
    for set in fields {
        let name = raw.kind.fields[usize::from(set.field)].name;
        match &set.value {
            Value::Nodes(ids) => {
                let _ = writeln!(out, "{pad}  .{name}");
                for id in ids.iter() {
                    node(node_ref.document.node(*id), depth + 2, out);
                }
            }
            value => {
                let _ = writeln!(out, "{pad}  .{name} {value:?}");
            }
        }
    }
    if let Some(Inlined::Nodes(ids)) = node_ref.inlined() {
        for id in ids {
            node(node_ref.document.node(*id), depth + 1, out);
        }
    }
}
