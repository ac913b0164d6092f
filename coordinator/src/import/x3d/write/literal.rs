//! Values as text: the shortest numbers that read back to the same bits.

use crate::import::x3d::value::{Base, FieldType, Store, Value};
use std::fmt::Write;

/// Where a list goes on in the next line.
const LINE: usize = 120;

/// The elements of a value that is no node; strings in quotes; booleans in capitals or not; long lists go on in lines that begin with
/// `indent`.
pub(super) fn elements(ty: FieldType, value: &Value, capitals: bool, indent: &str) -> String {
    let width = ty.width().max(1);
    match value {
        Value::Ints(v) if ty.base == Base::Bool => join(v, 1, indent, |v, out| {
            out.push_str(match (*v != 0, capitals) {
                (true, true) => "TRUE",
                (false, true) => "FALSE",
                (true, false) => "true",
                (false, false) => "false",
            });
        }),
        // Pixels take 32 bits without a sign; sizes are never negative.
        Value::Ints(v) if ty.base == Base::Image => join(v, usize::MAX, indent, |v, out| {
            let _ = write!(out, "{}", *v as u32);
        }),
        Value::Ints(v) => join(v, width, indent, |v, out| {
            let _ = write!(out, "{v}");
        }),
        Value::Floats(v) => join(v, width, indent, |v, out| {
            let _ = if is_plain(f64::from(*v)) { write!(out, "{v}") } else { write!(out, "{v:e}") };
        }),
        Value::Doubles(v) => join(v, width, indent, |v, out| {
            let _ = if is_plain(*v) { write!(out, "{v}") } else { write!(out, "{v:e}") };
        }),
        Value::Strings(v) => join(v, 1, "", |v, out| {
            out.push('"');
            v.chars().for_each(|c| {
                out.extend(matches!(c, '"' | '\\').then_some('\\'));
                out.push(c);
            });
            out.push('"');
        }),
        Value::Nodes(_) => String::new(),
    }
}

/// Whether a number is shorter without an exponent, or nearly.
fn is_plain(v: f64) -> bool {
    v == 0.0 || (1e-4..1e9).contains(&v.abs())
}

/// Numbers with blanks between them and commas between elements of `width` numbers; lines are broken where there is an indent.
fn join<T>(values: &[T], width: usize, indent: &str, mut write: impl FnMut(&T, &mut String)) -> String {
    let (mut out, mut line) = (String::new(), 0);
    for (at, value) in values.iter().enumerate() {
        if at > 0 {
            let whole = at % width == 0;
            out.push_str(if whole && width > 1 { ", " } else { " " });
            if !indent.is_empty() && (whole || width == usize::MAX) && out.len() - line > LINE {
                out.push('\n');
                line = out.len();
                out.push_str(indent);
            }
        }
        write(value, &mut out);
    }
    out
}

/// A text without the characters that XML 1.0 cannot say and Kiln's readers refuse, and how many they were.
pub(super) fn sayable(text: &str) -> (String, usize) {
    let cannot =
        |c: char| (c.is_control() && !matches!(c, '\t' | '\n' | '\r' | '\u{7f}'..='\u{9f}')) || matches!(c, '\u{fffe}' | '\u{ffff}');
    let lost = text.chars().filter(|c| cannot(*c)).count();
    (text.chars().map(|c| if cannot(c) { char::REPLACEMENT_CHARACTER } else { c }).collect(), lost)
}

/// Whether values of the type stand in brackets.
pub(super) fn is_list(ty: FieldType) -> bool {
    ty.many && ty.store() != Store::Nodes
}
