//! Texts put together at random.

use crate::import::x3d::{Document, Inlined, limits::MAX_DEPTH, testing::outcome_of};
use proptest::{collection::vec, option, prelude::*, sample::select};

/// Pieces of all encodings; most sequences of them are broken somewhere.
const PIECES: [&str; 40] = [
    "Group { children [ ",
    "Shape { geometry ",
    "Box { size 1 2 3 } ",
    "DEF A ",
    "USE A ",
    "} ",
    "] ",
    "[ ",
    "PROTO P [ ] { ",
    "P { } ",
    "PROTO Q [ field SFNode n NULL ] { Group { children IS n } } ",
    "Q { n USE A } ",
    "ROUTE A.x TO A.y ",
    "EXTERNPROTO E [ ] \"a#P\" ",
    "E { } ",
    "Inline { url \"a\" } ",
    "1 ",
    "-2.5e3 ",
    "\"s\" ",
    "TRUE ",
    "NULL ",
    "# \n",
    "IS x ",
    "UNIT length l 2 ",
    "<Group>",
    "</Group>",
    "<Shape DEF='A'>",
    "</Shape>",
    "<Box size='1 2 3'/>",
    "<Shape USE='A'/>",
    "<ProtoDeclare name='P'><ProtoBody>",
    "</ProtoBody></ProtoDeclare>",
    "<ProtoInstance name='P'/>",
    "&amp;",
    "{\"Group\": {\"-children\": [",
    "]}}",
    ",",
    "{\"Box\": {\"@size\": [1, 2, 3]}}",
    "{\"Shape\": {\"@USE\": \"A\"}}",
    "\u{e4}",
];

proptest! {
    /// Whatever the text, it is read or refused with a place, and what was read hangs together.
    #[test]
    fn any_text_is_read_or_refused(pieces in vec(select(&PIECES[..]), 0..40), encoding in 0..3, time in option::of(0.0..9.0)) {
        let body = pieces.concat();
        let text = match encoding {
            0 => format!("#X3D V3.3 utf8\n{body}"),
            1 => format!("<X3D><Scene>{body}</Scene></X3D>"),
            _ => format!("{{\"X3D\": {{\"Scene\": {{\"-children\": [{body}]}}}}}}"),
        };
        let outcome = outcome_of(&[("a", text.as_bytes())], time);
        prop_assert!(outcome.document.is_some() || !outcome.errors.is_empty());
        prop_assert!(outcome.errors.iter().chain(&outcome.warnings).all(|m| m.starts_with("a:")), "{:?} {:?}", outcome.errors, outcome.warnings);
        for node in outcome.document.iter().flat_map(Document::nodes) {
            let raw = &node.document.nodes[node.id.0 as usize];
            let children = raw.fields.iter().flat_map(|s| s.value.nodes());
            let inlined = match node.inlined() { Some(Inlined::Nodes(ids)) => &ids[..], _ => &[] };
            for child in children.chain(inlined) {
                prop_assert!(node.document.nodes[child.0 as usize].height < raw.height);
            }
            prop_assert!(raw.height <= MAX_DEPTH);
        }
    }
}
