//! What the accessors of a file may be made of where they are used: kinds of elements and of components (glTF 2.0, sections 3.7.2.1, 3.7.3
//! and 3.11, and KHR_mesh_quantization).

use super::{
    accessor::{Accessor, Accessors},
    element::Component,
    json::Json,
    report::Report,
};

/// What a use of an accessor allows.
pub(super) struct Form {
    kinds: &'static [&'static str],
    components: &'static [Component],
    /// Whether integers must be normalized.
    normalized: bool,
}

const INTEGERS_AND_FLOATS: &[Component] = &[Component::F32, Component::I8, Component::U8, Component::I16, Component::U16];
/// Positions, normals and texture coordinates may be integers by KHR_mesh_quantization.
pub(super) const VECTOR: Form = Form { kinds: &["VEC3"], components: INTEGERS_AND_FLOATS, normalized: false };
/// Texture coordinates.
pub(super) const COORDINATES: Form = Form { kinds: &["VEC2"], components: INTEGERS_AND_FLOATS, normalized: false };
/// Tangents with the side of the bitangent.
pub(super) const TANGENT: Form = Form { kinds: &["VEC4"], components: &[Component::F32, Component::I8, Component::I16], normalized: true };
/// Vertex colours.
pub(super) const COLOR: Form =
    Form { kinds: &["VEC3", "VEC4"], components: &[Component::F32, Component::U8, Component::U16], normalized: true };
/// Four joints.
pub(super) const JOINTS: Form = Form { kinds: &["VEC4"], components: &[Component::U8, Component::U16], normalized: false };
/// Their weights.
pub(super) const WEIGHTS: Form = Form { kinds: &["VEC4"], components: &[Component::F32, Component::U8, Component::U16], normalized: true };
/// Moves and sizes: of nodes, animated, and of instances.
pub(super) const PLACE: Form = Form { kinds: &["VEC3"], components: &[Component::F32], normalized: false };
/// Turns of instances.
pub(super) const TURN: Form = Form { kinds: &["VEC4"], components: &[Component::F32, Component::I8, Component::I16], normalized: true };
/// Animated turns.
pub(super) const ANIMATED_TURN: Form = Form { kinds: &["VEC4"], components: INTEGERS_AND_FLOATS, normalized: true };
/// Animated weights of morph targets.
pub(super) const ANIMATED_WEIGHT: Form = Form { kinds: &["SCALAR"], components: INTEGERS_AND_FLOATS, normalized: true };
/// Times of key frames.
pub(super) const TIME: Form = Form { kinds: &["SCALAR"], components: &[Component::F32], normalized: false };
/// Matrices that take a mesh to its joints.
pub(super) const BIND: Form = Form { kinds: &["MAT4"], components: &[Component::F32], normalized: false };
/// Indices of vertices.
pub(super) const INDICES: Form =
    Form { kinds: &["SCALAR"], components: &[Component::U8, Component::U16, Component::U32], normalized: false };

impl Form {
    /// Whether an accessor that the value `at` names is of this form.
    pub(super) fn allows(&self, found: &Accessor<'_>, at: Json<'_>, report: &mut Report<'_>) -> bool {
        if !self.kinds.contains(&found.kind()) {
            report.error(at, format!("an accessor of type {} is expected here, not {}", self.kinds.join(" or "), found.kind()));
            return false;
        }
        if !self.components.contains(&found.component) {
            let allowed: Vec<String> = self.components.iter().map(|c| c.code().to_string()).collect();
            let allowed = allowed.join(" or ");
            report.error(at, format!("the component type {} is not allowed here; it must be {allowed}", found.component.code()));
            return false;
        }
        if self.normalized && found.component != Component::F32 && !found.normalized {
            report.error(at, "integers must be `normalized` here");
            return false;
        }
        true
    }
}

/// The accessor that a value names, if it is of the form that is wanted there and has as many elements as there are vertices, where it is
/// known how many there are.
pub(super) fn of_form<'s, 'd>(
    at: Json<'_>,
    form: &Form,
    vertices: Option<usize>,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Option<&'s Accessor<'d>> {
    let found = accessors.at(at, report).filter(|found| form.allows(found, at, report))?;
    if let Some(count) = vertices.filter(|count| *count != found.count) {
        report.error(at, format!("the accessor has {} elements, but the primitive has {count} vertices", found.count));
        return None;
    }
    Some(found)
}
