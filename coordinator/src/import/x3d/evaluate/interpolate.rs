//! Interpolators and sequencers (ISO/IEC 19775-1, 19.4 and 30.4) at a fraction.

use super::{
    curve::{Position, Spline, ease, position},
    rotation::{from_axis_angle, squad, to_axis_angle},
};
use crate::import::{
    findings::Findings,
    slerp::{normalized, shortest, slerp},
    x3d::{NodeRef, value::Value},
};

/// What a node sends at a fraction; nothing where it is no interpolator or has no keys.
pub(super) fn events(node: NodeRef<'_>, fraction: f32, findings: &mut Findings) -> Option<Vec<(&'static str, Value)>> {
    let keys = node.mf_float("key");
    let value = match node.kind() {
        "EaseInEaseOut" => {
            let eases = node.mf_vec2("easeInEaseOut");
            let count = complete(node, keys.len(), eases.len(), findings)?;
            let at = position(&keys[..count], fraction);
            let arrive = eases[(at.index + 1).min(count - 1)][0];
            return Some(vec![("modifiedFraction_changed", float([ease(at.t, f64::from(eases[at.index][1]), f64::from(arrive)) as f32]))]);
        }
        "BooleanSequencer" | "IntegerSequencer" => {
            let values = node.mf_int("keyValue");
            let count = complete(node, keys.len(), values.len(), findings)?;
            let behind = keys[..count].partition_point(|k| *k <= fraction);
            Value::Ints([values[behind.saturating_sub(1)]].into())
        }
        "ColorInterpolator" => tuple(node, &keys, fraction, findings, |a, b, t| hsv_mix(a, b, t as f32))?,
        "OrientationInterpolator" => {
            tuple(node, &keys, fraction, findings, |a: [f32; 4], b, t| to_axis_angle(shortest(from_axis_angle(a), from_axis_angle(b), t)))?
        }
        "SquadOrientationInterpolator" => squad_orientation(node, &keys, fraction, findings)?,
        "PositionInterpolator" => tuple(node, &keys, fraction, findings, mix::<3>)?,
        "PositionInterpolator2D" => tuple(node, &keys, fraction, findings, mix::<2>)?,
        "ScalarInterpolator" => tuple(node, &keys, fraction, findings, mix::<1>)?,
        "CoordinateInterpolator" => list(node, &keys, fraction, findings, mix::<3>)?,
        "CoordinateInterpolator2D" => list(node, &keys, fraction, findings, mix::<2>)?,
        "VectorInterpolator" => list(node, &keys, fraction, findings, mix::<1>)?,
        "ColorSetInterpolator" => list(node, &keys, fraction, findings, |a, b, t| hsv_mix(a, b, t as f32))?,
        "NormalInterpolator" => list(node, &keys, fraction, findings, |a: [f32; 3], b: [f32; 3], t| {
            slerp(normalized(a.map(f64::from)), normalized(b.map(f64::from)), t).map(|c| c as f32)
        })?,
        "SplinePositionInterpolator" => spline::<3>(node, &keys, fraction, findings)?,
        "SplinePositionInterpolator2D" => spline::<2>(node, &keys, fraction, findings)?,
        "SplineScalarInterpolator" => spline::<1>(node, &keys, fraction, findings)?,
        _ => return None,
    };
    Some(vec![("value_changed", value)])
}

fn float<const N: usize>(numbers: [f32; N]) -> Value {
    Value::Floats(numbers.into())
}

/// The keys that have values: those of both lists, with a warning where one is longer. `None` where there are none.
fn complete(node: NodeRef<'_>, keys: usize, values: usize, findings: &mut Findings) -> Option<usize> {
    if keys != values {
        let message = format!("`{}` has {keys} keys and {values} values; the shorter list counts", node.kind());
        findings.warn(node.at(), message);
    }
    Some(keys.min(values)).filter(|count| *count > 0)
}

fn mix<const N: usize>(a: [f32; N], b: [f32; N], t: f64) -> [f32; N] {
    std::array::from_fn(|i| (f64::from(a[i]) + (f64::from(b[i]) - f64::from(a[i])) * t) as f32)
}

/// Interpolates one value a key.
fn tuple<const N: usize>(
    node: NodeRef<'_>,
    keys: &[f32],
    fraction: f32,
    findings: &mut Findings,
    between: impl Fn([f32; N], [f32; N], f64) -> [f32; N],
) -> Option<Value> {
    let values = node.tuples::<N>("keyValue");
    let count = complete(node, keys.len(), values.len(), findings)?;
    let at = position(&keys[..count], fraction);
    Some(float(at_position(&values, count, at, between)))
}

fn at_position<const N: usize>(
    values: &[[f32; N]],
    count: usize,
    at: Position,
    between: impl Fn([f32; N], [f32; N], f64) -> [f32; N],
) -> [f32; N] {
    let (from, to) = (values[at.index], values[(at.index + 1).min(count - 1)]);
    // At a key its value is sent as it is written.
    if at.t == 0.0 {
        from
    } else if at.t == 1.0 {
        to
    } else {
        between(from, to, at.t)
    }
}

/// Interpolates as many values a key as there are.
fn list<const N: usize>(
    node: NodeRef<'_>,
    keys: &[f32],
    fraction: f32,
    findings: &mut Findings,
    between: impl Fn([f32; N], [f32; N], f64) -> [f32; N],
) -> Option<Value> {
    let values = node.tuples::<N>("keyValue");
    if keys.is_empty() || values.is_empty() {
        return None;
    }
    let each = values.len() / keys.len();
    if each * keys.len() != values.len() {
        let message =
            format!("`{}` has {} values for {} keys, which is no multiple; the last were dropped", node.kind(), values.len(), keys.len());
        findings.warn(node.at(), message);
    }
    let at = position(keys, fraction);
    let row = |key: usize| &values[key * each..(key + 1) * each];
    let (from, to) = (row(at.index), row((at.index + 1).min(keys.len() - 1)));
    let numbers = from.iter().zip(to).flat_map(|(a, b)| at_position(&[*a, *b], 2, Position { index: 0, t: at.t }, &between));
    Some(Value::Floats(numbers.collect()))
}

fn spline<const N: usize>(node: NodeRef<'_>, keys: &[f32], fraction: f32, findings: &mut Findings) -> Option<Value> {
    let values = node.tuples::<N>("keyValue");
    let count = complete(node, keys.len(), values.len(), findings)?;
    let velocities = node.tuples::<N>("keyVelocity");
    let given = if velocities.len() == count {
        &velocities[..]
    } else {
        if !velocities.is_empty() {
            findings.warn(node.at_field("keyVelocity"), format!("{} velocities for {count} keys; they were skipped", velocities.len()));
        }
        &[]
    };
    let spline = Spline {
        keys: &keys[..count],
        values: &values[..count],
        velocities: given,
        closed: node.bool("closed"),
        normalize: node.bool("normalizeVelocity"),
    };
    Some(float(spline.at(position(&keys[..count], fraction))))
}

fn squad_orientation(node: NodeRef<'_>, keys: &[f32], fraction: f32, findings: &mut Findings) -> Option<Value> {
    let values = node.mf_vec4("keyValue");
    let count = complete(node, keys.len(), values.len(), findings)?;
    let at = position(&keys[..count], fraction);
    let neighbours = [at.index.saturating_sub(1), at.index, at.index + 1, at.index + 2];
    let q = neighbours.map(|i| from_axis_angle(values[i.min(count - 1)]));
    Some(float(to_axis_angle(squad(q, at.t))))
}

/// Between two colours in hue, saturation and value, the short way round the hues (ISO/IEC 19775-1, 19.4.1).
fn hsv_mix(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    let ([mut h0, s0, v0], [mut h1, s1, v1]) = (to_hsv(a), to_hsv(b));
    // Grey has no hue and takes the other's.
    if s0 == 0.0 {
        h0 = h1;
    }
    if s1 == 0.0 {
        h1 = h0;
    }
    let way = h1 - h0;
    let way = if way > 3.0 {
        way - 6.0
    } else if way < -3.0 {
        way + 6.0
    } else {
        way
    };
    let hue = h0 + way * t;
    from_hsv([if hue < 0.0 { hue + 6.0 } else { hue }, s0 + (s1 - s0) * t, v0 + (v1 - v0) * t])
}

/// Hue in [0, 6), saturation and value.
fn to_hsv([r, g, b]: [f32; 3]) -> [f32; 3] {
    let (high, low) = (r.max(g).max(b), r.min(g).min(b));
    let range = high - low;
    if range <= 0.0 || high <= 0.0 {
        return [0.0, 0.0, high];
    }
    let hue = if high == r {
        (g - b) / range
    } else if high == g {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    [if hue < 0.0 { hue + 6.0 } else { hue }, range / high, high]
}

fn from_hsv([h, s, v]: [f32; 3]) -> [f32; 3] {
    // The channel peaks at its hue and is at its lowest from two sixths on.
    let channel = |n: f32| {
        let k = (n + h) % 6.0;
        v - v * s * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_turn_the_short_way() {
        let close = |a: [f32; 3], b: [f32; 3]| assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} is not {b:?}");
        for colour in [[0.2, 0.4, 0.6], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.3, 0.3, 0.3], [0.9, 0.1, 0.8]] {
            close(from_hsv(to_hsv(colour)), colour);
        }
        close(hsv_mix([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5), [1.0, 1.0, 0.0]);
        close(hsv_mix([1.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.5), [1.0, 0.0, 1.0]);
        close(hsv_mix([1.0, 0.0, 1.0], [1.0, 0.0, 0.0], 0.5), [1.0, 0.0, 0.5]);
        close(hsv_mix([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5), [0.25, 0.5, 0.25]);
    }
}
