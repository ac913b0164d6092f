use super::*;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

#[test]
fn every_line_of_the_table_is_read() {
    let types = read(&PARTS).unwrap();
    assert!(types.len() > 170, "{}", types.len());
    for (name, node) in &types {
        assert_eq!(*name, node.name);
        assert!(node.fields.len() < usize::from(u16::MAX));
        for field in &node.fields {
            let names = node.fields.iter().filter(|f| f.name == field.name || f.aliases.contains(&field.name)).count();
            assert_eq!(names, 1, "{name}.{}", field.name);
            assert!(!field.angle || matches!(field.ty.to_string().as_str(), "SFFloat" | "MFFloat"), "{name}.{}", field.name);
        }
    }
}

/// Every default container of a node that is not skipped is a field of some node.
#[test]
fn default_containers_exist() {
    let types = read(&PARTS).unwrap();
    for node in types.values().filter(|n| !n.skipped) {
        assert!(types.values().any(|n| n.field(node.container).is_some()), "{} goes to {}", node.name, node.container);
    }
}

/// What stands in for a skipped node is empty and may stand there.
#[test]
fn stand_ins_fit() {
    let types = read(&PARTS).unwrap();
    let fields: Vec<_> = types.values().flat_map(|n| &n.fields).filter_map(|f| Some((f.name, f.ty, f.stand_in?))).collect();
    assert_eq!(fields.len(), 7, "{fields:?}");
    for (name, ty, stand_in) in fields {
        let kind = &types[stand_in];
        assert!(ty.many && !kind.skipped && kind.container == name, "{stand_in} in {name}");
    }
}

#[test]
fn lines_that_say_nothing_are_found() {
    for bad in
        ["A", "A in", "A in b nonsense", "A in b : Missing", "  SFBool [] x TRUE", "A in b\n  SFBool x TRUE", "A in b\n  SFVec3f [] x 1 2"]
    {
        assert!(read(&[bad]).is_err(), "{bad}");
    }
    assert!(read(&["A in b\nA in b"]).is_err());
    assert_eq!(read(&["A in b\n  SFNode [] x Box"]), Err(BadLine("  SFNode [] x Box".into())));
}

#[test]
fn names_aliases_and_events_lead_to_fields() {
    let transform = lookup("Transform").unwrap();
    let (index, field) = transform.field("translation").unwrap();
    assert_eq!((field.ty.to_string().as_str(), field.access), ("SFVec3f", Access::InputOutput));
    for name in ["set_translation", "translation_changed", "translation"] {
        assert_eq!(transform.event(name).unwrap().0, index);
    }
    assert!(transform.event("set_bboxCenter").is_none() && transform.field("set_translation").is_none());
    let switch = lookup("Switch").unwrap();
    assert_eq!(switch.field("choice"), switch.field("children"));
    let spot = lookup("SpotLight").unwrap();
    let cut_off = spot.field("cutOffAngle").unwrap().1;
    assert_eq!(cut_off.default, Value::Floats([FRAC_PI_4].into()));
    assert_eq!(cut_off.since, Some((33, Value::Floats([FRAC_PI_2].into()))));
    assert!(cut_off.angle && lookup("Script").unwrap().skipped && lookup("Teapot").is_none());
}

/// The fields of the shadow and projection extension, as its paper lists them.
#[test]
fn the_shadow_fields_are_all_there() {
    let expected = [
        ("DirectionalLight", "projectionRectangle", "SFVec4f"),
        ("DirectionalLight", "projectionLocation", "SFVec3f"),
        ("SpotLight", "projectionAngle", "SFFloat"),
        ("Appearance", "receiveShadows", "MFNode"),
        ("Appearance", "shadowCaster", "SFBool"),
        ("GeneratedShadowMap", "update", "SFString"),
        ("GeneratedShadowMap", "size", "SFInt32"),
        ("GeneratedShadowMap", "light", "SFNode"),
        ("GeneratedShadowMap", "scale", "SFFloat"),
        ("GeneratedShadowMap", "bias", "SFFloat"),
        ("GeneratedShadowMap", "compareMode", "SFString"),
        ("ProjectedTextureCoordinate", "projector", "SFNode"),
        ("Shape", "castShadow", "SFBool"),
    ];
    let light = [("projectionNear", "SFFloat"), ("projectionFar", "SFFloat"), ("up", "SFVec3f"), ("defaultShadowMap", "SFNode")];
    let later = [("shadows", "SFBool"), ("shadowIntensity", "SFFloat")];
    let lights = ["DirectionalLight", "PointLight", "SpotLight"];
    let of_lights = lights.iter().flat_map(|l| light.iter().chain(&later).map(move |(f, t)| (*l, *f, *t)));
    for (node, field, ty) in of_lights.chain(expected) {
        let found = lookup(node).unwrap().field(field).unwrap_or_else(|| panic!("{node}.{field}")).1;
        assert_eq!(found.ty.to_string(), ty, "{node}.{field}");
        assert!(found.access.has_value());
    }
}
