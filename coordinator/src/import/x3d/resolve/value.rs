//! Values that are no nodes: read when their type is known, angles in radians.

use super::{Resolver, frame::Frame};
use crate::import::x3d::{
    literal,
    syntax::{FieldItem, Span, Written},
    table::Access,
    value::{Base, FieldType, Store, Value},
};

impl Resolver<'_> {
    /// A value that is no node, of a type that the table or a prototype tells; it is read once.
    pub(super) fn simple(&mut self, frame: &Frame, item: &FieldItem, ty: FieldType, angle: bool, what: &str) -> Option<Value> {
        if let Some(value) = item.read.get() {
            return value.clone();
        }
        let value = match &item.written {
            Written::Text(span) => self.literal(frame, item, span, ty, angle, what),
            // NULL, which is no value of any other type.
            Written::Nodes(nodes) if nodes.is_empty() => {
                self.warn(item.place, format!("{what} is {ty} and cannot be NULL; it was skipped"));
                None
            }
            _ => {
                self.error(item.place, format!("{what} is {ty} and cannot be a node"));
                None
            }
        };
        item.read.get_or_init(|| value).clone()
    }

    fn literal(&mut self, frame: &Frame, item: &FieldItem, span: &Span, ty: FieldType, angle: bool, what: &str) -> Option<Value> {
        let source = &frame.file.source;
        let text = span.of(source);
        // Pieces put together have no line but that of the whole.
        let place = |at: usize| if matches!(span, Span::Range(_)) { item.place.behind(&text[..at.min(text.len())]) } else { item.place };
        match literal::parse(ty, text, source.form) {
            Ok((value, remark)) => {
                if let Some(remark) = remark {
                    self.warn(place(remark.at), format!("{what} has {}", remark.message));
                }
                Some(in_radians(value, ty, angle, frame.angle))
            }
            Err(fault) => {
                self.error(place(fault.at), format!("{what} has {}", fault.message));
                None
            }
        }
    }
}

/// Converts what are angles in a value from a file's unit.
pub(super) fn in_radians(value: Value, ty: FieldType, angle: bool, factor: f32) -> Value {
    let stride = if ty.base == Base::Rotation { 4 } else { 1 };
    if factor == 1.0 || !(angle || ty.base == Base::Rotation) || ty.store() != Store::Floats {
        return value;
    }
    match value {
        Value::Floats(numbers) => {
            Value::Floats(numbers.iter().enumerate().map(|(i, x)| if i % stride == stride - 1 { x * factor } else { *x }).collect())
        }
        other => other,
    }
}

/// Whether a field that only a file sets can have the value of one that events set too: the standard forbids it, and files do it.
pub(super) fn is_read_once(inner: Access, outer: Access) -> bool {
    inner == Access::Initialize && outer == Access::InputOutput
}

/// Whether a field can be one that a field of a prototype stands for.
pub(super) fn stands_for(inner: Access, outer: Access) -> bool {
    inner == outer || inner == Access::InputOutput
}
