//! glTF 2.0 out of a canonical scene: the way back of the importer, for programs that read neither OBJ nor X3D.
//!
//! A surface is a node with a mesh, a part of it a primitive. A surface and its back, which the scene holds as two, are one mesh with a
//! double-sided material again, unless the two are made of different materials. What glTF cannot say is approximated or left out, and
//! counted in the warnings; light fields and baked light are not part of this (the package of a job has a GLB of its own).
//!
//! The JSON is built as a tree of values with sorted keys, numbers in their shortest form that reads back to the same 32 bits: the same
//! scene gives the same bytes. Typed structures of the crate `gltf-json` would catch a misspelled key, and know none of the extensions
//! beyond a few; a test through the importer, which is as strict as the Khronos validator, catches both. Memory: the file, once more while
//! it is put together.

mod buffer;
mod layer;
mod light;
mod material;
mod mesh;
mod notes;
#[cfg(test)]
mod tests;
mod texture;

use crate::{import::uri, records::Problem};
use buffer::Buffers;
use kiln_proto::scene::Scene;
use material::Materials;
use notes::Notes;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// Bytes of the header of a binary glTF and of the headers of its two chunks.
const GLB_HEADERS: u64 = 12 + 8 + 8;

/// A scene as glTF, not yet in a file.
#[derive(Debug)]
pub struct Exported {
    root: Map<String, Value>,
    binary: Vec<u8>,
    /// What was left out or approximated.
    pub warnings: Vec<Problem>,
}

/// Why a scene is not written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The lengths in the format have 32 bits.
    #[error("the scene comes to {bytes} bytes of geometry and images; a glTF file holds at most {} here", u32::MAX)]
    TooLarge {
        /// What it comes to.
        bytes: u64,
    },
    /// An image that cannot be coded.
    #[error("the texture `{name}` cannot be written as PNG")]
    Image {
        /// Its name.
        name: String,
        /// The encoder's words.
        #[source]
        source: image::ImageError,
    },
    /// A number that JSON has no words for.
    #[error("the JSON cannot be written")]
    Json(#[from] serde_json::Error),
}

/// Everything that is being written.
struct Writer<'s> {
    scene: &'s Scene,
    buffers: Buffers,
    notes: Notes,
    /// Extensions used so far.
    extensions: BTreeSet<&'static str>,
    nodes: Vec<Value>,
}

/// Writes a valid scene as glTF.
///
/// # Errors
/// A scene that does not fit into the lengths of the format; an image that cannot be coded.
pub fn export(scene: &Scene) -> Result<Exported, ExportError> {
    let mut writer = Writer { scene, buffers: Buffers::default(), notes: Notes::default(), extensions: BTreeSet::new(), nodes: vec![] };
    let mut materials = Materials::new(scene);
    let meshes = writer.meshes(&mut materials)?;
    let lights = writer.lights();
    let cameras = writer.cameras();
    if let Some(environment) = &scene.environment {
        writer.notes.count("environments, which glTF has no place for, were left out", &environment.name);
    }
    let [materials, textures, images, samplers] = materials.into_lists();
    let Writer { buffers, notes, extensions, nodes, .. } = writer;
    let (binary, views, accessors) = buffers.into_parts();
    let roots: Vec<usize> = (0..nodes.len()).collect();
    let mut root = Map::new();
    let generator = concat!("Kiln ", env!("CARGO_PKG_VERSION"));
    root.insert("asset".into(), json!({"version": "2.0", "generator": generator}));
    root.insert("scene".into(), json!(0));
    root.insert("scenes".into(), json!([{"nodes": roots}]));
    root.insert("buffers".into(), json!([{"byteLength": binary.len()}]));
    let lists = [
        ("nodes", nodes),
        ("meshes", meshes),
        ("materials", materials),
        ("textures", textures),
        ("images", images),
        ("samplers", samplers),
        ("cameras", cameras),
        ("accessors", accessors),
        ("bufferViews", views),
        ("extensionsUsed", extensions.into_iter().map(Value::from).collect()),
    ];
    // An empty list is an error in glTF; an absent one is none.
    root.extend(lists.into_iter().filter(|(_, list)| !list.is_empty()).map(|(name, list)| (name.to_owned(), Value::from(list))));
    if !lights.is_empty() {
        root.insert("extensions".into(), json!({"KHR_lights_punctual": {"lights": lights}}));
    }
    Ok(Exported { root, binary, warnings: notes.into_warnings() })
}

impl Exported {
    /// One binary file (glTF 2.0, section 4).
    ///
    /// # Errors
    /// More bytes than the lengths in the file can say.
    pub fn glb(&self) -> Result<Vec<u8>, ExportError> {
        let mut text = serde_json::to_vec(&self.root)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = GLB_HEADERS + text.len() as u64 + self.binary.len() as u64;
        let length = u32::try_from(total).map_err(|_| ExportError::TooLarge { bytes: total })?;
        let mut file = Vec::with_capacity(length as usize);
        file.extend_from_slice(b"glTF");
        file.extend([2, length, text.len() as u32].iter().flat_map(|v| v.to_le_bytes()));
        file.extend_from_slice(b"JSON");
        file.append(&mut text);
        file.extend_from_slice(&(self.binary.len() as u32).to_le_bytes());
        file.extend_from_slice(b"BIN\0");
        file.extend_from_slice(&self.binary);
        Ok(file)
    }

    /// A text, and the bytes of the file beside it that is to be called `binary_name`.
    ///
    /// # Errors
    /// None that a scene can cause.
    pub fn gltf(mut self, binary_name: &str) -> Result<(Vec<u8>, Vec<u8>), ExportError> {
        self.root.insert("buffers".into(), json!([{"byteLength": self.binary.len(), "uri": uri::encoded(binary_name)}]));
        let mut text = serde_json::to_vec_pretty(&self.root)?;
        text.push(b'\n');
        Ok((text, self.binary))
    }
}

/// A number in JSON whose shortest decimal form reads back to the same 32 bits, and to 0.1 rather than 0.10000000149011612.
fn number(value: f32) -> Value {
    let value = value + 0.0;
    let exact = value.to_string().parse::<f64>().unwrap_or_else(|_| f64::from(value));
    if exact.fract() == 0.0 && exact.abs() < 1e9 { Value::from(exact as i64) } else { Value::from(exact) }
}

/// A list of such numbers.
fn numbers(values: &[f32]) -> Value {
    values.iter().map(|v| number(*v)).collect()
}

/// The least power of two that is at least `largest`, and at least one: what is divided by it comes back exactly when it is multiplied
/// again.
fn scaled(largest: f32) -> f32 {
    let mut strength = 1.0f32;
    while strength < largest && strength < f32::MAX / 2.0 {
        strength *= 2.0;
    }
    strength
}
