//! Ear clipping (Meisters 1975) in the plane, for polygons that are not convex.
//!
//! A corner is tested again only when one beside it was clipped, and only against the reflex corners that a tree over them finds in the
//! ear, so that an outline of n corners costs about n log n. [`WORK`] bounds it where corners are heaped on one place to no end.
//! Monotone partition would cost n log n always and five hundred lines for faces that have seldom more than ten corners; the `earcut`
//! crate drops corners on straight edges, and with them the seal between neighbouring polygons.

use super::polygon::{Cut, fan, turn};
use glam::DVec2;
use std::collections::VecDeque;

/// A right turn whose doubled area is below this share of the squared extent is rounding of a straight line.
const STRAIGHT: f64 = 1e-7;
/// Corners compared, per corner of a polygon; after that the rest becomes a fan.
const WORK: usize = 2_048;
/// Times that all corners are looked through again when no ear is left, which mostly happens to polygons that cross themselves.
const PASSES: u32 = 8;
/// Points below which the tree does not divide further.
const LEAF: usize = 8;

/// Which corners go.
#[derive(Debug, Clone, Copy)]
enum Clip {
    /// Repeated corners and those between two visits of one place: first, because no ear test sees which side of a spike is inside.
    Spikes,
    /// Proper ears.
    Ears,
    /// Ears, and corners on a straight line: their triangles have no area and do no harm, but ears are worth more while there are any.
    StraightToo,
}

/// Cuts a polygon of more than three corners, counter-clockwise.
pub(super) fn clip(flat: &[DVec2]) -> Cut {
    let mut clipper = Clipper::new(flat);
    let mut triangles = Vec::with_capacity(flat.len() - 2);
    clipper.clip(Clip::Spikes, &mut triangles);
    clipper.find_reflex();
    clipper.clip(Clip::Ears, &mut triangles);
    for _ in 0..PASSES {
        let before = clipper.left;
        clipper.clip(Clip::StraightToo, &mut triangles);
        if clipper.left <= 3 || clipper.left == before {
            break;
        }
    }
    let rest = fan(&clipper.ring());
    let sound = rest.iter().all(|[a, b, c]| turn(flat[*a], flat[*b], flat[*c]) >= -clipper.straight);
    triangles.extend(rest);
    Cut { triangles, sound }
}

/// What is left of a polygon while ears are clipped off.
struct Clipper<'a> {
    flat: &'a [DVec2],
    previous: Vec<usize>,
    next: Vec<usize>,
    /// Corners that may lie inside an ear: still there, and no left turn.
    reflex: Vec<bool>,
    /// All corners that were reflex at the beginning; no other ever becomes so.
    tree: Vec<(DVec2, usize)>,
    low: DVec2,
    high: DVec2,
    left: usize,
    work: usize,
    /// Doubled area below which a turn is none.
    straight: f64,
}

impl<'a> Clipper<'a> {
    fn new(flat: &'a [DVec2]) -> Self {
        let n = flat.len();
        let (low, high) = flat.iter().fold((flat[0], flat[0]), |(low, high), p| (low.min(*p), high.max(*p)));
        Self {
            flat,
            previous: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            reflex: vec![false; n],
            tree: vec![],
            low,
            high,
            left: n,
            work: WORK.saturating_mul(n),
            straight: STRAIGHT * (high - low).length_squared(),
        }
    }

    fn find_reflex(&mut self) {
        for i in self.ring() {
            self.reflex[i] = turn(self.flat[self.previous[i]], self.flat[i], self.flat[self.next[i]]) <= 0.0;
        }
        self.tree = (0..self.flat.len()).filter(|i| self.reflex[*i]).map(|i| (self.flat[i], i)).collect();
        grow(&mut self.tree, 0);
    }

    /// Clips ears until none is found or the work is used up. A corner becomes an ear only when one beside it was clipped: everything
    /// that lies in its way stays in its way, because the outside of what is left only grows.
    fn clip(&mut self, what: Clip, triangles: &mut Vec<[usize; 3]>) {
        let mut queue: VecDeque<usize> = self.ring().into();
        let mut gone = vec![true; self.flat.len()];
        queue.iter().for_each(|i| gone[*i] = false);
        while let Some(tip) = queue.pop_front() {
            if self.left <= 3 || self.work == 0 {
                return;
            }
            if gone[tip] || !self.is_ear(tip, what) {
                continue;
            }
            let (a, c) = (self.previous[tip], self.next[tip]);
            triangles.push([a, tip, c]);
            (self.next[a], self.previous[c]) = (c, a);
            (gone[tip], self.reflex[tip]) = (true, false);
            self.left -= 1;
            for beside in [a, c] {
                let turned = turn(self.flat[self.previous[beside]], self.flat[beside], self.flat[self.next[beside]]);
                self.reflex[beside] = self.reflex[beside] && turned <= 0.0;
                queue.push_back(beside);
            }
        }
    }

    /// The corners that are left, in order from the lowest.
    fn ring(&self) -> Vec<usize> {
        // A corner that was clipped is nobody's neighbour.
        let start = (0..self.flat.len()).find(|i| self.next[self.previous[*i]] == *i).unwrap_or_default();
        std::iter::successors(Some(start), |i| Some(self.next[*i])).take(self.left).collect()
    }

    /// Whether the triangle at a corner lies inside the polygon: a left turn that holds no reflex corner.
    fn is_ear(&mut self, tip: usize, what: Clip) -> bool {
        let ear = [self.previous[tip], tip, self.next[tip]].map(|i| self.flat[i]);
        let [a, b, c] = ear;
        let turned = turn(a, b, c);
        match what {
            Clip::Spikes => return a == b || b == c || a == c,
            Clip::Ears if turned <= 0.0 => return false,
            Clip::StraightToo if turned <= 0.0 => return turned >= -self.straight,
            Clip::Ears | Clip::StraightToo => {}
        }
        let mut work = self.work;
        let free = !any(&self.tree, 0, [self.low, self.high], &|corners| outside(ear, corners, self.straight), &mut |p, i| {
            work = work.saturating_sub(1);
            self.reflex[i] && self.blocks(ear, tip, p, i)
        });
        self.work = work;
        free
    }

    /// Whether a reflex corner keeps an ear from being clipped. One at the very place of one of the ear's is the other end of a bridge to
    /// a hole: it counts only at the tip, and only where its own edges run into the ear.
    fn blocks(&self, [a, b, c]: [DVec2; 3], tip: usize, p: DVec2, i: usize) -> bool {
        if p == a || p == c {
            return false;
        }
        if p == b {
            let beside = [self.previous[i], self.next[i]].map(|k| self.flat[k]);
            return i != tip && beside.iter().any(|q| turn(a, b, *q) > 0.0 && turn(b, c, *q) > 0.0);
        }
        turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
    }
}

/// Whether a box (low, high) lies wholly outside a triangle, with a margin that rounding in the exact test cannot cross.
fn outside(ear: [DVec2; 3], [low, high]: [DVec2; 2], margin: f64) -> bool {
    let corners = [low, high, DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)];
    [(0, 1), (1, 2), (2, 0)].into_iter().any(|(i, k)| corners.iter().all(|p| turn(ear[i], ear[k], *p) < -margin))
}

/// Orders points as a balanced tree: the middle one divides those before from those behind by x or y in turn.
fn grow(points: &mut [(DVec2, usize)], axis: usize) {
    if points.len() > LEAF {
        let middle = points.len() / 2;
        points.select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
        grow(&mut points[..middle], 1 - axis);
        grow(&mut points[middle + 1..], 1 - axis);
    }
}

/// Whether any point of a tree passes `test`; boxes that `skip` refuses are not looked into.
fn any(
    points: &[(DVec2, usize)],
    axis: usize,
    [low, high]: [DVec2; 2],
    skip: &impl Fn([DVec2; 2]) -> bool,
    test: &mut impl FnMut(DVec2, usize) -> bool,
) -> bool {
    if points.len() <= LEAF {
        return points.iter().any(|(p, i)| test(*p, *i));
    }
    if skip([low, high]) {
        return false;
    }
    let (before, rest) = points.split_at(points.len() / 2);
    let (at, i) = rest[0];
    let (mut split_high, mut split_low) = (high, low);
    (split_high[axis], split_low[axis]) = (at[axis], at[axis]);
    test(at, i) || any(before, 1 - axis, [low, split_high], skip, test) || any(&rest[1..], 1 - axis, [split_low, high], skip, test)
}
