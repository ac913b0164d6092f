//! What is peculiar to JSON.

use crate::import::x3d::testing::{json, outcome_of};

#[test]
fn source_code_may_have_a_string_a_line() {
    let text = r##"{"ShaderPart": {"#sourceCode": ["void main()", "{ \"x\" }"]}}, {"ShaderPart": {"#sourceCode": "one"}}"##;
    let document = json(text).clean();
    let codes: Vec<&str> = document.roots().map(|p| p.string("sourceCode")).collect();
    assert_eq!(codes, ["void main()\n{ \"x\" }", "one"]);
}

#[test]
fn keys_and_values_may_be_written_oddly() {
    let text = r#"{"Sh\u0061pe": {"-geometry": {"Box": {"@size": "1 2 3", "@solid": null}}, "@DEF": "A"}}, {"Group": {"children": [{"Shape": {"@USE": "A"}}]}}"#;
    let document = json(text).clean();
    let roots: Vec<_> = document.roots().collect();
    assert_eq!(roots[0].node("geometry").unwrap().vec3("size"), [1.0, 2.0, 3.0]);
    assert_eq!(roots[1].node("children").unwrap().id(), roots[0].id());
}

#[test]
fn statements_may_stand_in_the_scene_itself() {
    let text = r#"{"X3D": {"Scene": {"-children": {"TimeSensor": {"@DEF": "T"}}, "ScalarInterpolator": {"@DEF": "S"},
        "ROUTE": [{"@fromNode": "T", "@fromField": "fraction_changed", "@toNode": "S", "@toField": "set_fraction"}]}}}"#;
    assert_eq!(outcome_of(&[("a", text.as_bytes())], None).clean().routes.len(), 1);
}

#[test]
fn what_is_not_x3d_is_an_error_with_line_and_column() {
    let fails = |text: &str, error: &str| outcome_of(&[("a", text.as_bytes())], None).failed(error);
    fails("{\"X3D\":\n {]}", "a:2: column 3: this is not well-formed JSON: key must be a string");
    fails("{\"X3D\": {}\n", "a:2: column 1: this is not well-formed JSON: EOF");
    fails("{\"X3D\": {}} x", "a:1: column 13: this is not well-formed JSON: trailing characters");
    fails("{\"X3D\": 3}", "a:1: column 1: this is JSON and not X3D");
    json(r#"{"Box": 3}"#).failed("a:2: column 3: `Box` is no object");
    json(r#"{"ROUTE": {"@fromNode": "a"}}"#).failed("a:2: column 13: `ROUTE` has no `@fromField`");
    json(r#"{"ProtoInstance": {"@DEF": "a"}}"#).failed("a:2: column 21: `ProtoInstance` has no `@name`");
    json("{\"Box\": {\"@size\": [1,\n2]}}").failed("a:2: column 11: the field `size` of `Box` has 2 of the 3 values");
}
