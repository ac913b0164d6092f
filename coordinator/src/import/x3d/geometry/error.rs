//! What is wrong with a geometry node: what was repaired, and why nothing could be made of it.
//!
//! Places are positions in the node's own lists; the node's file and line are known to the caller, who puts them in front.

use std::fmt;

/// Why a geometry node gives no mesh. The words follow those of a node's name, as in "IndexedFaceSet: coord has no points".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum GeometryError {
    /// Legal, and nothing to see: the shape is left out.
    #[error("it describes no surface: {why}")]
    Empty {
        /// What is missing.
        why: &'static str,
    },
    /// Every face was unusable.
    #[error("none of its faces can be used: {repairs}")]
    NothingLeft {
        /// Why they were dropped.
        repairs: Repairs,
    },
    /// A field is infinite or not a number.
    #[error("{field}[{at}] is not a finite number")]
    NotFinite {
        /// The field.
        field: &'static str,
        /// Position in the field's list; 0 for a single value.
        at: usize,
    },
    /// A field has a value outside its range.
    #[error("{field} is {value}; it must be {wanted}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// The value found.
        value: f64,
        /// The range, in words.
        wanted: &'static str,
    },
    /// Lists whose lengths do not fit.
    #[error("{field} has {found} values; {wanted} are needed ({why})")]
    Count {
        /// The field.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The least length.
        wanted: u64,
        /// Where that number comes from.
        why: &'static str,
    },
    /// More quads than one node may have.
    #[error("it has {quads} quads ({why}); {most} are allowed")]
    TooLarge {
        /// Its quads.
        quads: u64,
        /// Where that number comes from.
        why: &'static str,
        /// The limit.
        most: usize,
    },
}

/// A repair with its first place and how often it was needed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Repair {
    /// What was found and done about it.
    pub(crate) what: &'static str,
    /// The field that the place counts in.
    pub(crate) field: &'static str,
    /// Position in the field's list of the first.
    pub(crate) first: usize,
    /// How many.
    pub(crate) count: u64,
}

impl fmt::Display for Repair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, field, first, count } = self;
        if *count == 1 { write!(f, "{what}: 1, at {field}[{first}]") } else { write!(f, "{what}: {count}, the first at {field}[{first}]") }
    }
}

/// The repairs of one node, in the order of their first need.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Repairs(pub(crate) Vec<Repair>);

impl Repairs {
    /// Counts a repair.
    pub(super) fn note(&mut self, what: &'static str, field: &'static str, at: usize) {
        match self.0.iter_mut().find(|r| r.what == what && r.field == field) {
            Some(repair) => repair.count += 1,
            None => self.0.push(Repair { what, field, first: at, count: 1 }),
        }
    }
}

impl fmt::Display for Repairs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, repair) in self.0.iter().enumerate() {
            if i > 0 {
                f.write_str("; ")?;
            }
            repair.fmt(f)?;
        }
        Ok(())
    }
}

/// Refuses quads beyond a limit, before anything is allocated for them.
pub(super) fn bounded(quads: u64, why: &'static str, most: usize) -> Result<(), GeometryError> {
    if quads > most as u64 { Err(GeometryError::TooLarge { quads, why, most }) } else { Ok(()) }
}

/// A length that must be finite and positive.
pub(super) fn positive(field: &'static str, value: f32) -> Result<f64, GeometryError> {
    at_least_zero(field, value).and_then(|v| match v {
        0.0 => Err(GeometryError::OutOfRange { field, value: v, wanted: "greater than 0" }),
        v => Ok(v),
    })
}

/// A length that must be finite and not negative.
pub(super) fn at_least_zero(field: &'static str, value: f32) -> Result<f64, GeometryError> {
    if !value.is_finite() {
        return Err(GeometryError::NotFinite { field, at: 0 });
    }
    let value = f64::from(value);
    if value < 0.0 { Err(GeometryError::OutOfRange { field, value, wanted: "0 or greater" }) } else { Ok(value) }
}

/// Refuses lists with values that are not numbers.
pub(super) fn finite<const N: usize>(field: &'static str, values: &[[f32; N]]) -> Result<(), GeometryError> {
    match values.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        Some(at) => Err(GeometryError::NotFinite { field, at }),
        None => Ok(()),
    }
}
