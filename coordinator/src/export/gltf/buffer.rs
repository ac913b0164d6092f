//! The one buffer of a file, and the views and accessors into it.

use super::{ExportError, numbers};
use serde_json::{Value, json};

/// Bytes so far with what lies where.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

/// `componentType` of 32-bit numbers.
const FLOAT: u32 = 5126;
/// What a vertex attribute is bound to.
const ARRAY: u32 = 34_962;
/// What indices are bound to.
const ELEMENTS: u32 = 34_963;

impl Buffers {
    /// Adds bytes at a multiple of four; returns the index of their view.
    pub(super) fn view(&mut self, bytes: impl IntoIterator<Item = u8>, target: Option<u32>) -> Result<usize, ExportError> {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        if u32::try_from(self.bytes.len()).is_err() {
            return Err(ExportError::TooLarge { bytes: self.bytes.len() as u64 });
        }
        let mut view = json!({"buffer": 0, "byteOffset": start, "byteLength": length});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.views.push(view);
        Ok(self.views.len() - 1)
    }

    /// Adds a vertex attribute of N numbers; returns the index of its accessor. Positions need their bounds (glTF 2.0, 3.7.2.1).
    pub(super) fn attribute<const N: usize>(&mut self, values: &[[f32; N]], bounded: bool) -> Result<usize, ExportError> {
        let view = self.view(values.iter().flatten().flat_map(|v| v.to_le_bytes()), Some(ARRAY))?;
        let kind = if N == 4 {
            "VEC4"
        } else if N == 3 {
            "VEC3"
        } else {
            "VEC2"
        };
        let mut accessor = json!({"bufferView": view, "componentType": FLOAT, "count": values.len(), "type": kind});
        if bounded {
            let fold = |start: f32, pick: fn(f32, f32) -> f32| {
                values.iter().fold([start; N], |bound, v| std::array::from_fn(|i| pick(bound[i], v[i])))
            };
            accessor["min"] = numbers(&fold(f32::INFINITY, f32::min));
            accessor["max"] = numbers(&fold(f32::NEG_INFINITY, f32::max));
        }
        self.accessors.push(accessor);
        Ok(self.accessors.len() - 1)
    }

    /// Adds indices of `vertices` vertices in the fewest bytes that never hold a primitive restart value; returns their accessor.
    pub(super) fn indices(&mut self, indices: &[u32], vertices: usize) -> Result<usize, ExportError> {
        let short = vertices < usize::from(u16::MAX);
        let view = if short {
            self.view(indices.iter().flat_map(|i| (*i as u16).to_le_bytes()), Some(ELEMENTS))?
        } else {
            self.view(indices.iter().flat_map(|i| i.to_le_bytes()), Some(ELEMENTS))?
        };
        let component = if short { 5123 } else { 5125 };
        self.accessors.push(json!({"bufferView": view, "componentType": component, "count": indices.len(), "type": "SCALAR"}));
        Ok(self.accessors.len() - 1)
    }

    /// The bytes, the views and the accessors.
    pub(super) fn into_parts(self) -> (Vec<u8>, Vec<Value>, Vec<Value>) {
        (self.bytes, self.views, self.accessors)
    }
}
