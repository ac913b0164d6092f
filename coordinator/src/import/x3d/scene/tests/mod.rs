//! Scenes written once and rendered in the three encodings, so that every field is seen to arrive from each of them.

mod alpha;
mod bounds;
mod environment;
mod exporters;
mod fields;
mod inlined;
mod looks;
mod projected;

use crate::import::{Bundle, Content, Part, import_bundle};
use base64::{Engine, prelude::BASE64_STANDARD as STANDARD};
use image::{ImageFormat, Rgba, RgbaImage};
use kiln_proto::{options::ImportOptions, scene::Scene};

/// A node of a test scene.
#[derive(Clone)]
pub(super) struct Node {
    kind: &'static str,
    def: Option<&'static str>,
    fields: Vec<(&'static str, Value)>,
}

/// A value of a field.
#[derive(Clone)]
pub(super) enum Value {
    /// Numbers or booleans, as ClassicVRML writes a single value.
    One(&'static str),
    /// The same for a list.
    Many(&'static str),
    Text(&'static str),
    Texts(&'static [&'static str]),
    Child(Node),
    Children(Vec<Node>),
    /// USE: kind and name.
    Use(&'static str, &'static str),
    Uses(&'static str, &'static str),
}

use Value::*;

pub(super) fn node(kind: &'static str, fields: impl IntoIterator<Item = (&'static str, Value)>) -> Node {
    Node { kind, def: None, fields: fields.into_iter().collect() }
}

impl Node {
    pub(super) fn def(mut self, name: &'static str) -> Self {
        self.def = Some(name);
        self
    }

    pub(super) fn with(mut self, field: &'static str, value: Value) -> Self {
        self.fields.push((field, value));
        self
    }

    fn classic(&self) -> String {
        let fields: Vec<String> = self.fields.iter().map(|(name, value)| format!("{name} {}", classic(value))).collect();
        let def = self.def.map(|d| format!("DEF {d} ")).unwrap_or_default();
        format!("{def}{} {{\n{}\n}}", self.kind, fields.join("\n"))
    }

    fn xml(&self, container: &str) -> String {
        let (mut attributes, mut inside) = (String::new(), String::new());
        if let Some(def) = self.def {
            attributes += &format!(" DEF='{def}'");
        }
        if !container.is_empty() {
            attributes += &format!(" containerField='{container}'");
        }
        for (name, value) in &self.fields {
            match value {
                One(v) | Many(v) => attributes += &format!(" {name}='{}'", v.replace("TRUE", "true").replace("FALSE", "false")),
                Text(v) => attributes += &format!(" {name}='{v}'"),
                Texts(v) => attributes += &format!(" {name}='{}'", v.iter().map(|t| format!("\"{t}\"")).collect::<Vec<_>>().join(" ")),
                Child(n) => inside += &n.xml(name),
                Children(all) => all.iter().for_each(|n| inside += &n.xml(name)),
                Use(kind, def) | Uses(kind, def) => inside += &format!("<{kind} USE='{def}' containerField='{name}'/>\n"),
            }
        }
        format!("<{}{attributes}>\n{inside}</{}>\n", self.kind, self.kind)
    }

    fn json(&self) -> String {
        let def = self.def.map(|d| format!("\"@DEF\":\"{d}\""));
        let fields = self.fields.iter().map(|(name, value)| json(name, value));
        let all: Vec<String> = def.into_iter().chain(fields).collect();
        format!("{{\"{}\":{{{}}}}}", self.kind, all.join(","))
    }
}

fn classic(value: &Value) -> String {
    match value {
        One(v) => (*v).to_owned(),
        Many(v) => format!("[ {v} ]"),
        Text(v) => format!("\"{v}\""),
        Texts(v) => format!("[ {} ]", v.iter().map(|t| format!("\"{t}\"")).collect::<Vec<_>>().join(" ")),
        Child(n) => n.classic(),
        Children(all) => format!("[ {} ]", all.iter().map(Node::classic).collect::<Vec<_>>().join("\n")),
        Use(_, name) => format!("USE {name}"),
        Uses(_, name) => format!("[ USE {name} ]"),
    }
}

fn json(name: &str, value: &Value) -> String {
    // JSON has no hexadecimal numbers.
    let plain = |word: &str| match word.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16).unwrap().to_string(),
        None => word.replace("TRUE", "true").replace("FALSE", "false"),
    };
    let numbers = |v: &str| v.split_whitespace().map(plain).collect::<Vec<_>>().join(",");
    match value {
        One(v) if !v.contains(' ') => format!("\"@{name}\":{}", numbers(v)),
        One(v) | Many(v) => format!("\"@{name}\":[{}]", numbers(v)),
        Text(v) => format!("\"@{name}\":\"{v}\""),
        Texts(v) => format!("\"@{name}\":[{}]", v.iter().map(|t| format!("\"{t}\"")).collect::<Vec<_>>().join(",")),
        Child(n) => format!("\"-{name}\":{}", n.json()),
        Children(all) => format!("\"-{name}\":[{}]", all.iter().map(Node::json).collect::<Vec<_>>().join(",")),
        Use(kind, def) => format!("\"-{name}\":{{\"{kind}\":{{\"@USE\":\"{def}\"}}}}"),
        Uses(kind, def) => format!("\"-{name}\":[{{\"{kind}\":{{\"@USE\":\"{def}\"}}}}]"),
    }
}

/// The file of a scene in each encoding: name and text.
pub(super) fn files(roots: &[Node]) -> [(&'static str, String); 3] {
    let join = |f: &dyn Fn(&Node) -> String, by: &str| roots.iter().map(f).collect::<Vec<_>>().join(by);
    let classic = format!("#X3D V3.3 utf8\nPROFILE Interchange\n{}\n", join(&Node::classic, "\n"));
    let xml =
        format!("<?xml version='1.0'?>\n<X3D profile='Interchange' version='3.3'><Scene>\n{}</Scene></X3D>\n", join(&|n| n.xml(""), ""));
    let json = format!(
        "{{\"X3D\":{{\"@profile\":\"Interchange\",\"@version\":\"3.3\",\"Scene\":{{\"-children\":[{}]}}}}}}",
        join(&Node::json, ",")
    );
    [("a.x3dv", classic), ("a.x3d", xml), ("a.x3dj", json)]
}

/// Imports a text with these options: the scene and its warnings, or the errors.
pub(super) fn import(name: &str, text: &str, options: &ImportOptions) -> Result<(Scene, Vec<String>), Vec<String>> {
    import_files(&[(name, text.as_bytes())], options)
}

/// Imports the first of some files, which may refer to the others.
pub(super) fn import_files(files: &[(&str, &[u8])], options: &ImportOptions) -> Result<(Scene, Vec<String>), Vec<String>> {
    let parts = files.iter().map(|(name, bytes)| Part { name: (*name).into(), content: Content::Bytes(bytes.to_vec()) }).collect();
    let bundle = Bundle::from_parts(parts, Some(files[0].0), &std::env::temp_dir()).unwrap();
    let shown = |problems: &[crate::records::Problem]| problems.iter().map(ToString::to_string).collect::<Vec<_>>();
    import_bundle(&bundle, options).map(|i| (i.scene, shown(&i.warnings))).map_err(|e| shown(&e))
}

/// The scene in all three encodings, which must come to the same canonical bytes.
pub(super) fn scene_of(roots: &[Node]) -> Scene {
    scene_with(roots, &ImportOptions::default())
}

/// The same, with options.
pub(super) fn scene_with(roots: &[Node], options: &ImportOptions) -> Scene {
    let scenes = files(roots).map(|(name, text)| import(name, &text, options).unwrap_or_else(|e| panic!("{name}: {e:#?}\n{text}")).0);
    let [classic, xml, json] = &scenes;
    assert_eq!((classic == xml, classic == json), (true, true), "the encodings differ: {scenes:#?}");
    classic.clone()
}

/// What each encoding refuses the scene with, without the place in the file; a place must be there.
pub(super) fn refusals(roots: &[Node]) -> [Vec<String>; 3] {
    files(roots).map(|(name, text)| {
        let errors = import(name, &text, &ImportOptions::default()).map(|_| panic!("{name} was imported:\n{text}")).unwrap_err();
        let located = |e: &String| {
            let (place, message) = e.split_once(": ").unwrap();
            assert!(place.starts_with(&format!("{name}:")), "{e} has no line");
            message.split_once(": ").map_or(message, |(column, rest)| if column.starts_with("column") { rest } else { message }).to_owned()
        };
        errors.iter().map(located).collect()
    })
}

/// A shape: a box of 2 m, with what its appearance has beside a material.
pub(super) fn shape(appearance: Vec<(&'static str, Value)>) -> Node {
    let material = ("material", Child(node("Material", [("diffuseColor", One("0.5 0.5 0.5"))])));
    let appearance = node("Appearance", std::iter::once(material).chain(appearance));
    node("Shape", [("appearance", Child(appearance)), ("geometry", Child(node("Box", [])))])
}

/// A PNG of one pixel as a data URI.
pub(super) fn data_uri(pixel: [u8; 4]) -> String {
    let mut png = std::io::Cursor::new(vec![]);
    RgbaImage::from_pixel(1, 1, Rgba(pixel)).write_to(&mut png, ImageFormat::Png).unwrap();
    format!("data:image/png;base64,{}", STANDARD.encode(png.into_inner()))
}
