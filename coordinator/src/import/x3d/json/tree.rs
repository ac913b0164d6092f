//! JSON with places: `serde_json` reads it, and where its slices lie in the text says on which line they stand.
//!
//! Values behind `@` and `#` stay slices, because a coordinate list of a million numbers would otherwise become a million boxes. The
//! alternative, `serde_json::Value`, is one line and forgets every place.

use crate::import::x3d::{
    document::Place,
    limits::MAX_JSON_DEPTH,
    syntax::{Locator, SyntaxError},
};
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;
use std::{borrow::Cow, fmt, ops::Range};

/// A JSON value as far as X3D looks into it.
#[derive(Debug)]
pub(super) enum Tree<'a> {
    Object(Vec<Entry<'a>>),
    Array(Vec<Tree<'a>>),
    /// A value behind `@` or `#`: the bytes of it.
    Text(Range<usize>),
    /// A number, a string or the like where an object belongs.
    Other,
}

/// A key of an object and what is behind it.
#[derive(Debug)]
pub(super) struct Entry<'a> {
    pub(super) key: Cow<'a, str>,
    pub(super) place: Place,
    pub(super) tree: Tree<'a>,
}

impl<'a> Tree<'a> {
    /// The entries of an object; none of anything else.
    pub(super) fn entries(&self) -> &[Entry<'a>] {
        if let Self::Object(entries) = self { entries } else { &[] }
    }

    /// What is behind a key.
    pub(super) fn get(&self, key: &str) -> Option<&Entry<'a>> {
        self.entries().iter().find(|e| e.key == key)
    }

    /// The elements of an array; anything else is an array of itself.
    pub(super) fn elements(&self) -> &[Tree<'a>] {
        if let Self::Array(list) = self { list } else { std::slice::from_ref(self) }
    }
}

/// Reads a text.
pub(super) fn parse(text: &str, file: u32) -> Result<Tree<'_>, SyntaxError> {
    let mut locator = Locator::new(text, file);
    let mut deserializer = serde_json::Deserializer::from_str(text);
    deserializer.disable_recursion_limit(); // The seed below keeps its own count.
    let seed = Seed { text, locator: &mut locator, depth: 0 };
    let tree = seed.deserialize(&mut deserializer).and_then(|tree| deserializer.end().map(|()| tree));
    tree.map_err(|e| {
        let message = e.to_string();
        let what = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
        let place = Place { file, line: (e.line() as u32).max(1), column: (e.column() as u32).max(1) };
        SyntaxError { place, message: format!("this is not well-formed JSON: {what}") }
    })
}

struct Seed<'r, 'a> {
    text: &'a str,
    locator: &'r mut Locator<'a>,
    depth: usize,
}

impl<'a> Seed<'_, 'a> {
    fn deeper<E: Error>(&mut self) -> Result<Seed<'_, 'a>, E> {
        if self.depth >= MAX_JSON_DEPTH {
            return Err(E::custom(format!("more than {MAX_JSON_DEPTH} brackets inside one another")));
        }
        Ok(Seed { text: self.text, locator: self.locator, depth: self.depth + 1 })
    }

    /// The bytes of a slice of the text.
    fn range(&self, slice: &str) -> Range<usize> {
        let start = (slice.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize).min(self.text.len());
        start..(start + slice.len()).min(self.text.len())
    }
}

impl<'de> DeserializeSeed<'de> for Seed<'_, 'de> {
    type Value = Tree<'de>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Tree<'de>, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Seed<'_, 'de> {
    type Value = Tree<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Tree<'de>, A::Error> {
        let mut entries = vec![];
        while let Some(key) = map.next_key_seed(Key)? {
            if let Cow::Borrowed(slice) = &key {
                let at = self.range(slice).start;
                self.locator.place(at);
            }
            let place = self.locator.place(0);
            let tree = if key.starts_with(['@', '#']) {
                Tree::Text(self.range(map.next_value::<&RawValue>()?.get()))
            } else {
                map.next_value_seed(self.deeper()?)?
            };
            entries.push(Entry { key, place, tree });
        }
        Ok(Tree::Object(entries))
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut list: A) -> Result<Tree<'de>, A::Error> {
        let mut elements = vec![];
        // Numbers in an unexpected place would take the memory of a node each.
        while let Some(element) = list.next_element_seed(self.deeper()?)? {
            if !matches!(element, Tree::Other) {
                elements.push(element);
            }
        }
        Ok(Tree::Array(elements))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }

    fn visit_i64<E>(self, _: i64) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }

    fn visit_u64<E>(self, _: u64) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }

    fn visit_f64<E>(self, _: f64) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }

    fn visit_str<E>(self, _: &str) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }

    fn visit_unit<E>(self) -> Result<Tree<'de>, E> {
        Ok(Tree::Other)
    }
}

/// A key, borrowed where it has no escapes, so that its place is known.
struct Key;

impl<'de> DeserializeSeed<'de> for Key {
    type Value = Cow<'de, str>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl<'de> Visitor<'de> for Key {
    type Value = Cow<'de, str>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_borrowed_str<E>(self, key: &'de str) -> Result<Self::Value, E> {
        Ok(Cow::Borrowed(key))
    }

    fn visit_str<E>(self, key: &str) -> Result<Self::Value, E> {
        Ok(Cow::Owned(key.to_owned()))
    }
}
