//! What the numbers of an accessor are like, looked at once: whether they are finite, their bounds, whether they rise.
//!
//! Every element is read whether something shows it or not: who exports a broken accessor wants to know.

use super::{accessor::Accessor, buffer::Buffers, element::Component, json::Json, report::Report};

/// What there is to know of them.
#[derive(Debug)]
pub(super) struct Values {
    /// The least and the greatest of each number of an element, as they are stored.
    bounds: Box<[[f64; 2]]>,
    /// The first element that is not above the one before, where elements are single numbers.
    pub(super) stalls: Option<usize>,
}

impl Values {
    /// Numbers that are looked at to read these: those of every element, or, between replacements of nothing but zeros, of the two that
    /// stand for each run of zeros; and the places of the replacements, twice.
    pub(super) fn cost(accessor: &Accessor<'_>, over_zeros: bool) -> u64 {
        let (all, replaced) = (accessor.count as u64, accessor.sparse().map_or(0, |sparse| sparse.count as u64));
        let elements = if over_zeros { all.min(3 * replaced + 2) } else { all };
        elements.saturating_mul(accessor.width() as u64).saturating_add(2 * replaced)
    }

    /// Reads them all; `None` where one is not finite or replacements are out of order. `over_zeros`: what is not replaced is zero.
    pub(super) fn read(accessor: &Accessor<'_>, over_zeros: bool, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<Self> {
        check_order(accessor, buffers, report)?;
        let (width, mut element) = (accessor.width(), [0.0; 16]);
        let (mut bounds, mut stalls) = (vec![[f64::INFINITY, f64::NEG_INFINITY]; width], None);
        let places = accessor.sparse().map(|sparse| (0..sparse.count).map(|k| (sparse.index(buffers, k), k)));
        let mut replacements = places.into_iter().flatten().peekable();
        let (mut i, mut zeros) = (0, 0);
        while i < accessor.count {
            let (before, replacement) = (element[0], replacements.next_if(|(place, _)| *place == i).map(|(_, k)| k));
            accessor.stored(buffers, i, replacement, &mut element);
            if let Some(k) = element[..width].iter().position(|v| !v.is_finite()) {
                report.error(accessor.json, format!("element {i} has a number that is not finite ({})", element[k]));
                return None;
            }
            if i > 0 && stalls.is_none() && width == 1 && element[0] <= before {
                stalls = Some(i);
            }
            for ([low, high], v) in bounds.iter_mut().zip(&element) {
                (*low, *high) = (low.min(*v), high.max(*v));
            }
            // The first zero has told how it stands to what is before it, the second to the first, and others say nothing new.
            zeros = if replacement.is_none() && over_zeros { zeros + 1 } else { 0 };
            i = if zeros < 2 { i + 1 } else { replacements.peek().map_or(accessor.count, |(place, _)| *place) };
        }
        Some(Self { bounds: bounds.into(), stalls })
    }

    /// Whether there is nothing but zeros.
    pub(super) fn are_zeros(&self) -> bool {
        self.bounds.iter().all(|bounds| *bounds == [0.0; 2])
    }

    /// The greatest number of all.
    pub(super) fn highest(&self) -> f64 {
        self.bounds.iter().map(|[_, high]| *high).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Compares the `min` and `max` of an accessor with the data, which count.
    pub(super) fn check_bounds(&self, accessor: &Accessor<'_>, report: &mut Report<'_>) {
        for (name, k) in [("min", 0), ("max", 1)] {
            let Some(list) = accessor.json.get(name) else { continue };
            let found = list.items().count();
            if found == self.bounds.len() {
                list.items().zip(&self.bounds).for_each(|(item, bounds)| check_bound(accessor, name, item, bounds[k], report));
            } else {
                let message = format!("an accessor of type {} has {} of them; there are {found}", accessor.kind(), self.bounds.len());
                report.error(list, message);
            }
        }
    }
}

fn check_bound(accessor: &Accessor<'_>, name: &str, item: Json<'_>, actual: f64, report: &mut Report<'_>) {
    let Some(stated) = item.number() else { return report.error(item, "this is not a number") };
    // Bounds of floats are written in decimals of them.
    let same = if accessor.component == Component::F32 { stated as f32 == actual as f32 } else { stated == actual };
    if !same {
        let key = format!("a wrong {name}");
        report.warn_once(item, &key, format!("the {name} {stated} is not that of the data, {actual}; the data count (said once)"));
    }
}

fn check_order(accessor: &Accessor<'_>, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<()> {
    let Some(sparse) = accessor.sparse() else { return Some(()) };
    let mut before = None;
    for i in 0..sparse.count {
        let index = sparse.index(buffers, i);
        if index >= accessor.count || before.is_some_and(|b| b >= index) {
            report.error(accessor.json, format!("sparse index {i} is {index}; they must rise and stay below {}", accessor.count));
            return None;
        }
        before = Some(index);
    }
    Some(())
}
