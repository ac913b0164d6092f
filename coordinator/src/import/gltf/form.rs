//! What the attributes of a mesh may be made of: kinds of elements and of components (glTF 2.0, section 3.7.2.1, and KHR_mesh_quantization).

use super::{
    accessor::{Accessor, Accessors},
    element::Component,
    json::Json,
    report::Report,
};

/// What an attribute may be made of.
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
/// Indices of vertices.
pub(super) const INDICES: Form =
    Form { kinds: &["SCALAR"], components: &[Component::U8, Component::U16, Component::U32], normalized: false };

/// The accessor that an attribute names, if it is of the form that the attribute wants.
pub(super) fn of_form<'s, 'd>(
    at: Json<'_>,
    form: &Form,
    count: Option<usize>,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Option<&'s Accessor<'d>> {
    let found = accessors.at(at, report)?;
    if !form.kinds.contains(&found.kind()) {
        report.error(at, format!("an accessor of type {} is expected here, not {}", form.kinds.join(" or "), found.kind()));
        return None;
    }
    if !form.components.contains(&found.component) {
        report.error(at, format!("the component type {} is not allowed here", found.component.code()));
        return None;
    }
    if form.normalized && found.component != Component::F32 && !found.normalized {
        report.error(at, "integers must be `normalized` here");
        return None;
    }
    if let Some(count) = count.filter(|count| *count != found.count) {
        report.error(at, format!("the accessor has {} elements, but the primitive has {count} vertices", found.count));
        return None;
    }
    Some(found)
}
