//! The reading of properties with their faults: what is wrong is told where it is read and counts as absent afterwards, so that one fault
//! is told once and the rest of the file is still looked at.

use super::{
    json::{Json, Kind},
    report::Report,
};
use std::{borrow::Cow, collections::BTreeSet, ops::RangeInclusive};

/// Integers up to here are exact in a JSON number (IEEE 754 binary64).
const EXACT: f64 = 9_007_199_254_740_992.0;
/// How far out of its range a number may lie that went through single precision and back.
const ROUNDING: f64 = 1e-6;
/// Entries of one list: what they become in memory is forty times what the shortest of them takes in the file.
const LIST: usize = 1 << 20;
/// Any number that an f32 holds.
pub(super) const ANY: RangeInclusive<f64> = -(f32::MAX as f64)..=f32::MAX as f64;
/// A share.
pub(super) const SHARE: RangeInclusive<f64> = 0.0..=1.0;
/// Zero or more.
pub(super) const POSITIVE: RangeInclusive<f64> = 0.0..=f32::MAX as f64;

impl Report<'_> {
    /// A member that must be there.
    pub(super) fn required<'d>(&mut self, object: Json<'d>, name: &str) -> Option<Json<'d>> {
        let found = object.get(name);
        if found.is_none() {
            self.error(object, format!("the property `{name}` is missing"));
        }
        found
    }

    /// The value as a number in a range.
    pub(super) fn number_at(&mut self, json: Json<'_>, range: &RangeInclusive<f64>) -> Option<f64> {
        match json.number() {
            Some(v) if range.contains(&v) => return Some(v),
            Some(v) if v >= range.start() - ROUNDING && v <= range.end() + ROUNDING => {
                self.count(json, "values that rounding put out of range were brought back");
                return Some(v.clamp(*range.start(), *range.end()));
            }
            Some(v) if v.abs() > EXACT => self.error(json, format!("the value {v:e} is out of range; {}", allowed(range))),
            Some(v) => self.error(json, format!("the value {v} is out of range; {}", allowed(range))),
            None => self.error(json, format!("this is {}, not a number", named(json.kind()))),
        }
        None
    }

    /// A number in a range, or its default.
    pub(super) fn number(&mut self, object: Json<'_>, name: &str, default: f64, range: &RangeInclusive<f64>) -> f64 {
        object.get(name).and_then(|json| self.number_at(json, range)).unwrap_or(default)
    }

    /// The value as a whole number that is not negative.
    pub(super) fn integer_at(&mut self, json: Json<'_>) -> Option<u64> {
        let value = self.number_at(json, &(0.0..=EXACT))?;
        if value.fract() == 0.0 {
            return Some(value as u64);
        }
        self.error(json, format!("the value {value} is not a whole number"));
        None
    }

    /// A whole number, or its default.
    pub(super) fn integer(&mut self, object: Json<'_>, name: &str, default: u64) -> u64 {
        object.get(name).and_then(|json| self.integer_at(json)).unwrap_or(default)
    }

    /// The value as an index into `count` things called `what`.
    pub(super) fn index_at(&mut self, json: Json<'_>, what: &str, count: usize) -> Option<usize> {
        let index = self.integer_at(json)?;
        if index < count as u64 {
            return Some(index as usize);
        }
        self.error(json, format!("there is no {what} {index}; the file has {count}"));
        None
    }

    /// An index, where the object has one.
    pub(super) fn index(&mut self, object: Json<'_>, name: &str, what: &str, count: usize) -> Option<usize> {
        object.get(name).and_then(|json| self.index_at(json, what, count))
    }

    /// N numbers in a range, where the object has them.
    pub(super) fn vector<const N: usize>(&mut self, object: Json<'_>, name: &str, range: &RangeInclusive<f64>) -> Option<[f64; N]> {
        let list = object.get(name)?;
        let found = list.items().count();
        if found != N {
            self.error(list, format!("{N} numbers are expected here; there are {found}"));
            return None;
        }
        let mut out = [0.0; N];
        let mut whole = true;
        for (slot, item) in out.iter_mut().zip(list.items()) {
            match self.number_at(item, range) {
                Some(v) => *slot = v,
                None => whole = false,
            }
        }
        whole.then_some(out)
    }

    /// A truth value, or its default.
    pub(super) fn boolean(&mut self, object: Json<'_>, name: &str, default: bool) -> bool {
        let Some(json) = object.get(name) else { return default };
        json.boolean().unwrap_or_else(|| {
            self.error(json, format!("this is {}, not true or false", named(json.kind())));
            default
        })
    }

    /// A text, where the object has one.
    pub(super) fn string<'d>(&mut self, object: Json<'d>, name: &str) -> Option<Cow<'d, str>> {
        let json = object.get(name)?;
        let text = json.string();
        if text.is_none() {
            self.error(json, format!("this is {}, not a string", named(json.kind())));
        }
        text
    }

    /// The objects of a list; empty where there is none.
    pub(super) fn objects<'d>(&mut self, object: Json<'d>, name: &str) -> Vec<Json<'d>> {
        let list = self.list(object, name);
        for item in list.iter().filter(|item| item.kind() != Kind::Object) {
            self.error(*item, format!("this is {}, not an object", named(item.kind())));
        }
        list
    }

    /// The elements of a list; empty where there is none.
    pub(super) fn list<'d>(&mut self, object: Json<'d>, name: &str) -> Vec<Json<'d>> {
        let Some(json) = object.get(name) else { return vec![] };
        if json.kind() != Kind::Array {
            self.error(json, format!("this is {}, not a list", named(json.kind())));
            return vec![];
        }
        let found = json.len();
        if found > LIST {
            self.error(json, format!("the list has {found} entries; at most {LIST} are read"));
            return vec![];
        }
        let list: Vec<Json<'d>> = json.items().collect();
        if list.is_empty() {
            self.count(json, "lists that are empty where glTF wants none at all");
        }
        list
    }

    /// Indices of a list, each once.
    pub(super) fn indices(&mut self, object: Json<'_>, name: &str, what: &str, count: usize) -> Vec<usize> {
        let mut seen = BTreeSet::new();
        let mut found = vec![];
        for item in self.list(object, name) {
            let Some(index) = self.index_at(item, what, count) else { continue };
            if seen.insert(index) {
                found.push(index);
            } else {
                self.error(item, format!("{what} {index} is listed twice"));
            }
        }
        found
    }
}

fn named(kind: Kind) -> &'static str {
    match kind {
        Kind::Null => "null",
        Kind::Boolean => "a truth value",
        Kind::Number => "a number",
        Kind::String => "a string",
        Kind::Array => "a list",
        Kind::Object => "an object",
    }
}

fn allowed(range: &RangeInclusive<f64>) -> String {
    let (low, high) = (*range.start(), *range.end());
    if range == &ANY {
        "it must be finite in single precision".to_owned()
    } else if high >= EXACT {
        format!("it must be {low} or more, and finite")
    } else {
        format!("it must lie in [{low}, {high}]")
    }
}
