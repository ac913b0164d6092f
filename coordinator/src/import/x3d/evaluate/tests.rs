//! Scenes at times.

use crate::import::x3d::{
    Document, NodeRef,
    testing::{Outcome, outcome_of},
};

fn at(text: &str, time: f64) -> Outcome {
    outcome_of(&[("a", format!("#X3D V3.0 utf8\n{text}").as_bytes())], Some(time))
}

fn named<'a>(document: &'a Document, def: &str) -> NodeRef<'a> {
    document.nodes().find(|n| n.def() == Some(def)).unwrap()
}

/// Where a transform is that a position interpolator moves from 0 to 8 along x, driven by a clock with these fields.
fn x_at(clock: &str, time: f64) -> f32 {
    let text = format!(
        "DEF T TimeSensor {{ {clock} }} DEF P PositionInterpolator {{ key [ 0 1 ] keyValue [ 0 0 0, 8 0 0 ] }} DEF M Transform {{ translation -1 0 0 }}
        ROUTE P.value_changed TO M.set_translation ROUTE T.fraction_changed TO P.set_fraction"
    );
    let document = at(&text, time).clean();
    named(&document, "M").vec3("translation")[0]
}

#[test]
fn clocks_run_from_start_to_end() {
    assert_eq!(x_at("cycleInterval 4", 1.0), 2.0);
    assert_eq!(x_at("cycleInterval 4", 0.0), 0.0);
    assert_eq!(x_at("cycleInterval 4", 9.0), 8.0);
    assert_eq!(x_at("cycleInterval 4 startTime 2", 1.0), -1.0);
    assert_eq!(x_at("cycleInterval 4 startTime 2", 3.0), 2.0);
    assert_eq!(x_at("cycleInterval 4 enabled FALSE", 1.0), -1.0);
    assert_eq!(x_at("cycleInterval 0", 1.0), -1.0);
}

#[test]
fn clocks_loop_stop_and_pause() {
    assert_eq!(x_at("cycleInterval 4 loop TRUE", 9.0), 2.0);
    // The end of a cycle is its end, and not the beginning of the next.
    assert_eq!(x_at("cycleInterval 4 loop TRUE", 8.0), 8.0);
    assert_eq!(x_at("cycleInterval 4 loop TRUE stopTime 5", 99.0), 2.0);
    assert_eq!(x_at("cycleInterval 4 loop TRUE startTime 6 stopTime 5", 7.0), 2.0);
    assert_eq!(x_at("cycleInterval 4 loop TRUE pauseTime 1", 3.0), 2.0);
    assert_eq!(x_at("cycleInterval 4 loop TRUE pauseTime 1 resumeTime 3", 4.0), 4.0);
}

#[test]
fn without_a_time_nothing_moves() {
    let text = "#X3D V3.0 utf8\nDEF T TimeSensor { loop TRUE } DEF S ScalarInterpolator { key 0 keyValue 1 } DEF M Material { }
        ROUTE T.fraction_changed TO S.set_fraction ROUTE S.value_changed TO M.transparency";
    let of = |time| outcome_of(&[("a", text.as_bytes())], time).clean();
    assert!(!named(&of(None), "M").is_set("transparency"));
    assert_eq!(named(&of(Some(0.0)), "M").float("transparency"), 1.0);
}

/// One interpolator at fraction 0.25, into a field of another node.
fn quarter(interpolator: &str, output: &str, target: &str, field: &str) -> Document {
    let text = format!(
        "DEF T TimeSensor {{ }} DEF I {interpolator} DEF M {target}
        ROUTE T.fraction_changed TO I.set_fraction ROUTE I.{output} TO M.{field}"
    );
    at(&text, 0.25).clean()
}

#[test]
fn every_interpolator_reaches_its_field() {
    let value = |i: &str, t: &str, f: &str| quarter(i, "value_changed", t, f);
    let float = |i: &str, t: &str, f: &str| named(&value(i, t, f), "M").float(f);
    assert_eq!(float("ScalarInterpolator { key [ 0 1 ] keyValue [ 2 4 ] }", "Material { }", "shininess"), 2.5);
    let document = value("ColorInterpolator { key [ 0 1 ] keyValue [ 1 0 0, 0 1 0 ] }", "Material { }", "diffuseColor");
    assert_eq!(named(&document, "M").vec3("diffuseColor"), [1.0, 0.5, 0.0]);
    let document = value("OrientationInterpolator { key [ 0 1 ] keyValue [ 0 1 0 0, 0 1 0 1 ] }", "Transform { }", "rotation");
    let [x, y, z, angle] = named(&document, "M").vec4("rotation");
    assert!(x == 0.0 && (y - 1.0).abs() < 1e-6 && z == 0.0 && (angle - 0.25).abs() < 1e-6);
    let document =
        value("CoordinateInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1, 4 0 0, 1 1 5 ] }", "Coordinate { point [ 9 9 9 ] }", "point");
    assert_eq!(named(&document, "M").mf_vec3("point").to_vec(), [[1.0, 0.0, 0.0], [1.0, 1.0, 2.0]]);
    let document = value("CoordinateInterpolator2D { key [ 0 1 ] keyValue [ 0 0, 4 8 ] }", "TextureCoordinate { }", "point");
    assert_eq!(named(&document, "M").mf_vec2("point").to_vec(), [[1.0, 2.0]]);
    let document = value("NormalInterpolator { key [ 0 0.5 ] keyValue [ 1 0 0, 0 1 0 ] }", "Normal { }", "vector");
    let [x, y, z] = named(&document, "M").mf_vec3("vector")[0];
    assert!((x - y).abs() < 1e-6 && (x * x + y * y - 1.0).abs() < 1e-6 && z == 0.0);
    let document = value("PositionInterpolator2D { key [ 0 1 ] keyValue [ 0 0, 4 8 ] }", "TextureTransform { }", "translation");
    assert_eq!(named(&document, "M").vec2("translation"), [1.0, 2.0]);
    let document = value("VectorInterpolator { key [ 0 1 ] keyValue [ 0 4, 4 8 ] }", "FogCoordinate { }", "depth");
    assert_eq!(named(&document, "M").mf_float("depth").to_vec(), [1.0, 5.0]);
    let document = value("ColorSetInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 1 1 1, 1 1 1, 1 1 1 ] }", "Color { }", "color");
    assert_eq!(named(&document, "M").mf_vec3("color").to_vec(), [[0.25; 3], [1.0; 3]]);
    assert_eq!(float("SplineScalarInterpolator { key [ 0 0.25 1 ] keyValue [ 0 3 1 ] }", "Material { }", "shininess"), 3.0);
    let document = value("SplinePositionInterpolator { key [ 0 0.5 ] keyValue [ 0 0 0, 2 0 0 ] }", "Transform { }", "scale");
    assert_eq!(named(&document, "M").vec3("scale"), [1.0, 0.0, 0.0]);
    let document = value("SplinePositionInterpolator2D { key [ 0 0.5 ] keyValue [ 0 0, 2 4 ] }", "TextureTransform { }", "center");
    assert_eq!(named(&document, "M").vec2("center"), [1.0, 2.0]);
    let document = value("SquadOrientationInterpolator { key [ 0 0.25 ] keyValue [ 0 1 0 0, 0 0 1 1 ] }", "Transform { }", "rotation");
    assert!((named(&document, "M").vec4("rotation")[3] - 1.0).abs() < 1e-6);
    let document = value("IntegerSequencer { key [ 0 0.2 0.5 ] keyValue [ 4 5 6 ] }", "Switch { }", "whichChoice");
    assert_eq!(named(&document, "M").int("whichChoice"), 5);
    let document = value("BooleanSequencer { key [ 0 0.2 ] keyValue [ TRUE FALSE ] }", "PointLight { }", "on");
    assert!(!named(&document, "M").bool("on"));
    let document =
        quarter("EaseInEaseOut { key [ 0 1 ] easeInEaseOut [ 0 0.5, 0.5 0 ] }", "modifiedFraction_changed", "Material { }", "shininess");
    assert_eq!(named(&document, "M").float("shininess"), 0.125);
}

#[test]
fn routes_chain_in_any_order_of_the_file() {
    let text = "DEF B ScalarInterpolator { key [ 0 1 ] keyValue [ 1 0 ] } DEF M Material { } DEF N Material { }
        ROUTE M.shininess_changed TO N.shininess ROUTE B.value_changed TO M.shininess ROUTE A.value_changed TO B.set_fraction
        DEF A ScalarInterpolator { key [ 0 1 ] keyValue [ 0 0.5 ] } DEF T TimeSensor { } ROUTE T.fraction_changed TO A.set_fraction";
    let document = at(text, 0.5).clean();
    assert_eq!((named(&document, "M").float("shininess"), named(&document, "N").float("shininess")), (0.75, 0.75));
}

#[test]
fn clocks_start_each_other() {
    let text = "DEF A TimeSensor { cycleInterval 2 loop TRUE } DEF B TimeSensor { cycleInterval 10 startTime 50 }
        DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] } DEF M Material { }
        ROUTE A.cycleTime TO B.startTime ROUTE B.fraction_changed TO S.set_fraction ROUTE S.value_changed TO M.transparency";
    assert!((named(&at(text, 5.0).clean(), "M").float("transparency") - 0.1).abs() < 1e-6);
}

#[test]
fn circles_are_followed_once_and_said() {
    let text = "DEF A Material { } DEF B Material { } DEF T TimeSensor { } DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] }
        ROUTE A.shininess TO B.shininess\nROUTE B.shininess TO A.shininess
        ROUTE T.fraction_changed TO S.set_fraction ROUTE S.value_changed TO A.shininess";
    let document = at(text, 0.5).warned("a:4: column 1: ROUTEs go in a circle from here");
    assert_eq!((named(&document, "A").float("shininess"), named(&document, "B").float("shininess")), (0.5, 0.5));
}

#[test]
fn events_set_what_files_only_initialise() {
    let text = "DEF F IndexedFaceSet { } DEF V VectorInterpolator { key 0 keyValue [ 1 2 ] } DEF T TimeSensor { } DEF E ElevationGrid { height [ 7 ] }
        ROUTE T.fraction_changed TO V.set_fraction ROUTE V.value_changed TO E.set_height";
    assert_eq!(named(&at(text, 0.0).clean(), "E").mf_float("height").to_vec(), [1.0, 2.0]);
}

#[test]
fn events_reach_into_prototypes() {
    let text = "PROTO Fade [ inputOnly SFFloat set_fraction ] { Group { children [ DEF Inner Material { } DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0 1 ] set_fraction IS set_fraction } ] ROUTE S.value_changed TO Inner.transparency } }
        DEF F Fade { } DEF T TimeSensor { } ROUTE T.fraction_changed TO F.set_fraction";
    let outcome = at(text, 0.25);
    assert!(outcome.warnings.iter().all(|w| w.contains("no field")) || outcome.warnings.is_empty(), "{:?}", outcome.warnings);
    assert_eq!(named(&outcome.document.unwrap(), "Inner").float("transparency"), 0.25);
}

#[test]
fn angles_are_converted_on_the_way() {
    let text =
        "UNIT angle half 0.5 DEF T TimeSensor { } DEF S ScalarInterpolator { key 0 keyValue 1 } DEF L SpotLight { } DEF M Material { }
        ROUTE T.fraction_changed TO S.set_fraction ROUTE S.value_changed TO L.cutOffAngle ROUTE S.value_changed TO M.shininess";
    let document = at(text, 0.0).clean();
    assert_eq!((named(&document, "L").float("cutOffAngle"), named(&document, "M").float("shininess")), (0.5, 1.0));
}

#[test]
fn keys_without_values_are_said() {
    let text = |values: &str| {
        format!(
            "DEF T TimeSensor {{ }}\nDEF S ScalarInterpolator {{ key [ 0 1 ] keyValue [ {values} ] }} DEF M Material {{ }}
            ROUTE T.fraction_changed TO S.set_fraction ROUTE S.value_changed TO M.shininess"
        )
    };
    let document = at(&text("3"), 0.5).warned("a:3: column 7: `ScalarInterpolator` has 2 keys and 1 values");
    assert_eq!(named(&document, "M").float("shininess"), 3.0);
    let document = at(&text(""), 0.5).warned("a:3: column 7: `ScalarInterpolator` has 2 keys and 0 values");
    assert!(!named(&document, "M").is_set("shininess"));
}
