//! What names mean.

mod files;

use crate::import::x3d::{
    Document, NodeRef,
    testing::{classic, dump, json, xml},
};

fn roots(document: &Document) -> Vec<NodeRef<'_>> {
    document.roots().collect()
}

fn kinds<'a>(nodes: impl IntoIterator<Item = NodeRef<'a>>) -> Vec<&'static str> {
    nodes.into_iter().map(NodeRef::kind).collect()
}

#[test]
fn a_used_node_is_the_same_node() {
    let document = classic("DEF A Group { children DEF B Shape { } } Group { children [ USE B USE B ] } USE A").clean();
    let [a, b, again] = roots(&document)[..] else { panic!() };
    assert_eq!((a.id(), a.def()), (again.id(), Some("A")));
    assert!(b.children("children").all(|n| n.id() == a.node("children").unwrap().id()));
}

#[test]
fn a_name_means_the_last_that_had_it() {
    let document = classic("DEF A Box { } Shape { geometry USE A } DEF A Cone { } Shape { geometry USE A }").clean();
    let shapes = roots(&document);
    assert_eq!([shapes[1], shapes[3]].map(|s| s.node("geometry").unwrap().kind()), ["Box", "Cone"]);
}

#[test]
fn names_that_are_missing_or_hold_themselves_are_skipped() {
    let document = classic("Group { children [ USE Nobody Shape { } ] }").warned("a:2: column 20: USE `Nobody`: no node of this name");
    assert_eq!(kinds(roots(&document)[0].children("children")), ["Shape"]);
    classic("DEF A Group { children Group { children USE A } }").warned("a:2: column 41: USE `A`: the node would contain itself");
    xml("<Shape DEF='A'/><Box USE='A'/>").warned("a:2: column 17: USE `A` is said to be a `Box` and is a `Shape`");
}

#[test]
fn unknown_nodes_are_named_and_counted() {
    let text = "Teapot { size 4 4 4 lid Shape { } }\nGroup { children [ Teapot { } DEF T Teapot { } ] }\nShape { geometry USE T }";
    let document = classic(text).warned("a:2: column 1: the node `Teapot` is unknown and was skipped: 3, the first here");
    assert_eq!(kinds(document.roots()), ["Group", "Shape"]);
    let document = xml("<Shape><Text string='x'><FontStyle/></Text></Shape>").warned("a:2: column 8: the node `Text` is not supported");
    assert!(roots(&document)[0].node("geometry").is_none());
}

#[test]
fn what_has_a_name_inside_a_skipped_node_can_be_used() {
    let text = "Script { field SFNode x DEF A Group { children DEF B Box { } } eventIn SFBool y } Shape { geometry USE B }";
    let document = classic(text);
    assert_eq!(document.warnings.len(), 1, "{:?}", document.warnings);
    let document = classic("Odd { x [ Plain { y DEF B Box { } } ] } Shape { geometry USE B }");
    assert_eq!(document.warnings.len(), 2, "{:?}", document.warnings);
    assert_eq!(document.document.unwrap().roots().next().unwrap().node("geometry").unwrap().kind(), "Box");
}

#[test]
fn unknown_fields_are_passed_by() {
    let text = "Box { odd 1 2 3 size 1 1 1 more [ \"a\" \"b\" ] last Group { children Shape { } } }\nBox { odd TRUE }";
    let outcome = classic(text);
    let expected = [
        "a:2: column 11: the field `odd` of `Box` is unknown and was skipped: 2, the first here",
        "a:2: column 33: the field `more` of `Box` is unknown and was skipped: 1, here",
        "a:2: column 50: the field `last` of `Box` is unknown and was skipped: 1, here",
    ];
    assert_eq!(outcome.warnings, expected);
    assert_eq!(outcome.document.unwrap().roots().next().unwrap().vec3("size"), [1.0; 3]);
    xml("<Box odd='1'/>").warned("a:2: column 11: the field `odd` of `Box` is unknown");
    json(r#"{"Box": {"@odd": 1}}"#).warned("a:2: column 11: the field `odd` of `Box` is unknown");
}

#[test]
fn values_that_cannot_be_read_are_located_errors() {
    classic("Box { size 1 2\n  x }").failed("a:3: column 5: expected");
    classic("Box {\n size [ 1\n 2 3x ] }").failed("a:4: column 4: the field `size` of `Box` has `3x`, which is no number (value 3 of 3)");
    xml("<Box size='1\n 2 y'/>").failed("a:3: column 4: the field `size` of `Box` has `y`");
    json(r#"{"Box": {"@size": [1, 2]}}"#).failed("a:2: column 11: the field `size` of `Box` has 2 of the 3 values");
    classic("Shape { geometry 3 }").failed("a:2: column 18: the field `geometry` of `Shape` has a value where a node should be");
    classic("Box { size Group { } }").failed("a:2: column 12: the field `size` of `Box` is SFVec3f and cannot be a node");
    classic("Group { children Box { } children Cone { } }").warned("a:2: column 35: the field `children` of this `Group` is given twice");
    classic("Box { size NULL }").warned("a:2: column 12: the field `size` of `Box` is SFVec3f and cannot be NULL");
    classic("Box { size 1 2 3 4 }").warned("a:2: column 18: the field `size` of `Box` has 4 values where SFVec3f has 3");
}

#[test]
fn children_go_where_container_field_or_type_says() {
    let document = xml("<Collision><Shape containerField='proxy'/><Shape/></Collision>").clean();
    let collision = roots(&document)[0];
    assert!(collision.node("proxy").is_some());
    assert_eq!(kinds(collision.children("children")), ["Shape"]);
    let text = "<Coordinate DEF='C' containerField='skinCoord'/>\n<Group><Coordinate USE='C'/></Group>";
    xml(text).warned("a:3: column 8: `Group` has no field `coord` that could hold the node `Coordinate`");
    xml("<Shape><Box/><Cone/></Shape>").warned("a:2: column 8: the field `geometry` of `Shape` holds one node and was given 2");
    xml("<Shape><Box containerField='bboxSize'/></Shape>").warned("a:2: column 8: `Shape` has no field `bboxSize` that could hold");
}

#[test]
fn prototypes_take_values_defaults_and_connections() {
    let text = "PROTO P [ inputOutput SFVec3f at 1 2 3 initializeOnly SFNode form Box { } ] {
      DEF Inner Transform { translation IS at children Shape { geometry IS form } } Group { } }
    DEF Mine P { } P { at 4 5 6 form Cone { } } Group { children USE Mine }";
    let document = classic(text).clean();
    let all = roots(&document);
    assert_eq!(kinds(all.clone()), ["Transform", "Transform", "Group"]);
    assert_eq!((all[0].vec3("translation"), all[1].vec3("translation")), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
    let form = |n: NodeRef<'_>| n.node("children").unwrap().node("geometry").unwrap().kind();
    assert_eq!((form(all[0]), form(all[1])), ("Box", "Cone"));
    assert_eq!((all[0].def(), all[1].def()), (Some("Mine"), Some("Inner")));
    assert_eq!(all[2].node("children").unwrap().id(), all[0].id());
}

#[test]
fn prototypes_nest_and_see_what_was_before_them() {
    let text = "PROTO A [ field SFVec3f s 1 1 1 ] { Box { size IS s } }
    PROTO B [ field SFVec3f t 2 2 2 ] { PROTO C [ ] { A { s 9 9 9 } } Group { children [ Shape { geometry A { s IS t } } Shape { geometry C { } } ] } }
    PROTO A [ ] { Cone { } }
    B { } B { t 3 3 3 } Shape { geometry A { } }";
    let document = classic(text).clean();
    let all = roots(&document);
    let sizes = |n: NodeRef<'_>| n.children("children").map(|s| s.node("geometry").unwrap().vec3("size")[0]).collect::<Vec<_>>();
    assert_eq!((sizes(all[0]), sizes(all[1])), (vec![2.0, 9.0], vec![3.0, 9.0]));
    assert_eq!(all[2].node("geometry").unwrap().kind(), "Cone");
    classic(&format!("{text} C {{ }}")).warned("a:5: column 50: the node `C` is unknown");
}

#[test]
fn names_do_not_cross_the_walls_of_a_prototype() {
    let text = "DEF X Box { } PROTO P [ ] { Group { children [ DEF Y Shape { geometry USE X } ] } } P { }";
    classic(text).warned("a:2: column 71: USE `X`: no node of this name");
    classic("PROTO P [ ] { DEF Y Box { } } P { } Shape { geometry USE Y }").warned("a:2: column 54: USE `Y`");
    // The defaults of its fields are outside.
    let document = classic("DEF X Box { } PROTO P [ field SFNode g USE X ] { Shape { geometry IS g } } P { }").clean();
    assert_eq!(roots(&document)[1].node("geometry").unwrap().id(), roots(&document)[0].id());
}

#[test]
fn bad_prototypes_are_said() {
    classic("PROTO P [ ] { P { } } P { }").warned("a:2: column 15: the node `P` is unknown");
    classic("PROTO P [ ] { } Group { children P { } }").warned("a:2: column 1: the prototype `P` has no nodes");
    classic("PROTO P [ field SFFloat f 1 ] { Box { size IS f } } P { }")
        .warned("a:2: column 44: IS `f` is initializeOnly SFFloat and the field `size` is initializeOnly SFVec3f");
    classic("PROTO P [ exposedField SFBool f TRUE ] { Box { size IS f } } P { } P { } P { }").warned(
        "a:2: column 53: IS `f` is inputOutput SFBool and the field `size` is initializeOnly SFVec3f; it was skipped: 3, the first here",
    );
    classic("PROTO P [ ] { Box { size IS f } } P { }").warned("a:2: column 26: IS `f`: the prototype has no such field");
    classic("Box { size IS f }").warned("a:2: column 12: IS `f` stands in no prototype");
    classic("PROTO P [ ] { Box { } } P { f 1 }").warned("a:2: column 31: the prototype `P` has no field `f`");
    classic("PROTO P [ eventIn SFBool f ] { Box { } } P { f TRUE }")
        .warned("a:2: column 48: the field `f` of the prototype `P` is an event");
}

/// The standard forbids it, files do it: the value is there, and only events have nowhere to go.
#[test]
fn a_field_that_is_read_once_takes_the_value_of_one_that_changes() {
    let text = "PROTO P [ exposedField SFVec3f s 1 2 3 ] { Box { size IS s } } DEF A P { s 4 5 6 } P { }";
    let document =
        classic(text).warned("a:2: column 55: IS `s` takes events, which the field `size` does not; its value was taken: 2, the first");
    assert_eq!(roots(&document).iter().map(|n| n.vec3("size")[0]).collect::<Vec<_>>(), [4.0, 1.0]);
}

/// Twenty levels of two instances each are a million nodes.
#[test]
fn prototypes_that_multiply_are_bounded() {
    let tower = |first: &str, before: &str, behind: &str| {
        let level = |i: usize| format!("PROTO P{i} [ ] {{ {before} P{0} {{ }} P{0} {{ }} {behind} }}\n", i - 1);
        format!("PROTO P0 [ ] {{ {first} }}\n{}P30 {{ }}", (1..31).map(level).collect::<String>())
    };
    for text in [tower("Box { }", "Group { children [", "] }"), tower("", "", "")] {
        let outcome = classic(&text);
        assert!(outcome.errors[0].contains("the prototypes expand to more than 1048576"), "{:?}", outcome.errors);
    }
}

#[test]
fn routes_are_checked() {
    let route = |r: &str| {
        classic(&format!(
            "DEF T TimeSensor {{ }} DEF I ScalarInterpolator {{ }} DEF M Material {{ }} DEF S TouchSensor {{ }} DEF X Script {{ }}\nROUTE {r}"
        ))
    };
    let count = |r: &str| route(r).document.unwrap().routes.len();
    assert_eq!(count("T.fraction_changed TO I.set_fraction"), 1);
    assert_eq!(count("I.value_changed TO M.set_transparency"), 1);
    assert_eq!(count("M.shininess_changed TO M.transparency"), 1);
    assert_eq!(count("X.anything TO M.transparency"), 0);
    for (bad, message) in [
        ("N.x TO M.transparency", "no node `N`"),
        ("T.fraction TO I.set_fraction", "`T` (TimeSensor) has no field `fraction`"),
        ("I.set_fraction TO M.transparency", "the field `set_fraction` of `I` sends no events"),
        ("T.fraction_changed TO I.value_changed", "the field `value_changed` of `I` takes no events"),
        ("T.isActive TO M.transparency", "T.isActive is SFBool and M.transparency is SFFloat"),
        ("S.nothing TO M.transparency", "`S` (TouchSensor) has no field `nothing`"),
        ("S.hitPoint_changed TO M.transparency", "S.hitPoint_changed is SFVec3f and M.transparency is SFFloat"),
    ] {
        let warnings = route(bad).warnings;
        assert!(warnings.iter().any(|w| w.starts_with("a:3: column 1: ROUTE: ") && w.contains(message)), "{bad}: {warnings:?}");
    }
    // A name further down is found all the same.
    assert_eq!(
        classic("ROUTE T.fraction_changed TO I.set_fraction DEF T TimeSensor { } DEF I ScalarInterpolator { }").clean().routes.len(),
        1
    );
}

#[test]
fn routes_reach_into_instances_and_out_of_them() {
    let text = "PROTO Inner [ inputOutput SFFloat v 0 outputOnly SFFloat out ] { Group { children [ Material { transparency IS v } DEF I ScalarInterpolator { value_changed IS out } ] } }
    PROTO Outer [ inputOutput SFFloat w 0 outputOnly SFFloat o ] { Inner { v IS w out IS o } }
    DEF X Outer { } DEF M Material { }
    ROUTE X.o TO M.transparency
    ROUTE M.shininess TO X.set_w";
    let document = classic(text).clean();
    let ends: Vec<_> = document.routes.iter().map(|r| (document.node(r.from.0).kind(), document.node(r.to.0).kind())).collect();
    assert_eq!(ends, [("ScalarInterpolator", "Material"), ("Material", "Material")]);
    assert_ne!(document.routes[1].from.0, document.routes[1].to.0);
}

#[test]
fn statements_stand_inside_nodes() {
    let text = "Group { PROTO P [ ] { Box { } } children [ DEF T TimeSensor { } DEF I ScalarInterpolator { } ROUTE T.fraction_changed TO I.set_fraction ] } Shape { geometry P { } }";
    let document = classic(text).clean();
    assert_eq!((document.routes.len(), roots(&document)[1].node("geometry").unwrap().kind()), (1, "Box"));
}

/// Two hundred nodes inside one another are read; more are an error, however they came to be there. The stack of a small thread is enough.
#[test]
fn depth_is_bounded_in_every_way_to_get_there() {
    let nest = |n: usize| format!("{}Shape {{ }}{}", "Group { children ".repeat(n), " }".repeat(n));
    let nest_xml = |n: usize| format!("{}<Shape/>{}", "<Group>".repeat(n), "</Group>".repeat(n));
    let nest_json = |n: usize| format!("{}{{\"Shape\": {{}}}}{}", "{\"Group\": {\"-children\": [".repeat(n), "]}}".repeat(n));
    let chain: String = (1..300).map(|i| format!("DEF N{i} Group {{ children USE N{} }} ", i - 1)).collect();
    let tower: String = (1..30).map(|i| format!("PROTO P{i} [ ] {{ Group {{ children Group {{ children Group {{ children Group {{ children Group {{ children Group {{ children Group {{ children P{} {{ }} }} }} }} }} }} }} }} }} ", i - 1)).collect();
    // The defaults of a prototype's fields, declared at the bottom of another's body.
    let level = |i: usize| {
        let inner = format!("PROTO Q [ field SFNode q P{} {{ }} ] {{ }}", i - 1);
        format!("PROTO P{i} [ ] {{ {}Group {{ {inner} }}{} }} ", "Group { children ".repeat(150), " }".repeat(150))
    };
    let defaults: String = (1..30).map(level).collect();
    let run = move || {
        let outcome = classic(&format!("PROTO P0 [ ] {{ Box {{ }} }} {defaults} P29 {{ }}"));
        assert!(outcome.errors[0].contains("more than 200 nodes inside one another, with what is instantiated"), "{:?}", outcome.errors);
        let outcome = classic(&format!("PROTO P0 [ ] {{ Box {{ }} }} {} P29 {{ }}", defaults.replace("Group", "Odd")));
        assert!(outcome.errors[0].contains("more than 200 nodes inside one another, with what is instantiated"), "{:?}", outcome.errors);
        assert!(dump(&classic(&nest(199)).clean()).contains(" Shape "));
        assert!(dump(&xml(&nest_xml(199)).clean()).contains(" Shape "));
        assert!(dump(&json(&nest_json(199)).clean()).contains(" Shape "));
        // Nodes that nobody knows are passed by in the same stack.
        for name in ["Odd", "ScreenGroup"] {
            let odd = |text: String| text.replace("Group", name);
            for outcome in [classic(&odd(nest(199))), xml(&odd(nest_xml(199))), json(&odd(nest_json(199)))] {
                assert!(outcome.errors.is_empty() && outcome.warnings.len() == 1, "{:?}", (outcome.errors, outcome.warnings));
            }
        }
        classic(&nest(200)).failed("a:2: column 3401: more than 200 nodes inside one another");
        xml(&nest_xml(200)).failed("a:2: column 1401: more than 200 nodes inside one another");
        for deep in [classic(&nest(100_000)), xml(&nest_xml(100_000)), json(&nest_json(100_000))] {
            assert!(deep.errors[0].contains("inside one another"), "{:?}", deep.errors);
        }
        let outcome = classic(&format!("DEF N0 Box {{ }} {chain}"));
        assert!(outcome.errors[0].contains("more than 200 nodes inside one another, with what is used"), "{:?}", outcome.errors);
        let outcome = classic(&format!("PROTO P0 [ ] {{ Box {{ }} }} {tower} P29 {{ }}"));
        assert!(outcome.errors[0].contains("more than 200 nodes inside one another, with what is instantiated"), "{:?}", outcome.errors);
    };
    std::thread::Builder::new().stack_size(2 << 20).spawn(run).unwrap().join().unwrap();
}
