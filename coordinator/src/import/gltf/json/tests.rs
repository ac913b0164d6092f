//! Texts whose values know their places.

use super::*;

const TEXT: &str =
    "{\n \"a\": [1, -2.5e1, true,\n  {\"x/~\": \"q\\\"\\u00e9\", \"e\": {}}, []],\n\"b\": null, \"a2\": 1e999,\n\n\"b\": false}";

#[test]
fn values_know_their_kind_line_and_pointer() {
    let document = Document::parse(TEXT).unwrap();
    let root = document.root();
    let list: Vec<Json<'_>> = root.get("a").unwrap().items().collect();
    assert_eq!(list.len(), 5);
    assert_eq!((list[0].number(), list[1].number(), list[2].boolean()), (Some(1.0), Some(-25.0), Some(true)));
    assert_eq!((list[0].string(), list[2].number(), list[1].boolean()), (None, None, None));
    let deep = list[3].get("x/~").unwrap();
    assert_eq!((deep.string().unwrap().as_ref(), deep.line(), deep.pointer().as_str()), ("q\"é", 3, "/a/3/x~1~0"));
    assert_eq!((list[4].items().count(), list[4].kind(), list[4].pointer().as_str()), (0, Kind::Array, "/a/4"));
    assert_eq!((root.pointer().as_str(), root.line()), ("", 1));
    assert_eq!(root.get("a2").unwrap().number(), Some(f64::INFINITY));
    assert_eq!((root.get("b").unwrap().boolean(), root.get("b").unwrap().line()), (Some(false), 6));
    assert_eq!(root.members().count(), 4);
}

#[test]
fn lines_are_right_across_blocks() {
    let text = format!("[{}\n7]", "\n".repeat(3 * BLOCK));
    assert_eq!(Document::parse(&text).unwrap().root().items().next().unwrap().line() as usize, 3 * BLOCK + 2);
}

#[test]
fn depth_costs_no_stack_and_faults_have_a_line() {
    let deep = format!("{}{}", "[".repeat(200_000), "]".repeat(200_000));
    let document = Document::parse(&deep).unwrap();
    assert_eq!(document.root().items().count(), 1);
    assert_eq!(Document::parse("{\n]").unwrap_err().line, 2);
    for text in ["", "{", "[1,]", "{\"a\" 1}", "nul", "\"\u{1}\"", "[1] 2", "01", "\"\\"] {
        assert!(Document::parse(text).is_err(), "{text}");
    }
}

#[test]
fn names_are_as_long_as_they_are_kept() {
    let name = |text: &str| Document::parse(text).unwrap().root().name();
    assert_eq!(name(r#"{"name": "a\"b\u00e9\n"}"#).as_deref(), Some("a\"bé\n"));
    assert_eq!([name("{}"), name(r#"{"name": 7}"#), name(r#"{"name": " "}"#), name(r#"{"name": ""}"#)], [None, None, None, None]);
    for long in ["é", r"\u00e9", r"\\", "\u{1F600}"] {
        let found = name(&format!("{{\"name\": \"{}\"}}", long.repeat(9_000))).unwrap();
        assert_eq!(found.chars().count(), NAME_CHARS, "{long}");
    }
    // Half a pair of surrogates is no character.
    assert_eq!(name(r#"{"name": "a\ud83d"}"#).as_deref(), Some(r"a\ud83d"));
}
