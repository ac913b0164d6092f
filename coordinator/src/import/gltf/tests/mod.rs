//! Small files made in memory, one for each rule and each fault.

mod animation;
mod bounds;
mod containers;
mod faults;
mod geometry;
mod hostile;
mod lights;
mod materials;
mod pictures;
mod references;
mod tangents;

use super::import;
use crate::import::{Bundle, Content, Part, findings::Findings, images::Images};
use base64::{Engine, prelude::BASE64_STANDARD};
use kiln_proto::scene::{Material, MetallicRoughness, Reflection, Scene};
use serde_json::{Value, json};

/// A file in the making: its JSON, and the bytes of its one buffer.
struct Sample {
    json: Value,
    bytes: Vec<u8>,
}

/// What became of it: the scene, and what was said.
struct Outcome {
    scene: Option<Scene>,
    errors: Vec<String>,
    warnings: Vec<String>,
}

impl Sample {
    fn new() -> Self {
        Self { json: json!({ "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [] }] }), bytes: vec![] }
    }

    /// One triangle in the plane z = 0 that one node shows.
    fn triangle() -> Self {
        let mut sample = Self::new();
        let positions = sample.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        sample.json["accessors"][positions]["min"] = json!([0, 0, 0]);
        sample.json["accessors"][positions]["max"] = json!([1, 1, 0]);
        sample.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions } }] }));
        sample.show(json!({ "mesh": 0, "name": "leaf" }));
        sample
    }

    /// The same with texture coordinates, a material, and a 2 x 2 image whose left half is red and opaque, its right half clear.
    fn textured(material: Value) -> Self {
        let mut sample = Self::triangle();
        let uv = sample.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        sample.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
        sample.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        sample.push("materials", material);
        sample.push("images", json!({ "uri": format!("data:image/png;base64,{}", BASE64_STANDARD.encode(image())) }));
        sample.push("textures", json!({ "source": 0 }));
        sample
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json[list].is_null() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a root node to the scene.
    fn show(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = [("SCALAR", 1), ("VEC2", 2), ("VEC3", 3), ("VEC4", 4), ("MAT4", 16)].iter().find(|(k, _)| *k == kind).unwrap().1;
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(5126, kind, &bytes, values.len() / width)
    }

    fn accessor(&mut self, component: u32, kind: &str, bytes: &[u8], count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }))
    }

    /// The text with the buffer as a data URI.
    fn text(&self) -> String {
        let mut json = self.json.clone();
        if !self.bytes.is_empty() && json["buffers"].is_null() {
            let uri = format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&self.bytes));
            json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        }
        serde_json::to_string_pretty(&json).unwrap()
    }

    fn import(&self) -> Outcome {
        self.import_at(None)
    }

    fn import_at(&self, time: Option<f64>) -> Outcome {
        outcome(&[("a.gltf", self.text().as_bytes())], time)
    }

    /// The scene, which must be valid.
    fn scene(&self) -> Scene {
        self.import().scene()
    }

    /// The only error.
    fn error(&self) -> String {
        let errors = self.import().errors;
        assert_eq!(errors.len(), 1, "{errors:#?}");
        errors[0].clone()
    }
}

impl Outcome {
    fn scene(self) -> Scene {
        let scene = self.scene.unwrap_or_else(|| panic!("{:#?}", self.errors));
        scene.validate().unwrap();
        scene
    }

    fn warns(&self, words: &str) -> bool {
        self.warnings.iter().any(|w| w.contains(words))
    }
}

/// Imports the first of these files.
fn outcome(files: &[(&str, &[u8])], time: Option<f64>) -> Outcome {
    let parts = files.iter().map(|(name, bytes)| Part { name: (*name).into(), content: Content::Bytes(bytes.to_vec()) }).collect();
    let bundle = Bundle::from_parts(parts, Some(files[0].0), &std::env::temp_dir()).unwrap();
    let (mut findings, mut images) = (Findings::default(), Images::default());
    let scene = import(&bundle, bundle.main(), files[0].1, time, &mut images, &mut findings);
    let scene = scene.map(|scene| Scene { textures: images.textures, ..scene });
    let failed = findings.has_errors();
    assert_eq!(scene.is_none(), failed);
    let (errors, warnings) = if failed { (findings.into_errors("a.gltf"), vec![]) } else { (vec![], findings.into_warnings()) };
    let shown = |problems: Vec<crate::records::Problem>| problems.iter().map(ToString::to_string).collect();
    Outcome { scene, errors: shown(errors), warnings: shown(warnings) }
}

/// A PNG: red and opaque on the left, green and clear on the right.
fn image() -> Vec<u8> {
    let image = image::RgbaImage::from_fn(2, 2, |x, _| image::Rgba(if x == 0 { [255, 0, 0, 255] } else { [0, 255, 0, 0] }));
    let mut out = std::io::Cursor::new(vec![]);
    image.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

fn pbr(material: &Material) -> &MetallicRoughness {
    match &material.reflection {
        Reflection::MetallicRoughness(pbr) => pbr,
        other => panic!("{other:?}"),
    }
}

/// The world positions of a triangle's corners.
fn corners(scene: &Scene, surface: usize, triangle: usize) -> [[f32; 3]; 3] {
    scene.surfaces[surface].triangles[triangle].corners.map(|c| scene.positions[c as usize])
}
