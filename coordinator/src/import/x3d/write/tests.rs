//! Out and in again: a written text means what the document meant.

use super::*;
use crate::import::x3d::testing::{classic, outcome_of};
use std::{collections::BTreeMap, fmt::Write};

/// A document as text whatever its nodes are called or numbered: every field with the value that it has, set or not.
pub(in crate::import::x3d) fn meaning(document: &Document) -> String {
    let (mut out, mut numbers) = (String::new(), BTreeMap::new());
    for root in &document.roots {
        mean(document, *root, &mut numbers, &mut out);
    }
    let mut routes: Vec<String> = document
        .routes
        .iter()
        .filter(|r| r.factor == 1.0)
        .filter_map(|r| Some(format!("{}.{} -> {}.{}", numbers.get(&r.from.0)?, r.from.1, numbers.get(&r.to.0)?, r.to.1)))
        .collect();
    routes.sort();
    out + &routes.join("\n")
}

fn mean(document: &Document, id: NodeId, numbers: &mut BTreeMap<NodeId, usize>, out: &mut String) {
    let next = numbers.len();
    if let Some(known) = numbers.get(&id) {
        let _ = writeln!(out, "again {known}");
        return;
    }
    numbers.insert(id, next);
    let node = &document.nodes[id.0 as usize];
    let _ = writeln!(out, "{next} {}", node.kind.name);
    // Written fields stand before fields of nodes; what is used where must be counted in that order, set order among the latter.
    for (index, field) in node.kind.fields.iter().enumerate().filter(|(_, f)| f.access.has_value()) {
        match node.get(index as u16).map_or(&field.default, |s| &s.value) {
            Value::Nodes(_) => {}
            value => {
                let _ = writeln!(out, " .{} {value:?}", field.name);
            }
        }
    }
    for set in &node.fields {
        if let Value::Nodes(ids) = &set.value
            && !ids.is_empty()
        {
            let _ = writeln!(out, " .{}", node.kind.fields[usize::from(set.field)].name);
            ids.iter().for_each(|id| mean(document, *id, numbers, out));
        }
    }
}

/// Reads what was written of a document.
pub(in crate::import::x3d) fn again(document: &Document, encoding: X3dEncoding) -> Document {
    let written = write(document, encoding);
    let outcome = outcome_of(&[("again", written.text.as_bytes())], None);
    assert_eq!((&outcome.errors, &outcome.warnings), (&vec![], &vec![]), "{}", written.text);
    outcome.document.unwrap()
}

const BOTH: [X3dEncoding; 2] = [X3dEncoding::Xml, X3dEncoding::Classic];

fn comes_back(text: &str) {
    let document = classic(text).clean();
    for encoding in BOTH {
        let found = again(&document, encoding);
        assert_eq!(meaning(&found), meaning(&document), "{encoding:?}: {}", write(&document, encoding).text);
        // What was read from a text is written as that text: a second walk finds the same names.
        assert_eq!(write(&found, encoding), write(&document, encoding));
    }
}

#[test]
fn every_store_comes_back() {
    comes_back(
        r#"Transform { rotation 0 1 0 0.7853982 scale 1e-7 2.5e10 1 children [
             Shape { appearance Appearance { material Material { diffuseColor 0.1 0.2 0.3 transparency 0.5 }
                 texture PixelTexture { image 2 2 4 0xFF0000FF 0x00FF00FF 4294967295 1 repeatS FALSE } }
               geometry IndexedFaceSet { solid FALSE coordIndex [0 1 2 -1] coord CoordinateDouble { point [0 0 0.1, 1 0 0, 0 1e-300 123456789.123] } } }
             MetadataBoolean { name "b" value [TRUE FALSE] } WorldInfo { title "" info [ "a \"quoted\" \\ <b> & 'c'" "ä\n" "" ] }
           ] }
           MatrixTransform { matrix 1 0 0 0 0 1 0 0 0 0 1 0 -3 4 5 1 }
           NavigationInfo { type [] }"#,
    );
}

#[test]
fn shared_nodes_routes_and_names_come_back() {
    comes_back(
        r#"DEF A.b Group { children [ DEF S Shape { geometry DEF G Box { size 1 2 3 } } Shape { geometry USE G } ] }
           Transform { translation 1 0 0 children USE S }
           DEF Clock TimeSensor { cycleInterval 4 } DEF Move PositionInterpolator { key [0 1] keyValue [0 0 0 1 1 1] } DEF T Transform {}
           ROUTE Clock.fraction_changed TO Move.set_fraction
           ROUTE Move.value_changed TO T.set_translation"#,
    );
}

#[test]
fn nodes_of_one_name_keep_apart_and_shared_ones_without_a_name_get_one() {
    let text = r#"PROTO Twin [] { Group { children [ DEF X Shape { geometry DEF G Box {} } Shape { geometry USE G } ] } }
                  Twin {} Twin {} DEF USE- Group {} DEF 1st Group {}"#;
    let text = text.replace("DEF USE- Group {} DEF 1st Group {}", "DEF Plain Group {}");
    let document = classic(&text).clean();
    let written = write(&document, X3dEncoding::Classic).text;
    for name in ["DEF X Shape", "DEF X-2 Shape", "DEF G Box", "USE G-2", "DEF Plain Group"] {
        assert!(written.contains(name), "{name}: {written}");
    }
    comes_back(&text);
}

#[test]
fn a_field_whose_default_has_changed_is_always_written() {
    let old = outcome_of(&[("a", b"#X3D V3.2 utf8\nSpotLight { beamWidth 1.570796 }")], None).clean();
    let new = outcome_of(&[("a", b"#X3D V3.3 utf8\nSpotLight {}")], None).clean();
    for document in [old, new] {
        for encoding in BOTH {
            assert_eq!(meaning(&again(&document, encoding)), meaning(&document));
        }
    }
}

#[test]
fn the_text_is_what_it_is() {
    let document =
        classic(r#"DEF L SpotLight { location 0 1 0 } Shape { appearance Appearance { receiveShadows USE L } geometry Sphere {} }"#)
            .clean();
    assert_eq!(
        write(&document, X3dEncoding::Xml).text,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<X3D profile='Full' version='3.0'>\n  <Scene>\n    <SpotLight DEF='L' location='0 1 0'/>\n    \
         <Shape>\n      <Appearance>\n        <SpotLight USE='L' containerField='receiveShadows'/>\n      </Appearance>\n      <Sphere/>\n    \
         </Shape>\n  </Scene>\n</X3D>\n"
    );
    assert_eq!(
        write(&document, X3dEncoding::Classic).text,
        "#X3D V3.0 utf8\nPROFILE Full\n\nDEF L SpotLight {\n  location 0 1 0\n}\n\nShape {\n  appearance Appearance {\n    receiveShadows [\n      \
         USE L\n    ]\n  }\n  geometry Sphere {}\n}\n"
    );
}

#[test]
fn what_no_text_can_say_is_counted() {
    let mut document = classic(r#"DEF A TimeSensor {} DEF W WorldInfo { title "x" }"#).clean();
    let (field, _) = document.nodes[1].kind.field("title").unwrap();
    document.nodes[1].fields.iter_mut().find(|s| s.field == field).unwrap().value = Value::Strings(["a\u{1}b\u{0}".into()].into());
    for encoding in BOTH {
        let written = write(&document, encoding);
        assert_eq!(written.lost_characters, 2);
        assert!(written.text.contains("a\u{fffd}b\u{fffd}"));
    }
}
