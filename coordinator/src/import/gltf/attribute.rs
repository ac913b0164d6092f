//! The attributes of primitives: which accessors may stand for what (glTF 2.0, section 3.7.2.1).

use super::{
    accessor::{Accessor, Accessors},
    element::Component,
    json::Json,
    report::Report,
};

/// Sets of joints and weights that are read: 32 joints a vertex.
const INFLUENCES: usize = 8;

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
/// Colours of vertices.
pub(super) const COLOR: Form =
    Form { kinds: &["VEC3", "VEC4"], components: &[Component::F32, Component::U8, Component::U16], normalized: true };
const JOINTS: Form = Form { kinds: &["VEC4"], components: &[Component::U8, Component::U16], normalized: false };
const WEIGHTS: Form = Form { kinds: &["VEC4"], components: &[Component::F32, Component::U8, Component::U16], normalized: true };
/// The vertices of triangles.
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

/// The joints of vertices and their weights, four at a time.
pub(super) fn influences<'s, 'd>(
    attributes: Json<'d>,
    vertices: usize,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Vec<(&'s Accessor<'d>, &'s Accessor<'d>)> {
    let mut found = vec![];
    for set in 0..=INFLUENCES {
        let (joints, weights) = (attributes.get(&format!("JOINTS_{set}")), attributes.get(&format!("WEIGHTS_{set}")));
        match (joints, weights) {
            (None, None) => break,
            (Some(at), _) | (_, Some(at)) if set == INFLUENCES => {
                report.count(at, "sets of joints and weights beyond the eighth were ignored");
            }
            (Some(joints), Some(weights)) => {
                let joints = of_form(joints, &JOINTS, Some(vertices), accessors, report);
                found.extend(joints.zip(of_form(weights, &WEIGHTS, Some(vertices), accessors, report)));
            }
            (Some(at), None) | (None, Some(at)) => {
                report.error(at, format!("JOINTS_{set} and WEIGHTS_{set} come together or not at all"));
                break;
            }
        }
    }
    found
}

/// Morph targets: displacements of positions and normals.
pub(super) fn targets<'s, 'd>(
    json: Json<'d>,
    vertices: usize,
    accessors: &'s Accessors<'d, '_>,
    report: &mut Report<'_>,
) -> Option<Vec<[Option<&'s Accessor<'d>>; 2]>> {
    let mut found = vec![];
    for target in report.objects(json, "targets") {
        let read = |name: &str, report: &mut Report<'_>| match target.get(name) {
            Some(at) => of_form(at, &VECTOR, Some(vertices), accessors, report).map(Some),
            None => Some(None),
        };
        found.push([read("POSITION", report)?, read("NORMAL", report)?]);
        if target.members().any(|(name, _)| name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) {
            report.count(target, "morph targets of texture coordinates or colours were ignored, only shape is morphed");
        }
    }
    Some(found)
}
