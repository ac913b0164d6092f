//! What is ClassicVRML and what is not.

use crate::import::x3d::testing::{classic, dump, outcome_of};

#[test]
fn layout_is_free() {
    let plain = dump(&classic("Transform { translation 1 2 3 children [ Box { } Cone { } ] }").clean());
    for text in [
        "Transform{translation 1 2 3 children[Box{}Cone{}]}",
        "Transform\r\n{\rtranslation 1,2,3 #,4\n,children,[,Box,{,},Cone{}# ]\n]}",
        "Transform { translation 1# c\n2 # c\r3 children [ Box { } , Cone { } , ] , }",
    ] {
        assert_eq!(dump(&classic(text).clean()), plain, "{text}");
    }
    // One node needs no brackets, and an empty list has none.
    assert_eq!(dump(&classic("Group { children Box { } }").clean()), dump(&classic("Group { children [ Box { } ] }").clean()));
    classic("Group { children [ ] } Shape { geometry NULL } IndexedFaceSet { coordIndex [ ] } Group { children NULL }").clean();
}

#[test]
fn names_are_what_exporters_make_of_them() {
    let document =
        classic("DEF Cube.001 Transform { } DEF 3d-Ü+x Group { children USE Cube.001 }\nROUTE Cube.001.translation TO Cube.001.scale")
            .clean();
    let defs: Vec<_> = document.nodes().map(|n| n.def().unwrap().to_owned()).collect();
    assert_eq!(defs, ["Cube.001", "3d-Ü+x"]);
    assert_eq!(document.routes.len(), 1);
}

/// X_ITE sets the colon of a COMPONENT apart.
#[test]
fn components_with_and_without_blanks() {
    for component in ["COMPONENT Shape:4", "COMPONENT Shape : 4", "COMPONENT Shape :4", "COMPONENT Shape: 4"] {
        let document = classic(&format!("PROFILE Interchange\n{component}\nMETA \"a\" \"b\"\nBox {{ }}")).clean();
        assert_eq!(document.nodes().count(), 1, "{component}");
    }
}

/// No comment begins there: what follows in the line would be lost without a word.
#[test]
fn what_windows_writes_for_no_number_is_told() {
    for word in ["1.#QNAN", "-1.#IND", "1.#INF00"] {
        classic(&format!("Coordinate {{ point [ 0 0 0,\n {word} 1 2 ] }}"))
            .failed(&format!("a:3: column 2: the field `point` of `Coordinate` has `{word}`, which is no number (value 4 of 6)"));
    }
    assert_eq!(classic("Box { size 1. 2.#last but one\n3 }").clean().nodes().next().unwrap().vec3("size"), [1.0, 2.0, 3.0]);
}

#[test]
fn booleans_in_any_case() {
    let document = classic("Cone { side false bottom False solid FALSE } Cone { side true }").clean();
    let cones: Vec<_> = document.roots().collect();
    assert!(!cones[0].bool("side") && !cones[0].bool("bottom") && !cones[0].bool("solid") && cones[1].bool("side"));
}

#[test]
fn vrml97_has_other_words_for_the_same() {
    let text = b"#VRML V2.0 utf8
PROTO P [ field SFFloat r 1 exposedField SFVec3f at 0 0 0 eventIn SFBool on eventOut SFTime t ] {
  Transform { translation IS at children Shape { geometry Sphere { radius IS r } } } }
P { r 2 at 1 1 1 }
Switch { whichChoice 0 choice [ Box { } ] }
LOD { level [ Box { } Cone { } ] range [ 5 ] }
Collision { collide FALSE children [ ] }
Script { eventIn SFTime go eventOut SFBool done field MFNode list [ ] directOutput TRUE url \"javascript: function f() { }\" }";
    let outcome = outcome_of(&[("a", text)], None);
    assert_eq!(outcome.warnings, ["a:8: column 1: the node `Script` is not supported and was skipped: 1, here"]);
    let document = outcome.document.unwrap();
    let roots: Vec<_> = document.roots().collect();
    assert_eq!(roots[0].node("children").unwrap().node("geometry").unwrap().float("radius"), 2.0);
    assert_eq!(roots[1].children("children").count() + roots[2].children("children").count(), 3);
    assert!(!roots[3].bool("enabled"));
}

#[test]
fn what_is_not_the_language_is_an_error_with_line_and_column() {
    for (text, error) in [
        ("}", "a:2: column 1: expected a statement or the type of a node, found `}`"),
        ("DEF A {", "a:2: column 7: expected a statement or the type of a node, found `{`"),
        ("Box {\n size 1 1 1", "a:3: column 12: expected `}` of `Box` in line 2, found the end of the file"),
        ("Box size 1", "a:2: column 5: expected `{` behind `Box`, found `size`"),
        ("Box { 3 }", "a:2: column 7: expected the name of a field, found `3`"),
        ("Box { size }", "a:2: column 12: expected the value of a field, found `}`"),
        ("Box { size [ 1 2", "a:2: column 17: expected `]` or another value, found the end of the file"),
        ("Box { size [ 1 Group", "a:2: column 16: expected `]` or another value, found `Group`"),
        ("Group { children [ Box { } 3 ] }", "a:2: column 28: expected a statement or the type of a node, found `3`"),
        ("WorldInfo { title \"a\nb }", "a:2: column 19: a string begins here and its closing quote is missing"),
        ("ROUTE A TO B.c", "a:2: column 7: expected NODE.FIELD, found `A`"),
        ("ROUTE A.b B.c", "a:2: column 11: expected `TO`, found `B.c`"),
        ("PROTO P { }", "a:2: column 9: expected `[` and the fields of the prototype, found `{`"),
        ("PROTO P [ SFFloat x 1 ] { }", "a:2: column 11: expected the access of a field, or `]`, found `SFFloat`"),
        ("PROTO P [ field Float x 1 ] { }", "a:2: column 17: expected the type of a field, found `Float`"),
        ("PROTO P [ field SFFloat x ] { }", "a:2: column 27: expected the value of a field, found `]`"),
        ("PROTO P [ ]", "a:2: column 12: expected `{` and the nodes of the prototype, found the end"),
        ("EXTERNPROTO P [ ] { }", "a:2: column 19: expected the addresses of the prototype, found `{`"),
        ("META \"a\" b", "a:2: column 10: expected a string, found `b`"),
        ("USE", "a:2: column 4: expected a name, found the end of the file"),
    ] {
        classic(text).failed(error);
    }
}
