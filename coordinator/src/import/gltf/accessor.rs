//! Accessors: typed elements in buffer views, with sparse replacements (glTF 2.0, section 3.6.2).
//!
//! Elements are read one at a time from the bytes; a caller that wants all of them collects them, for one primitive at a time. What has no
//! bytes behind it (zeros, sparse or not) may not unfold to more than the input has, so that a line of JSON cannot ask for gigabytes.

use super::{
    buffer::{Buffers, MESHOPT, View},
    element::{Component, Shape},
    json::Json,
    report::Report,
};

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
    base: Option<Run>,
    sparse: Option<Sparse>,
}

/// Elements in a view.
#[derive(Debug, Clone, Copy)]
struct Run {
    view: View,
    offset: usize,
    stride: usize,
}

#[derive(Debug, Clone, Copy)]
struct Sparse {
    count: usize,
    kind: Component,
    indices: Run,
    values: Run,
}

impl<'d> Accessor<'d> {
    /// Checks one accessor against its views; `None` where it is wrong.
    pub(super) fn load(json: Json<'d>, buffers: &Buffers<'_>, most: u64, report: &mut Report<'_>) -> Option<Self> {
        let (component, shape, count) = header(json, report)?;
        let normalized = report.boolean(json, "normalized", false);
        if normalized && matches!(component, Component::F32 | Component::U32) {
            report.error(json, "only integers of 8 and 16 bits can be `normalized`");
            return None;
        }
        let base = match json.get("bufferView") {
            Some(at) => Some(run(at, json, (component, shape, count), None, buffers, report)?),
            None => None,
        };
        let sparse = match json.get("sparse") {
            Some(at) => Some(sparse(at, component, shape, count, buffers, report)?),
            None => None,
        };
        if base.is_none() && json.get("byteOffset").is_some() {
            report.warn(json, "`byteOffset` means nothing without a `bufferView`");
        }
        if base.is_none() && (count as u64).saturating_mul((shape.columns * shape.rows * 4) as u64) > most {
            report.error(json, format!("{count} elements without bytes of their own are more than an input of {most} bytes may unfold to"));
            return None;
        }
        let mut accessor = Self { json, component, normalized, count, shape, highest: 0.0, base, sparse };
        accessor.check_sparse_order(buffers, report)?;
        accessor.highest = accessor.check_values(buffers, report)?;
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

    /// Whether it has bytes of its own; it is all zeros otherwise.
    pub(super) fn has_bytes(&self) -> bool {
        self.base.is_some() || self.sparse.is_some()
    }

    /// `SCALAR`, `VEC3`, …
    pub(super) fn kind(&self) -> &'static str {
        self.shape.name
    }

    /// Where an element lies; `None` for a zero.
    fn place(&self, buffers: &Buffers<'_>, index: usize) -> Option<(Run, usize)> {
        if let Some(sparse) = &self.sparse
            && let Some(found) = sparse.find(buffers, index)
        {
            return Some((sparse.values, found));
        }
        self.base.map(|run| (run, index))
    }

    /// The numbers as they are stored, without normalization.
    fn raw(&self, buffers: &Buffers<'_>, index: usize, out: &mut [f64]) {
        out.fill(0.0);
        let Some((run, index)) = self.place(buffers, index) else { return };
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

    fn check_sparse_order(&self, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<()> {
        let Some(sparse) = self.sparse else { return Some(()) };
        let mut before = None;
        for i in 0..sparse.count {
            let index = sparse.index(buffers, i);
            if index >= self.count || before.is_some_and(|b| b >= index) {
                report.error(self.json, format!("sparse index {i} is {index}; they must rise and stay below {}", self.count));
                return None;
            }
            before = Some(index);
        }
        Some(())
    }

    /// Refuses numbers that are not finite, and compares `min` and `max` with the data, which count.
    fn check_values(&self, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<f64> {
        let width = self.width();
        let (mut low, mut high) = ([f64::INFINITY; 16], [f64::NEG_INFINITY; 16]);
        let mut element = [0.0; 16];
        for i in 0..self.count {
            self.raw(buffers, i, &mut element);
            if let Some(k) = element[..width].iter().position(|v| !v.is_finite()) {
                report.error(self.json, format!("element {i} has a number that is not finite ({})", element[k]));
                return None;
            }
            for k in 0..width {
                low[k] = low[k].min(element[k]);
                high[k] = high[k].max(element[k]);
            }
        }
        self.check_bound("min", &low[..width], report);
        self.check_bound("max", &high[..width], report);
        Some(high[..width].iter().copied().fold(f64::NEG_INFINITY, f64::max))
    }

    fn check_bound(&self, name: &str, actual: &[f64], report: &mut Report<'_>) {
        let Some(list) = self.json.get(name) else { return };
        let found = list.items().count();
        if found != actual.len() {
            report.error(list, format!("an accessor of type {} has {} of them; there are {found}", self.kind(), actual.len()));
            return;
        }
        for (item, actual) in list.items().zip(actual) {
            let Some(stated) = item.number() else {
                report.error(item, "this is not a number");
                continue;
            };
            // Bounds of floats are written in decimals of them.
            let same = if self.component == Component::F32 { stated as f32 == *actual as f32 } else { stated == *actual };
            if !same {
                let key = format!("a wrong {name}");
                report.warn_once(item, &key, format!("the {name} {stated} is not that of the data, {actual}; the data count (said once)"));
            }
        }
    }
}

impl Run {
    fn element<'b>(&self, buffers: &'b Buffers<'_>, index: usize) -> &'b [u8] {
        buffers.bytes(self.view).get(self.offset + index * self.stride..).unwrap_or_default()
    }
}

impl Sparse {
    fn index(&self, buffers: &Buffers<'_>, i: usize) -> usize {
        self.kind.read(self.indices.element(buffers, i)) as usize
    }

    /// Which replacement is for this element: a binary search, because indices rise.
    fn find(&self, buffers: &Buffers<'_>, index: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.index(buffers, middle) < index {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        (low < self.count && self.index(buffers, low) == index).then_some(low)
    }
}

/// Type and number of the elements.
fn header(json: Json<'_>, report: &mut Report<'_>) -> Option<(Component, Shape, usize)> {
    let (code, count, kind) = (report.required(json, "componentType"), report.required(json, "count"), report.required(json, "type"));
    let component = code.and_then(|at| {
        let component = Component::of(report.integer_at(at)?);
        if component.is_none() {
            report.error(at, "this is no component type; there are 5120, 5121, 5122, 5123, 5125 and 5126");
        }
        component
    });
    let shape = kind.and_then(|at| {
        let shape = at.string().and_then(|name| Shape::of(&name));
        if shape.is_none() {
            report.error(at, "this is no accessor type; there are SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 and MAT4");
        }
        shape
    });
    let count = count.and_then(|at| match report.integer_at(at)? {
        0 => {
            report.error(at, "an accessor must have at least 1 element");
            None
        }
        n => usize::try_from(n).ok(),
    });
    Some((component?, shape?, count?))
}

fn sparse(at: Json<'_>, component: Component, shape: Shape, all: usize, buffers: &Buffers<'_>, report: &mut Report<'_>) -> Option<Sparse> {
    let count = report.required(at, "count").and_then(|n| report.integer_at(n))?;
    if count == 0 || count > all as u64 {
        report.error(at, format!("{count} sparse elements are not between 1 and the accessor's {all}"));
        return None;
    }
    let (indices, values) = (report.required(at, "indices")?, report.required(at, "values")?);
    let code = report.required(indices, "componentType")?;
    let kind = report.integer_at(code).and_then(Component::of);
    let Some(kind) = kind.filter(|k| matches!(k, Component::U8 | Component::U16 | Component::U32)) else {
        report.error(code, "sparse indices are of type 5121, 5123 or 5125");
        return None;
    };
    let count = count as usize;
    let (index_view, value_view) = (report.required(indices, "bufferView")?, report.required(values, "bufferView")?);
    let indices = run(index_view, indices, (kind, Shape::SCALAR, count), Some(kind.size()), buffers, report)?;
    let values = run(value_view, values, (component, shape, count), Some(shape.size(component)), buffers, report)?;
    Some(Sparse { count, kind, indices, values })
}

/// Where elements lie within a view; `packed` is the stride of sparse data, which ignore that of the view.
fn run(
    at: Json<'_>,
    owner: Json<'_>,
    (component, shape, count): (Component, Shape, usize),
    packed: Option<usize>,
    buffers: &Buffers<'_>,
    report: &mut Report<'_>,
) -> Option<Run> {
    let index = report.index_at(at, "buffer view", buffers.view_count())?;
    let offset = report.integer(owner, "byteOffset", 0);
    let view = buffers.view_of(index)?;
    let size = shape.size(component);
    let stride = packed.or(view.stride).unwrap_or(size.next_multiple_of(component.size()));
    let stride = if shape.columns > 1 && view.stride.is_none() { shape.column(component) * shape.columns } else { stride };
    if stride < size {
        report.error(owner, format!("an element has {size} bytes, but buffer view {index} has a stride of {stride}"));
        return None;
    }
    let end = (count as u64 - 1).checked_mul(stride as u64).and_then(|n| n.checked_add(offset)?.checked_add(size as u64));
    if end.is_none_or(|end| end > view.len as u64) {
        let wanted = end.map_or("more than 2^64".to_owned(), |n| n.to_string());
        report.error(owner, format!("{count} elements from byte {offset} take {wanted} bytes, but buffer view {index} has {}", view.len));
        return None;
    }
    if !(offset as usize + view.start()).is_multiple_of(component.size()) || !stride.is_multiple_of(component.size()) {
        report.count(owner, "accessors whose elements are not aligned to their components (read all the same)");
    }
    Some(Run { view, offset: offset as usize, stride })
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
        let list = report.objects(root, "accessors").into_iter().map(|json| Accessor::load(json, &buffers, most, report)).collect();
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
