//! A JSON text that knows its places: every value has a line and a JSON pointer, which is what makes an error of an import useful.
//!
//! `serde_json` checks the grammar; then one pass notes where each value begins and where its subtree ends, 8 bytes a value, and values are
//! read from the text as they are asked for. `serde_json::Value` would take 32 bytes for each `0` of a hostile list, recurse, and know no
//! lines. Cost: linear in the text to parse; a look-up in an object is linear in its members, so what many refer to is asked once and not
//! by each of them; a pointer is linear in the siblings on its path.

use serde::de::IgnoredAny;
use std::borrow::Cow;

/// Characters of a name that are kept.
const NAME_CHARS: usize = kiln_proto::limits::NAME_BYTES / 4;
/// Bytes between two entries of the table of lines.
const BLOCK: usize = 4_096;
/// The end of a chain of open values.
const NONE: u32 = u32::MAX;

#[cfg(test)]
thread_local! {
    /// How often this thread went on to another value inside an object or array: the work that look-ups are.
    pub(super) static VISITED: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// A value on the tape.
#[derive(Debug, Clone, Copy)]
struct Entry {
    /// Where it begins in the text.
    at: u32,
    /// The entry behind its subtree.
    next: u32,
}

/// A parsed text. An object is followed by its members, name and value in turn; an array by its elements.
#[derive(Debug)]
pub(super) struct Document<'t> {
    text: &'t str,
    entries: Vec<Entry>,
    /// Line breaks before each block of the text.
    breaks: Vec<u32>,
}

/// A value of a document.
#[derive(Debug, Clone, Copy)]
pub(super) struct Json<'d> {
    document: &'d Document<'d>,
    entry: u32,
}

/// What a value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Null,
    Boolean,
    Number,
    String,
    Array,
    Object,
}

/// Why a text is no JSON.
#[derive(Debug, thiserror::Error)]
#[error("the JSON cannot be read: {message}")]
pub(super) struct NotJson {
    message: String,
    /// From 1.
    pub(super) line: u32,
}

impl<'t> Document<'t> {
    /// Parses a text of less than 4 GiB.
    pub(super) fn parse(text: &'t str) -> Result<Self, NotJson> {
        serde_json::from_str::<IgnoredAny>(text).map_err(|e| NotJson { message: e.to_string(), line: e.line() as u32 })?;
        let count = Tokens::new(text).filter(|(_, closes)| !closes).count();
        let mut entries: Vec<Entry> = Vec::with_capacity(count);
        // While a value is open, its `next` holds the value around it: a stack without a stack.
        let mut open = NONE;
        for (at, closes) in Tokens::new(text) {
            if closes {
                let end = entries.len() as u32;
                if let Some(entry) = entries.get_mut(open as usize) {
                    open = std::mem::replace(&mut entry.next, end);
                }
                continue;
            }
            let this = entries.len() as u32;
            let is_open = matches!(text.as_bytes()[at], b'{' | b'[');
            entries.push(Entry { at: at as u32, next: if is_open { std::mem::replace(&mut open, this) } else { this + 1 } });
        }
        let breaks_of = |block: &[u8]| block.iter().filter(|b| **b == b'\n').count() as u32;
        let running = |sum: &mut u32, block: &[u8]| Some(std::mem::replace(sum, *sum + breaks_of(block)));
        let breaks = text.as_bytes().chunks(BLOCK).scan(0, running).collect();
        Ok(Self { text, entries, breaks })
    }

    /// The whole.
    pub(super) fn root(&self) -> Json<'_> {
        Json { document: self, entry: 0 }
    }
}

impl<'d> Json<'d> {
    fn at(self) -> usize {
        self.document.entries[self.entry as usize].at as usize
    }

    fn next(self) -> u32 {
        self.document.entries[self.entry as usize].next
    }

    fn rest(self) -> &'d str {
        &self.document.text[self.at()..]
    }

    /// A number that no other value of the document has.
    pub(super) fn id(self) -> u32 {
        self.entry
    }

    /// What it is.
    pub(super) fn kind(self) -> Kind {
        match self.document.text.as_bytes()[self.at()] {
            b'{' => Kind::Object,
            b'[' => Kind::Array,
            b'"' => Kind::String,
            b't' | b'f' => Kind::Boolean,
            b'n' => Kind::Null,
            _ => Kind::Number,
        }
    }

    /// Its line, from 1.
    pub(super) fn line(self) -> u32 {
        let at = self.at();
        let block = at / BLOCK;
        let within = self.document.text.as_bytes()[block * BLOCK..at].iter().filter(|b| **b == b'\n').count();
        self.document.breaks[block] + within as u32 + 1
    }

    /// The number, where it is one; infinite where it exceeds an f64.
    pub(super) fn number(self) -> Option<f64> {
        let text = self.rest();
        let end = text.find(|c: char| !matches!(c, '0'..='9' | '-' | '+' | '.' | 'e' | 'E')).unwrap_or(text.len());
        text[..end].parse().ok().filter(|_| self.kind() == Kind::Number)
    }

    /// The truth value, where it is one.
    pub(super) fn boolean(self) -> Option<bool> {
        (self.kind() == Kind::Boolean).then(|| self.rest().starts_with('t'))
    }

    /// The text, where it is one. An escape that means no character stays as it is written.
    pub(super) fn string(self) -> Option<Cow<'d, str>> {
        if self.kind() != Kind::String {
            return None;
        }
        let text = self.rest();
        let end = string_end(text.as_bytes());
        let inner = &text[1..end - 1];
        if !inner.contains('\\') {
            return Some(Cow::Borrowed(inner));
        }
        Some(serde_json::from_str::<String>(&text[..end]).map_or(Cow::Borrowed(inner), Cow::Owned))
    }

    /// The name of a thing, as long as names are kept; `None` where it has none but blanks. Of a longer one only the beginning is looked
    /// at: what a thousand nodes show may be called by a megabyte.
    pub(super) fn name(self) -> Option<String> {
        let json = self.get("name").filter(|json| json.kind() == Kind::String)?;
        let text = json.rest();
        let (bytes, mut end, mut left) = (text.as_bytes(), 1, NAME_CHARS);
        while left > 0 && bytes.get(end).is_some_and(|b| *b != b'"') {
            end += match &bytes[end..] {
                [b'\\', b'u', ..] => 6,
                [b'\\', ..] => 2,
                _ => text[end..].chars().next().map_or(1, char::len_utf8),
            };
            left -= 1;
        }
        let inner = text.get(1..end)?;
        let name = serde_json::from_str::<String>(&format!("\"{inner}\"")).unwrap_or_else(|_| inner.to_owned());
        Some(name).filter(|name| !name.trim().is_empty())
    }

    /// The values directly inside an object or array of this kind, names of members among them.
    fn inside(self, kind: Kind) -> impl Iterator<Item = Json<'d>> {
        let end = if self.kind() == kind { self.next() } else { 0 };
        let mut entry = self.entry + 1;
        std::iter::from_fn(move || {
            #[cfg(test)]
            VISITED.set(VISITED.get() + 1);
            let value = Self { entry, ..self };
            (entry < end).then(|| {
                entry = value.next();
                value
            })
        })
    }

    /// The elements of an array; nothing for anything else.
    pub(super) fn items(self) -> impl Iterator<Item = Json<'d>> {
        self.inside(Kind::Array)
    }

    /// How many elements an array has.
    pub(super) fn len(self) -> usize {
        self.items().count()
    }

    /// The members of an object; nothing for anything else.
    pub(super) fn members(self) -> impl Iterator<Item = (Cow<'d, str>, Json<'d>)> {
        let mut values = self.inside(Kind::Object);
        std::iter::from_fn(move || Some((values.next()?.string()?, values.next()?)))
    }

    /// The member of this name; the last, where a hand has written several.
    pub(super) fn get(self, name: &str) -> Option<Json<'d>> {
        self.members().filter(|(n, _)| n == name).map(|(_, value)| value).last()
    }

    /// An extension of an object.
    pub(super) fn extension(self, name: &str) -> Option<Json<'d>> {
        self.get("extensions")?.get(name)
    }

    /// Its JSON pointer (RFC 6901).
    pub(super) fn pointer(self) -> String {
        let mut pointer = String::new();
        let mut around = self.document.root();
        while around.entry != self.entry {
            let holds = |value: Json<'_>| value.entry <= self.entry && self.entry < value.next();
            if around.kind() == Kind::Array {
                let Some((index, item)) = around.items().enumerate().find(|(_, item)| holds(*item)) else { break };
                pointer += &format!("/{index}");
                around = item;
            } else {
                let Some((name, value)) = around.members().find(|(_, value)| holds(*value)) else { break };
                pointer += &format!("/{}", name.replace('~', "~0").replace('/', "~1"));
                around = value;
            }
        }
        pointer
    }
}

/// The beginnings of values and the ends of objects and arrays in a valid text: (place, whether it ends one).
struct Tokens<'t> {
    text: &'t [u8],
    at: usize,
}

impl<'t> Tokens<'t> {
    fn new(text: &'t str) -> Self {
        Self { text: text.as_bytes(), at: 0 }
    }
}

impl Iterator for Tokens<'_> {
    type Item = (usize, bool);

    fn next(&mut self) -> Option<(usize, bool)> {
        while matches!(self.text.get(self.at)?, b' ' | b'\t' | b'\n' | b'\r' | b',' | b':') {
            self.at += 1;
        }
        let start = self.at;
        self.at += match self.text[start] {
            b'{' | b'}' | b'[' | b']' => 1,
            b'"' => string_end(&self.text[start..]),
            _ => {
                let ends = |b: &u8| matches!(b, b' ' | b'\t' | b'\n' | b'\r' | b',' | b':' | b'}' | b']');
                self.text[start..].iter().position(ends).unwrap_or(self.text.len() - start)
            }
        };
        Some((start, matches!(self.text[start], b'}' | b']')))
    }
}

/// Behind the closing quote of the string that `text` begins with.
fn string_end(text: &[u8]) -> usize {
    let mut at = 1;
    while at < text.len() && text[at] != b'"' {
        at += if text[at] == b'\\' { 2 } else { 1 };
    }
    (at + 1).min(text.len())
}

#[cfg(test)]
mod tests;
