//! Accessors: typed elements in buffer views, with sparse replacements (glTF 2.0, section 3.6.2).
//!
//! Elements are read one at a time from the bytes; a caller that wants all of them collects them, for one primitive at a time. What has no
//! bytes behind it (zeros, sparse or not) may not unfold to more than the input has, so that a line of JSON cannot ask for gigabytes.

use super::{
    buffer::{Buffers, MESHOPT},
    element::{Component, Shape},
    json::Json,
    layout::{Run, Sparse, header, run, sparse},
    report::Report,
    values::Values,
};
use std::collections::BTreeMap;

/// Numbers that are looked at to check the accessors of a file, for each of its bytes: those of an honest one lie side by side and are
/// looked at once.
const NUMBERS_PER_BYTE: u64 = 16;
/// Numbers that may be looked at in any file.
const NUMBERS: u64 = 1 << 20;

/// A checked accessor.
#[derive(Debug, Clone)]
pub(super) struct Accessor<'d> {
    /// Its description.
    pub(super) json: Json<'d>,
    /// Its component type.
    pub(super) component: Component,
    /// Whether integers stand for [0, 1] or [-1, 1].
    pub(super) normalized: bool,
    /// Elements.
    pub(super) count: usize,
    shape: Shape,
    /// The largest number in it.
    highest: f64,
    /// The first of its numbers that is not above the one before, where it has one number an element.
    stalls: Option<usize>,
    /// Whether it says its bounds, both of them.
    pub(super) has_bounds: bool,
    base: Option<Run>,
    sparse: Option<Box<Sparse>>,
}

impl<'d> Accessor<'d> {
    /// Checks one accessor against its views; `None` where it is wrong.
    fn load(json: Json<'d>, buffers: &Buffers<'_>, checks: &mut Checks, report: &mut Report<'_>) -> Option<Self> {
        let (component, shape, count) = header(json, report)?;
        let normalized = report.boolean(json, "normalized", false);
        if normalized && matches!(component, Component::F32 | Component::U32) {
            report.error(json, "only integers of 8 and 16 bits can be `normalized`");
            return None;
        }
        let base = match json.get("bufferView") {
            Some(at) => Some(run(at, json, (component, shape, count), false, buffers, report)?),
            None => None,
        };
        let sparse = match json.get("sparse") {
            Some(at) => Some(Box::new(sparse(at, component, shape, count, buffers, report)?)),
            None => None,
        };
        if base.is_none() && json.get("byteOffset").is_some() {
            report.warn(json, "`byteOffset` means nothing without a `bufferView`");
        }
        if base.is_none() && (count as u64).saturating_mul((shape.columns * shape.rows * 4) as u64) > checks.most {
            let most = checks.most;
            report.error(json, format!("{count} elements without bytes of their own are more than an input of {most} bytes may unfold to"));
            return None;
        }
        let has_bounds = json.get("min").is_some() && json.get("max").is_some();
        let mut accessor = Self { json, component, normalized, count, shape, highest: 0.0, stalls: None, has_bounds, base, sparse };
        let values = checks.values(&accessor, buffers, report)?;
        values.check_bounds(&accessor, report);
        (accessor.highest, accessor.stalls) = (values.highest(), values.stalls);
        Some(accessor)
    }

    /// Numbers of an element.
    pub(super) fn width(&self) -> usize {
        self.shape.columns * self.shape.rows
    }

    /// The largest of its numbers, for integers: as they are stored.
    pub(super) fn highest(&self) -> usize {
        self.highest as usize
    }

    /// The first of its numbers that is not above the one before, where it has one number an element.
    pub(super) fn stalls(&self) -> Option<usize> {
        self.stalls
    }

    /// Whether it has bytes of its own; it is all zeros otherwise.
    pub(super) fn has_bytes(&self) -> bool {
        self.base.is_some() || self.sparse.is_some()
    }

    /// `SCALAR`, `VEC3`, …
    pub(super) fn kind(&self) -> &'static str {
        self.shape.name
    }

    /// The numbers as they are stored, without normalization.
    fn raw(&self, buffers: &Buffers<'_>, index: usize, out: &mut [f64]) {
        let replacement = self.sparse.as_ref().and_then(|sparse| sparse.find(buffers, index));
        self.stored(buffers, index, replacement, out);
    }

    /// The same for who knows which replacement stands for the element, if any.
    pub(super) fn stored(&self, buffers: &Buffers<'_>, index: usize, replacement: Option<usize>, out: &mut [f64]) {
        out.fill(0.0);
        let replaced = self.sparse.as_ref().zip(replacement).map(|(sparse, i)| (sparse.values, i));
        let Some((run, index)) = replaced.or(self.base.map(|run| (run, index))) else { return };
        let element = run.element(buffers, index);
        let (column, size) = (self.shape.column(self.component), self.component.size());
        for (k, slot) in out.iter_mut().enumerate().take(self.width()) {
            let at = k / self.shape.rows * column + k % self.shape.rows * size;
            *slot = self.component.read(element.get(at..).unwrap_or_default());
        }
    }

    /// The first N numbers of an element, zero where it has fewer.
    pub(super) fn get<const N: usize>(&self, buffers: &Buffers<'_>, index: usize) -> [f64; N] {
        let mut out = [0.0; N];
        self.raw(buffers, index, &mut out);
        if self.normalized { out.map(|v| self.component.normal(v)) } else { out }
    }

    /// All elements.
    pub(super) fn all<'s, const N: usize>(&'s self, buffers: &'s Buffers<'_>) -> impl ExactSizeIterator<Item = [f64; N]> + use<'s, 'd, N> {
        (0..self.count).map(move |i| self.get(buffers, i))
    }

    /// Its replacements.
    pub(super) fn sparse(&self) -> Option<&Sparse> {
        self.sparse.as_deref()
    }
}

/// What tells values apart: those of the same type in the same place are the same.
type Place = (Component, &'static str, usize, Option<Run>, Option<Sparse>);

/// The values that were looked at, once for all accessors that lie alike.
struct Checks {
    /// Bytes of the input.
    most: u64,
    /// Numbers that may still be looked at.
    left: u64,
    known: BTreeMap<Place, Option<Values>>,
}

impl Checks {
    /// What there is to know of the values of an accessor; `None` where they are wrong or too many, which is told once.
    fn values(&mut self, accessor: &Accessor<'_>, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<&Values> {
        let place = (accessor.component, accessor.kind(), accessor.count, accessor.base, accessor.sparse().copied());
        if !self.known.contains_key(&place) {
            let over_zeros = self.is_over_zeros(accessor, buffers, report)?;
            let cost = Values::cost(accessor, over_zeros);
            if cost > self.left {
                let message = format!(
                    "the accessors up to this one name {NUMBERS_PER_BYTE} times as many numbers as an input of {} bytes has bytes; \
                     let those that read the same data be one",
                    self.most
                );
                report.error(accessor.json, message);
                return None;
            }
            self.left -= cost;
            self.known.insert(place, Values::read(accessor, over_zeros, buffers, report));
        }
        self.known.get(&place)?.as_ref()
    }

    /// Whether everything is zero that its replacements leave, which those of morph targets mostly do: many may share one run of zeros, and
    /// each has a few replacements of its own. `None` where what is replaced is wrong.
    fn is_over_zeros(&mut self, accessor: &Accessor<'_>, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<bool> {
        match (accessor.base, &accessor.sparse) {
            (None, _) => Some(true),
            (Some(_), None) => Some(false),
            (Some(_), Some(_)) => {
                let base = Accessor { sparse: None, ..accessor.clone() };
                Some(self.values(&base, buffers, report)?.are_zeros())
            }
        }
    }
}

/// The accessors of a file.
pub(super) struct Accessors<'d, 'b> {
    /// The bytes behind them.
    pub(super) buffers: Buffers<'b>,
    list: Vec<Option<Accessor<'d>>>,
}

impl<'d, 'b> Accessors<'d, 'b> {
    /// Checks all accessors. `most` bounds what may unfold from nothing.
    pub(super) fn load(root: Json<'d>, buffers: Buffers<'b>, most: u64, report: &mut Report<'_>) -> Self {
        for view in report.objects(root, "bufferViews") {
            if let Some(name) = MESHOPT.iter().find(|name| view.extension(name).is_some()) {
                report.warn_once(
                    view,
                    name,
                    format!("{name} is not decoded; the uncompressed data are used where there are any (said once)"),
                );
            }
        }
        let left = most.saturating_mul(NUMBERS_PER_BYTE).saturating_add(NUMBERS);
        let mut checks = Checks { most, left, known: BTreeMap::new() };
        let list = report.objects(root, "accessors").into_iter();
        let list = list.map(|json| if report.is_full() { None } else { Accessor::load(json, &buffers, &mut checks, report) }).collect();
        Self { buffers, list }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// The accessor that a value refers to; `None` where it is wrong or refers to none, which has been told.
    pub(super) fn at(&self, json: Json<'_>, report: &mut Report<'_>) -> Option<&Accessor<'d>> {
        let index = report.index_at(json, "accessor", self.count())?;
        let found = self.list[index].as_ref();
        if found.is_none() && !report.has_errors() {
            report.error(json, format!("the data of accessor {index} are compressed and cannot be decoded; export the file uncompressed"));
        }
        found
    }
}
