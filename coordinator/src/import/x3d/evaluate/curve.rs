//! Curves over keys: where a fraction lies among them, and the splines and easings of ISO/IEC 19775-1, 19.2.4 and 19.4.4.

/// Where a fraction lies: in segment `index`, from key `index` to the next, at `t` in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Position {
    pub(super) index: usize,
    pub(super) t: f64,
}

/// The place of `fraction` among `keys`, of which there is at least one. Before the first and behind the last key it is that key; of
/// keys at the same place the last counts.
pub(super) fn position(keys: &[f32], fraction: f32) -> Position {
    let behind = keys.partition_point(|k| *k <= fraction);
    if behind == 0 {
        return Position { index: 0, t: 0.0 };
    }
    let last = keys.len() - 1;
    if behind > last {
        return Position { index: last.saturating_sub(1), t: f64::from(u8::from(last > 0)) };
    }
    let (from, to) = (f64::from(keys[behind - 1]), f64::from(keys[behind]));
    Position { index: behind - 1, t: if to > from { (f64::from(fraction) - from) / (to - from) } else { 0.0 } }
}

/// A spline through `values` at `keys` (as many), `N` numbers each.
#[derive(Debug)]
pub(super) struct Spline<'a, const N: usize> {
    pub(super) keys: &'a [f32],
    pub(super) values: &'a [[f32; N]],
    /// The velocity at each key, or none: then Catmull and Rom's.
    pub(super) velocities: &'a [[f32; N]],
    pub(super) closed: bool,
    pub(super) normalize: bool,
}

impl<const N: usize> Spline<'_, N> {
    /// The value at a place.
    pub(super) fn at(&self, position: Position) -> [f32; N] {
        let Position { index, t } = position;
        let Some(next) = self.values.get(index + 1) else { return self.values[index] };
        let value = |v: &[f32; N], i: usize| f64::from(v[i]);
        let (leaving, arriving) = (self.tangent(index), self.tangent(index + 1));
        let (leaving_factor, arriving_factor) = (self.factors(index).0, self.factors(index + 1).1);
        let (t2, t3) = (t * t, t * t * t);
        std::array::from_fn(|i| {
            let ends = (2.0 * t3 - 3.0 * t2 + 1.0) * value(&self.values[index], i) + (3.0 * t2 - 2.0 * t3) * value(next, i);
            let tangents = (t3 - 2.0 * t2 + t) * leaving_factor * leaving[i] + (t3 - t2) * arriving_factor * arriving[i];
            (ends + tangents) as f32
        })
    }

    fn is_closed(&self) -> bool {
        self.closed && self.velocities.is_empty() && self.values.len() > 2 && self.values.first() == self.values.last()
    }

    /// The keys on both sides; across the seam of a closed curve the last is the first.
    fn neighbours(&self, index: usize) -> Option<(usize, usize)> {
        let last = self.values.len() - 1;
        match index {
            i if i > 0 && i < last => Some((i - 1, i + 1)),
            _ if self.is_closed() => Some((last - 1, 1)),
            _ => None,
        }
    }

    fn tangent(&self, index: usize) -> [f64; N] {
        if let Some(velocity) = self.velocities.get(index) {
            let v = velocity.map(f64::from);
            let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
            return if self.normalize && length > 0.0 { v.map(|c| c * self.way() / length) } else { v };
        }
        let Some((before, after)) = self.neighbours(index) else { return [0.0; N] };
        std::array::from_fn(|i| (f64::from(self.values[after][i]) - f64::from(self.values[before][i])) / 2.0)
    }

    /// The length of the way from value to value.
    fn way(&self) -> f64 {
        let step = |w: &[[f32; N]]| (0..N).map(|i| f64::from(w[1][i]) - f64::from(w[0][i])).map(|d| d * d).sum::<f64>().sqrt();
        self.values.windows(2).map(step).sum()
    }

    /// What the tangent at a key counts in the segment behind it (F+) and in the one before it (F-).
    fn factors(&self, index: usize) -> (f64, f64) {
        if self.neighbours(index).is_none() {
            return (1.0, 1.0);
        }
        let key = |i: usize| f64::from(self.keys[i]);
        let last = self.keys.len() - 1;
        let before = if index > 0 { key(index) - key(index - 1) } else { key(last) - key(last - 1) };
        let after = if index < last { key(index + 1) - key(index) } else { key(1) - key(0) };
        if before + after > 0.0 { (2.0 * before / (before + after), 2.0 * after / (before + after)) } else { (1.0, 1.0) }
    }
}

/// EaseInEaseOut: `t` of a segment that leaves with ease `out` and arrives with ease `arrive`.
pub(super) fn ease(t: f64, out: f64, arrive: f64) -> f64 {
    let sum = out + arrive;
    if sum <= 0.0 {
        return t;
    }
    let (out, arrive) = if sum > 1.0 { (out / sum, arrive / sum) } else { (out, arrive) };
    let speed = 1.0 / (2.0 - out - arrive);
    if t < out {
        speed / out * t * t
    } else if t <= 1.0 - arrive {
        speed * (2.0 * t - out)
    } else {
        1.0 - speed * (1.0 - t) * (1.0 - t) / arrive
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_find_their_segment() {
        let at = |f: f32| position(&[0.0, 0.5, 0.5, 1.0], f);
        assert_eq!(at(-1.0), Position { index: 0, t: 0.0 });
        assert_eq!(at(0.25), Position { index: 0, t: 0.5 });
        assert_eq!(at(0.5), Position { index: 2, t: 0.0 });
        assert_eq!(at(0.75), Position { index: 2, t: 0.5 });
        assert_eq!(at(2.0), Position { index: 2, t: 1.0 });
        assert_eq!(position(&[0.3], 0.9), Position { index: 0, t: 0.0 });
    }

    #[test]
    fn splines_meet_their_keys_and_are_smooth() {
        let keys = [0.0, 0.25, 0.5, 1.0];
        let values = [[0.0, 0.0], [1.0, 2.0], [2.0, 0.0], [0.0, 0.0]];
        for closed in [false, true] {
            let spline = Spline { keys: &keys, values: &values, velocities: &[], closed, normalize: false };
            for (i, value) in values.iter().enumerate() {
                let at = Position { index: i.min(2), t: f64::from(u8::from(i == 3)) };
                assert_eq!(spline.at(at), *value);
            }
        }
        let even = [[0.0], [1.0], [2.0], [3.0]];
        let line = Spline { keys: &[0.0, 1.0, 2.0, 3.0], values: &even, velocities: &[], closed: false, normalize: false };
        assert_eq!(line.at(Position { index: 1, t: 0.5 }), [1.5]);
        let still = Spline { velocities: &[[0.0]; 4], ..line };
        assert_eq!(still.at(Position { index: 0, t: 0.25 }), [0.15625]);
    }

    #[test]
    fn velocities_are_tangents() {
        let spline = Spline { keys: &[0.0, 1.0], values: &[[0.0], [1.0]], velocities: &[[5.0], [5.0]], closed: false, normalize: true };
        // Normalised to the way of length 1, both ends have slope 1: a line.
        assert!((spline.at(Position { index: 0, t: 0.3 })[0] - 0.3).abs() < 1e-6);
    }

    #[test]
    fn easing_is_continuous_and_ends_at_its_ends() {
        assert_eq!(ease(0.3, 0.0, 0.0), 0.3);
        for (out, arrive) in [(0.5, 0.0), (0.2, 0.3), (0.9, 0.9), (0.0, 1.0)] {
            let steps: Vec<f64> = (0..=1000).map(|i| ease(f64::from(i) / 1000.0, out, arrive)).collect();
            assert!(steps[0].abs() < 1e-12 && (steps[1000] - 1.0).abs() < 1e-12);
            assert!(steps.windows(2).all(|w| w[1] >= w[0] && w[1] - w[0] < 0.003), "{out} {arrive}");
        }
    }
}
