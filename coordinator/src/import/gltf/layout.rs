//! Where the elements of an accessor lie: in a view, and in the two views of sparse replacements (glTF 2.0, section 3.6.2).

use super::{
    buffer::{Buffers, View},
    element::{Component, Shape},
    json::Json,
    report::Report,
};

/// Elements in a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Run {
    view: View,
    offset: usize,
    stride: usize,
}

/// Replacements of some elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Sparse {
    /// How many there are.
    pub(super) count: usize,
    kind: Component,
    indices: Run,
    /// Where they lie.
    pub(super) values: Run,
}

impl Run {
    /// The bytes from an element on.
    pub(super) fn element<'b>(&self, buffers: &'b Buffers<'_>, index: usize) -> &'b [u8] {
        buffers.bytes(self.view).get(self.offset + index * self.stride..).unwrap_or_default()
    }
}

impl Sparse {
    /// Which element the replacement `i` is for.
    pub(super) fn index(&self, buffers: &Buffers<'_>, i: usize) -> usize {
        self.kind.read(self.indices.element(buffers, i)) as usize
    }

    /// Which replacement is for this element: a binary search, because indices rise.
    pub(super) fn find(&self, buffers: &Buffers<'_>, index: usize) -> Option<usize> {
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
pub(super) fn header(json: Json<'_>, report: &mut Report<'_>) -> Option<(Component, Shape, usize)> {
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

/// The sparse replacements that `at` describes.
pub(super) fn sparse(
    at: Json<'_>,
    component: Component,
    shape: Shape,
    all: usize,
    buffers: &Buffers<'_>,
    report: &mut Report<'_>,
) -> Option<Sparse> {
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
    let indices = run(index_view, indices, (kind, Shape::SCALAR, count), true, buffers, report)?;
    let values = run(value_view, values, (component, shape, count), true, buffers, report)?;
    Some(Sparse { count, kind, indices, values })
}

/// Where elements lie within a view; `packed` ones, as sparse data are, ignore the stride of the view.
pub(super) fn run(
    at: Json<'_>,
    owner: Json<'_>,
    (component, shape, count): (Component, Shape, usize),
    packed: bool,
    buffers: &Buffers<'_>,
    report: &mut Report<'_>,
) -> Option<Run> {
    let index = report.index_at(at, "buffer view", buffers.view_count())?;
    let offset = report.integer(owner, "byteOffset", 0);
    let view = buffers.view_of(index)?;
    let size = shape.size(component);
    let stride = view.stride.filter(|_| !packed).unwrap_or(shape.column(component) * shape.columns);
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
