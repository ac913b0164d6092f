//! Lights and viewpoints as cameras: near, far and the rectangle, checked alike for both, in the world's lengths (Kamburelis 4.1 and 4.5).
//!
//! The file's numbers count in the lengths of the node's own group. What is left to be found is found in the world.

use crate::import::{findings::Findings, x3d::NodeRef};

/// `projectionNear` and `projectionFar` of a node in a group that scales by so much, with `None` for what is automatic; nothing where they
/// make no depth, which is then an error.
pub(super) fn depths(node: NodeRef<'_>, scale: f32, findings: &mut Findings) -> Option<[Option<f32>; 2]> {
    let fields = ["projectionNear", "projectionFar"];
    let values = fields.map(|field| node.float(field));
    let scaled = values.map(|value| value * scale);
    for ((field, value), scaled) in fields.into_iter().zip(values).zip(scaled) {
        // An end that gives way lies at twice the other.
        if !(value >= 0.0 && (2.0 * scaled).is_finite()) {
            let message =
                format!("{} has the {field} {value}; it is a finite length in the world and not negative (0: automatic)", node.kind());
            findings.error(node.at_field(field), message);
            return None;
        }
    }
    let [near, far] = values;
    if near > 0.0 && far > 0.0 && near >= far {
        let message = format!("{} has projectionNear {near}, which is not below projectionFar {far}", node.kind());
        findings.error(node.at_field("projectionNear"), message);
        return None;
    }
    Some([0, 1].map(|end| (values[end] > 0.0).then_some(scaled[end])))
}

/// A rectangle (left, bottom, right, top) in a field of a node in a group that scales by so much; `None` where it has no size or is inside
/// out, which is then an error.
pub(super) fn rectangle(node: NodeRef<'_>, field: &str, given: [f32; 4], scale: f32, findings: &mut Findings) -> Option<[f32; 4]> {
    let scaled @ [left, bottom, right, top] = given.map(|v| v * scale);
    if left < right && bottom < top && scaled.iter().all(|v| v.is_finite()) {
        return Some(scaled);
    }
    let [left, bottom, right, top] = given;
    let message = format!(
        "{} has the {field} {left} {bottom} {right} {top}; it is left bottom right top with left < right and bottom < top, all finite in the \
         world",
        node.kind()
    );
    findings.error(node.at_field(field), message);
    None
}

/// Near and far, with what was found in the place of what is automatic. Where near is given beyond the far end that was found, far is put
/// behind it, and `warn` is told so of `who`.
pub(super) fn ends([near, far]: [Option<f32>; 2], found: (f64, f64), who: &str, warn: impl FnOnce(String)) -> [f32; 2] {
    let far = far.unwrap_or(found.1 as f32);
    let near = near.unwrap_or((found.0 as f32).min(far / 2.0));
    if near < far {
        return [near, far];
    }
    let behind = 2.0 * near;
    warn(format!("{who} is given projectionNear {near} beyond {far}, the far end that was found for it; {behind} is used as the far end"));
    [near, behind]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_stays_and_what_is_found_gives_way() {
        let of = |given| {
            let mut said = None;
            (ends(given, (1.0, 8.0), "it", |message| said = Some(message)), said.is_some())
        };
        assert_eq!(of([None, None]), ([1.0, 8.0], false));
        assert_eq!(of([Some(0.5), Some(4.0)]), ([0.5, 4.0], false));
        assert_eq!(of([None, Some(1.0)]), ([0.5, 1.0], false), "near gives way to a far end that is given");
        assert_eq!(of([Some(9.0), None]), ([9.0, 18.0], true));
    }
}
