//! The three encodings side by side.

mod nonsense;

use super::{
    table::{self, Access},
    testing::{classic, dump, json, outcome_of, xml},
    value::{Base, FieldType, Store},
};
use std::{
    f32::consts::{FRAC_PI_2, FRAC_PI_4},
    fmt::Write,
};

/// One scene with everything that crosses names, in each encoding.
const CLASSIC: &str = r##"#X3D V3.3 utf8
PROFILE Immersive
COMPONENT Rendering:5
META "title" "test"
UNIT angle degree 0.5
UNIT length foot 0.25
EXPORT Ball AS Sphere1
PROTO Lamp [ inputOutput SFColor tint 1 0 0 inputOnly SFFloat set_power initializeOnly MFNode content [ Box { } ] ] {
  Group { children [ DEF L PointLight { color IS tint set_intensity IS set_power } Group { children IS content } ] }
}
DEF Ball Transform { # a comment, with a comma
  rotation 0 1 0 2, translation 1 2 3
  children [
    Shape { appearance DEF App Appearance { material Material { diffuseColor 0.1 0.2 0.3 } texture PixelTexture { image 1 2 3 0xFF0000 255 } }
            geometry IndexedFaceSet { solid FALSE creaseAngle 3 coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } coordIndex [ 0 1 2 -1 ] } }
    Shape { appearance USE App geometry Box { } }
  ]
}
DEF Two Lamp { tint 0 1 0 content [ Sphere { radius 2 } Cone { } ] }
Lamp { }
NavigationInfo { type [ "EXAMINE" "a \"b\" \\" ] }
DEF Clock TimeSensor { loop TRUE }
DEF Dim ScalarInterpolator { key [ 0 1 ] keyValue [ 1 0 ] }
ROUTE Clock.fraction_changed TO Dim.set_fraction
ROUTE Dim.value_changed TO Two.set_power
"##;

const XML: &str = r##"<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE X3D PUBLIC "ISO//Web3D//DTD X3D 3.3//EN" "https://www.web3d.org/specifications/x3d-3.3.dtd">
<X3D version='3.3' profile='Immersive' xmlns:xsd='http://www.w3.org/2001/XMLSchema-instance' xsd:noNamespaceSchemaLocation='x'>
<head><component name='Rendering' level='5'/><unit category='angle' name='degree' conversionFactor='0.5'/>
<unit category='length' name='foot' conversionFactor='0.25'/><meta name='title' content='test'/></head>
<Scene>
<EXPORT localDEF='Ball' AS='Sphere1'/>
<ProtoDeclare name='Lamp'><ProtoInterface>
  <field name='tint' type='SFColor' accessType='inputOutput' value='1 0 0'/>
  <field name='set_power' type='SFFloat' accessType='inputOnly'/>
  <field name='content' type='MFNode' accessType='initializeOnly'><Box/></field>
</ProtoInterface><ProtoBody>
  <Group>
    <PointLight DEF='L'><IS><connect nodeField='color' protoField='tint'/><connect nodeField='set_intensity' protoField='set_power'/></IS></PointLight>
    <Group><IS><connect nodeField='children' protoField='content'/></IS></Group>
  </Group>
</ProtoBody></ProtoDeclare>
<Transform DEF='Ball' rotation='0 1 0 2' translation='1 2 3'>
  <!-- a comment -->
  <Shape><Appearance DEF='App'><Material diffuseColor='0.1 0.2 0.3'/><PixelTexture image='1 2 3 0xFF0000 255'/></Appearance>
    <IndexedFaceSet solid='false' creaseAngle='3' coordIndex='0 1 2 -1'><Coordinate point='0 0 0, 1 0 0, 0 1 0'/></IndexedFaceSet></Shape>
  <Shape><Appearance USE='App'/><Box/></Shape>
</Transform>
<ProtoInstance name='Lamp' DEF='Two'><fieldValue name='tint' value='0 1 0'/>
  <fieldValue name='content'><Sphere radius='2'/><Cone/></fieldValue></ProtoInstance>
<ProtoInstance name='Lamp'/>
<NavigationInfo type='"EXAMINE" "a \"b\" \\"'/>
<TimeSensor DEF='Clock' loop='true'/>
<ScalarInterpolator DEF='Dim' key='0 1' keyValue='1 0'/>
<ROUTE fromNode='Clock' fromField='fraction_changed' toNode='Dim' toField='set_fraction'/>
<ROUTE fromNode='Dim' fromField='value_changed' toNode='Two' toField='set_power'/>
</Scene></X3D>"##;

const JSON: &str = r##"{ "X3D": { "encoding": "UTF-8", "@profile": "Immersive", "@version": "3.3",
  "head": { "meta": [ { "@name": "title", "@content": "test" } ],
    "unit": [ { "@category": "angle", "@name": "degree", "@conversionFactor": 0.5 },
              { "@category": "length", "@name": "foot", "@conversionFactor": 0.25 } ] },
  "Scene": { "-children": [
    { "EXPORT": { "@localDEF": "Ball", "@AS": "Sphere1" } },
    { "ProtoDeclare": { "@name": "Lamp",
      "ProtoInterface": { "field": [
        { "@name": "tint", "@type": "SFColor", "@accessType": "inputOutput", "@value": [1,0,0] },
        { "@name": "set_power", "@type": "SFFloat", "@accessType": "inputOnly" },
        { "@name": "content", "@type": "MFNode", "@accessType": "initializeOnly", "-children": [ { "Box": { } } ] } ] },
      "ProtoBody": { "-children": [ { "Group": { "-children": [
        { "PointLight": { "@DEF": "L", "IS": { "connect": [
          { "@nodeField": "color", "@protoField": "tint" }, { "@nodeField": "set_intensity", "@protoField": "set_power" } ] } } },
        { "Group": { "IS": { "connect": [ { "@nodeField": "children", "@protoField": "content" } ] } } } ] } } ] } } },
    { "#comment": "a comment" },
    { "Transform": { "@DEF": "Ball", "@rotation": [0,1,0,2], "@translation": [1,2,3], "-children": [
      { "Shape": {
        "-appearance": { "Appearance": { "@DEF": "App", "-material": { "Material": { "@diffuseColor": [0.1,0.2,0.3] } },
          "-texture": { "PixelTexture": { "@image": [1,2,3,16711680,255] } } } },
        "-geometry": { "IndexedFaceSet": { "@solid": false, "@creaseAngle": 3, "@coordIndex": [0,1,2,-1],
          "-coord": { "Coordinate": { "@point": [0,0,0,1,0,0,0,1,0] } } } } } },
      { "Shape": { "-appearance": { "Appearance": { "@USE": "App" } }, "-geometry": { "Box": { } } } } ] } },
    { "ProtoInstance": { "@name": "Lamp", "@DEF": "Two", "fieldValue": [ { "@name": "tint", "@value": [0,1,0] },
      { "@name": "content", "-children": [ { "Sphere": { "@radius": 2 } }, { "Cone": { } } ] } ] } },
    { "ProtoInstance": { "@name": "Lamp" } },
    { "NavigationInfo": { "@type": ["EXAMINE", "a \"b\" \\"] } },
    { "TimeSensor": { "@DEF": "Clock", "@loop": true } },
    { "ScalarInterpolator": { "@DEF": "Dim", "@key": [0,1], "@keyValue": [1,0] } },
    { "ROUTE": { "@fromNode": "Clock", "@fromField": "fraction_changed", "@toNode": "Dim", "@toField": "set_fraction" } },
    { "ROUTE": { "@fromNode": "Dim", "@fromField": "value_changed", "@toNode": "Two", "@toField": "set_power" } }
  ] } } }"##;

#[test]
fn the_encodings_say_the_same() {
    let of = |text: &str| dump(&outcome_of(&[("a", text.as_bytes())], None).clean());
    let classic = of(CLASSIC);
    assert_eq!(of(XML), classic);
    assert_eq!(of(JSON), classic);
    for part in [
        ".scale Floats([0.25, 0.25, 0.25])",
        ".rotation Floats([0.0, 1.0, 0.0, 1.0])",
        ".creaseAngle Floats([1.5])",
        ".image Ints([1, 2, 3, 16711680, 255])",
        ".type Strings([\"EXAMINE\", \"a \\\"b\\\" \\\\\"])",
        ".color Floats([0.0, 1.0, 0.0])",
        ".color Floats([1.0, 0.0, 0.0])",
    ] {
        assert!(classic.contains(part), "{part} is not in\n{classic}");
    }
    assert_eq!(classic.matches(" Cone ").count(), 1);
    assert_eq!(classic.matches("-> (").count(), 2, "{classic}");
}

/// A value that is not the default, as numbers or words, with how many elements an `MF` has.
fn sample(ty: FieldType) -> Vec<String> {
    let count = ty.width().max(1) * if ty.many { 2 } else { 1 };
    match ty.base {
        Base::Bool => vec!["true".into(); count],
        Base::String => (0..count).map(|i| format!("s{i}")).collect(),
        Base::Image => ["1", "1", "3", "77"].iter().cycle().take(4 * count).map(|s| (*s).into()).collect(),
        Base::Int32 => (0..count).map(|i| (i + 11).to_string()).collect(),
        _ => (0..count).map(|i| format!("{}.5", i + 3)).collect(),
    }
}

fn classic_value(ty: FieldType, words: &[String]) -> String {
    match ty.base {
        Base::String => words.iter().map(|w| format!("\"{w}\" ")).collect(),
        _ => words.join(" ").to_uppercase(),
    }
}

fn xml_value(ty: FieldType, words: &[String]) -> String {
    if ty.base == Base::String && ty.many { words.iter().map(|w| format!("\"{w}\" ")).collect() } else { words.join(" ") }
}

fn json_value(ty: FieldType, words: &[String]) -> String {
    let words: Vec<String> = words.iter().map(|w| if ty.base == Base::String { format!("\"{w}\"") } else { w.clone() }).collect();
    if words.len() == 1 && !ty.many { words[0].clone() } else { format!("[{}]", words.join(",")) }
}

/// Every field of every node of the table that a file can set, in all encodings: they agree, and the value is not the default.
#[test]
fn every_field_of_the_table_in_every_encoding() {
    let mut fields = 0;
    for kind in table::all().filter(|k| !k.skipped) {
        for field in kind.fields.iter().filter(|f| f.access.has_value()) {
            let (name, node, ty) = (field.name, kind.name, field.ty);
            let documents = if ty.store() == Store::Nodes {
                [
                    classic(&format!("{node} {{ {name} [ Box {{ size 1 2 3 }} ] }}")),
                    xml(&format!("<{node}><Box size='1 2 3' containerField='{name}'/></{node}>")),
                    json(&format!(r#"{{"{node}": {{"-{name}": [{{"Box": {{"@size": [1,2,3]}}}}]}}}}"#)),
                ]
            } else {
                let words = sample(ty);
                [
                    classic(&format!("{node} {{ {name} [ {} ] }}", classic_value(ty, &words))),
                    xml(&format!("<{node} {name}='{}'/>", xml_value(ty, &words))),
                    json(&format!(r#"{{"{node}": {{"@{name}": {}}}}}"#, json_value(ty, &words))),
                ]
            };
            let mut dumps = vec![];
            for outcome in documents {
                assert_eq!(outcome.errors, [""; 0], "{node}.{name}");
                let document = outcome.document.unwrap();
                let root = document.roots().next().unwrap();
                assert!(root.is_set(name), "{node}.{name}");
                if field.ty.base != Base::Bool {
                    assert_ne!(root.value(name), Some(&field.default), "{node}.{name}");
                }
                dumps.push(dump(&document));
            }
            assert!(dumps[0] == dumps[1] && dumps[1] == dumps[2], "{node}.{name}: {dumps:#?}");
            fields += 1;
        }
    }
    assert!(fields > 600, "{fields}");
}

/// The getters answer with defaults where a file says nothing, for every field.
#[test]
fn defaults_come_from_the_table() {
    let mut text = String::new();
    for kind in table::all().filter(|k| !k.skipped && !matches!(k.name, "Inline" | "KambiInline")) {
        let _ = writeln!(text, "{} {{ }}", kind.name);
    }
    let document = classic(&text).clean();
    for node in document.roots() {
        let kind = table::lookup(node.kind()).unwrap();
        for field in &kind.fields {
            assert!(!node.is_set(field.name));
            assert_eq!(node.value(field.name), Some(&field.default));
        }
    }
    let of = |kind: &str| document.roots().find(|n| n.kind() == kind).unwrap();
    assert_eq!(of("Box").vec3("size"), [2.0; 3]);
    assert_eq!(of("Material").float("shininess"), 0.2);
    assert_eq!(of("Extrusion").mf_vec2("crossSection").len(), 5);
    assert_eq!(of("Viewpoint").vec3("position"), [0.0, 0.0, 10.0]);
    assert_eq!(of("MatrixTransform").matrix4("matrix")[15], 1.0);
    assert_eq!(of("TimeSensor").double("cycleInterval"), 1.0);
    assert_eq!(of("GeneratedShadowMap").string("compareMode"), "COMPARE_R_LEQUAL");
    assert_eq!((of("Switch").int("whichChoice"), of("Cylinder").bool("side")), (-1, true));
    assert_eq!(of("NavigationInfo").mf_string("type").len(), 2);
    assert!(of("Shape").node("geometry").is_none() && of("Group").children("children").next().is_none());
    // A slip of the caller.
    assert_eq!((of("Box").vec3("nonsense"), of("Box").int("size"), of("Box").has("size")), ([0.0; 3], 0, true));
}

#[test]
fn getters_convert_between_widths() {
    let document = classic("CoordinateDouble { point [ 1 2 3, 4 5 6 ] } TimeSensor { startTime 2.5 } Switch { whichChoice 2 }").clean();
    let roots: Vec<_> = document.roots().collect();
    assert_eq!(roots[0].mf_vec3("point").to_vec(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!((roots[1].double("startTime"), roots[1].float("startTime")), (2.5, 2.5));
    assert_eq!(roots[2].int("whichChoice"), 2);
    assert_eq!(roots.iter().map(|n| n.place().line).collect::<Vec<_>>(), [2, 2, 2]);
}

#[test]
fn the_spot_light_has_the_defaults_of_its_version() {
    let of =
        |header: &str| outcome_of(&[("a", format!("{header}\nSpotLight {{ }} SpotLight {{ cutOffAngle 1 }}").as_bytes())], None).clean();
    for (header, cut_off, beam) in
        [("#VRML V2.0 utf8", FRAC_PI_4, FRAC_PI_2), ("#X3D V3.2 utf8", FRAC_PI_4, FRAC_PI_2), ("#X3D V4.0 utf8", FRAC_PI_2, FRAC_PI_4)]
    {
        let document = of(header);
        let lights: Vec<_> = document.roots().collect();
        assert_eq!((lights[0].float("cutOffAngle"), lights[0].float("beamWidth")), (cut_off, beam), "{header}");
        assert_eq!(lights[1].float("cutOffAngle"), 1.0);
    }
}

/// The events that only exist for routes cannot be given values.
#[test]
fn events_have_no_values() {
    assert_eq!(Access::parse("eventIn"), Some(Access::Input));
    classic("IndexedFaceSet { set_coordIndex [ 1 ] }").warned("a:2: column 33: the field `set_coordIndex` of `IndexedFaceSet` is an event");
}
