//! The text of a simple value becomes the value that the table says it is, in any of the encodings.
//!
//! Numbers are read straight into the width they are kept in, so `0.1` is the nearest 32-bit number and not the nearest to a 64-bit one.
//! What is too much is dropped and remarked; what is missing or no number is a fault, because a default in its place would bake something
//! that nobody drew.

use super::value::{Base, FieldType, Store, Value};
use std::sync::Arc;

/// How strings and booleans are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    /// ClassicVRML and VRML97: strings in quotes, `#` comments.
    Classic,
    /// An attribute: one string bare, several in quotes.
    Xml,
    /// A JSON value.
    Json,
}

/// Something about a text, at a byte of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Fault {
    pub(super) at: usize,
    pub(super) message: String,
}

fn fault<T>(at: usize, message: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { at, message: message.into() })
}

/// A value, and what was wrong with its text without spoiling it.
pub(super) type Parsed = (Value, Option<Fault>);

/// Reads a value of type `ty` (not of nodes) from `text`.
///
/// # Errors
/// Text that is no such value, with the byte at which it stops being one.
pub(super) fn parse(ty: FieldType, text: &str, form: Form) -> Result<Parsed, Fault> {
    if form == Form::Json && ty.store() != Store::Strings && text.trim_start().starts_with('"') {
        // Older converters write numbers as the string that the XML encoding would have.
        let inner = serde_json::from_str::<String>(text).or_else(|e| fault(0, e.to_string()))?;
        return parse(ty, &inner, Form::Xml).map_err(|f| Fault { at: 0, ..f });
    }
    match ty.store() {
        Store::Strings => strings(ty, text, form),
        Store::Floats => numbers(ty, text, form, float).map(|(v, remark)| (Value::Floats(v.into()), remark)),
        Store::Doubles => numbers(ty, text, form, double).map(|(v, remark)| (Value::Doubles(v.into()), remark)),
        Store::Ints => match ty.base {
            Base::Bool => numbers(ty, text, form, boolean).map(|(v, remark)| (Value::Ints(v.into()), remark)),
            Base::Image => images(ty, text, form),
            _ => numbers(ty, text, form, integer).map(|(v, remark)| (Value::Ints(v.into()), remark)),
        },
        Store::Nodes if text.trim().is_empty() => Ok((ty.zero(), None)),
        Store::Nodes => fault(0, format!("a value where a node should be ({ty})")),
    }
}

/// What stands between words: blanks, commas and, in JSON, brackets.
fn is_blank(c: char, form: Form) -> bool {
    c.is_ascii_whitespace() || c == ',' || (c == '[' || c == ']') && form == Form::Json
}

/// The first byte from `at` on that is neither blank nor comment.
fn skip_blanks(text: &str, mut at: usize, form: Form) -> Option<usize> {
    loop {
        at += text[at..].find(|c| !is_blank(c, form))?;
        if form != Form::Classic || !text[at..].starts_with('#') {
            return Some(at);
        }
        at += text[at..].find(['\n', '\r']).unwrap_or(text.len() - at);
    }
}

/// The words of a text with their places; commas count as blanks, as do the brackets of JSON.
pub(super) fn words(text: &str, form: Form) -> impl Iterator<Item = (usize, &str)> {
    let ends = move |c: char| is_blank(c, form) || form == Form::Classic && c == '#';
    let mut at = 0;
    std::iter::from_fn(move || {
        let start = skip_blanks(text, at, form)?;
        let end_from = |from: usize| text[from..].find(ends).map_or(text.len(), |e| from + e);
        at = end_from(start);
        if is_no_number(&text[start..at], &text[at..]) {
            at = end_from(at + 1);
        }
        Some((start, &text[start..at]))
    })
}

/// Whether a word goes on behind a `#` that begins no comment: `1.#QNAN` is how the C library of Windows writes what is no number, and so
/// do the exporters that use it.
pub(super) fn is_no_number(word: &str, rest: &str) -> bool {
    word.ends_with('.') && ["#QNAN", "#SNAN", "#IND", "#INF"].iter().any(|kind| rest.starts_with(kind))
}

/// The beginning of a word, for messages.
pub(super) fn shown(word: &str) -> String {
    word.chars().take(40).collect()
}

/// Some addresses, for messages.
pub(super) fn shown_addresses(urls: &[Arc<str>]) -> String {
    let urls: Vec<String> = urls.iter().take(4).map(|u| format!("`{}`", u.chars().take(200).collect::<String>())).collect();
    urls.join(", ")
}

fn numbers<T: Copy>(
    ty: FieldType,
    text: &str,
    form: Form,
    read: fn(&str) -> Result<T, &'static str>,
) -> Result<(Vec<T>, Option<Fault>), Fault> {
    let (found, width) = (words(text, form).count(), ty.width());
    let wanted = if ty.many { found - found % width } else { width };
    if found < wanted {
        return fault(0, format!("{found} of the {width} values that {ty} has"));
    }
    let mut values = Vec::with_capacity(wanted);
    let mut remark = None;
    for (number, (at, word)) in words(text, form).enumerate() {
        match read(word) {
            Ok(value) if number < wanted => values.push(value),
            Ok(_) => {
                let message = if ty.many {
                    format!("{found} values, which is no multiple of {width}; the last {} were dropped", found - wanted)
                } else {
                    format!("{found} values where {ty} has {width}; the others were dropped")
                };
                remark.get_or_insert(Fault { at, message });
            }
            Err(why) => return fault(at, format!("`{}`, which is {why} (value {} of {found})", shown(word), number + 1)),
        }
    }
    Ok((values, remark))
}

fn is_decimal(word: &str) -> bool {
    // Rust's own parser also takes `inf` and `nan`.
    word.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'+' | b'-' | b'.' | b'e' | b'E'))
}

fn float(word: &str) -> Result<f32, &'static str> {
    match word.parse::<f32>() {
        Ok(x) if is_decimal(word) => x.is_finite().then_some(x).ok_or("not finite in 32 bits"),
        _ => Err("no number"),
    }
}

fn double(word: &str) -> Result<f64, &'static str> {
    match word.parse::<f64>() {
        Ok(x) if is_decimal(word) => x.is_finite().then_some(x).ok_or("not finite"),
        _ => Err("no number"),
    }
}

fn boolean(word: &str) -> Result<i32, &'static str> {
    match word {
        w if w.eq_ignore_ascii_case("true") => Ok(1),
        w if w.eq_ignore_ascii_case("false") => Ok(0),
        _ => Err("neither true nor false"),
    }
}

fn integer(word: &str) -> Result<i32, &'static str> {
    match hexadecimal(word) {
        Some(bits) => Ok(bits as i32),
        None => word.parse().map_err(|_| "no whole number of 32 bits"),
    }
}

fn hexadecimal(word: &str) -> Option<u32> {
    let digits = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X"))?;
    (!digits.starts_with('+')).then(|| u32::from_str_radix(digits, 16).ok())?
}

/// Pixels take 32 bits without a sign, in hexadecimal or not.
fn pixel(word: &str) -> Result<i32, &'static str> {
    integer(word).or_else(|why| if word.starts_with('+') { Err(why) } else { word.parse::<u32>().map(|p| p as i32).map_err(|_| why) })
}

fn images(ty: FieldType, text: &str, form: Form) -> Result<Parsed, Fault> {
    let mut values = Vec::with_capacity(words(text, form).count());
    for (number, (at, word)) in words(text, form).enumerate() {
        // JSON has no hexadecimal numbers, which are put into quotes there.
        let bare = if form == Form::Json { word.trim_matches('"') } else { word };
        values.push(pixel(bare).or_else(|why| fault(at, format!("`{}`, which is {why} (value {})", shown(word), number + 1)))?);
    }
    let mut end = 0;
    while end < values.len() && (ty.many || end == 0) {
        let [width, height, components] = *values[end..].first_chunk().ok_or(()).or_else(|()| fault(0, "an image without its size"))?;
        let pixels = i64::from(width) * i64::from(height);
        if width < 0 || height < 0 || !(0..=4).contains(&components) {
            return fault(0, format!("an image of {width} x {height} pixels with {components} components"));
        }
        let there = values.len() - end - 3;
        if there as u64 <= i64::MAX as u64 && (there as i64) < pixels {
            return fault(0, format!("{there} of the {pixels} pixels of an image of {width} x {height}"));
        }
        end += 3 + pixels as usize;
    }
    if end == 0 && !ty.many {
        return Ok((ty.zero(), None));
    }
    let over = values.len() - end;
    values.truncate(end);
    let remark =
        (over > 0).then(|| Fault { at: 0, message: format!("{over} values more than the pixels of the image; they were dropped") });
    Ok((Value::Ints(values.into()), remark))
}

fn strings(ty: FieldType, text: &str, form: Form) -> Result<Parsed, Fault> {
    let (list, remark) = match form {
        Form::Json => json_strings(text)?,
        Form::Xml if !ty.many => (vec![Arc::from(text)], None),
        Form::Xml => attribute_strings(text)?,
        Form::Classic => (quoted(text, form)?, None),
    };
    if ty.many {
        return Ok((Value::Strings(list.into()), remark));
    }
    match list.as_slice() {
        [one] => Ok((Value::Strings([one.clone()].into()), remark)),
        [] => fault(0, "no string"),
        [first, ..] => {
            let message = format!("{} strings where {ty} has one; the others were dropped", list.len());
            Ok((Value::Strings([first.clone()].into()), Some(Fault { at: 0, message })))
        }
    }
}

type Strings = (Vec<Arc<str>>, Option<Fault>);

/// Several strings of an attribute. One without quotes is common and not ambiguous.
fn attribute_strings(text: &str) -> Result<Strings, Fault> {
    let trimmed = text.trim();
    if trimmed.is_empty() || trimmed.starts_with(['"', ',']) {
        return Ok((quoted(text, Form::Xml)?, None));
    }
    let message = "a list of strings without quotes, which was taken for one string".to_owned();
    Ok((vec![Arc::from(trimmed)], Some(Fault { at: 0, message })))
}

fn json_strings(text: &str) -> Result<Strings, Fault> {
    if text.trim_start().starts_with('[') {
        let list: Vec<String> = serde_json::from_str(text).or_else(|e| fault(0, e.to_string()))?;
        return Ok((list.into_iter().map(Arc::from).collect(), None));
    }
    match serde_json::from_str::<String>(text) {
        // The way of older converters again.
        Ok(one) if one.trim_start().starts_with('"') => Ok((quoted(&one, Form::Xml).map_err(|f| Fault { at: 0, ..f })?, None)),
        Ok(one) => Ok((vec![Arc::from(one)], None)),
        Err(_) => fault(0, format!("`{}` where a string should be", shown(text))),
    }
}

/// Strings in quotes with `\"` and `\\` inside them, blanks and commas between them.
fn quoted(text: &str, form: Form) -> Result<Vec<Arc<str>>, Fault> {
    let mut list = vec![];
    let mut at = 0;
    while let Some(start) = skip_blanks(text, at, form) {
        if !text[start..].starts_with('"') {
            return fault(start, format!("`{}` where a string in quotes should be", shown(&text[start..])));
        }
        let Some(length) = string_length(&text[start..]) else { return fault(start, "a string without its closing quote") };
        list.push(Arc::from(unescaped(&text[start + 1..start + length - 1])));
        at = start + length;
    }
    Ok(list)
}

/// Bytes of the string that `text` begins with, its quotes included; `None` where it has no end.
pub(super) fn string_length(text: &str) -> Option<usize> {
    let mut escaped = false;
    for (at, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return Some(at + 1),
            _ => {}
        }
    }
    None
}

fn unescaped(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        match rest.peek() {
            // A backslash before anything else is itself: `C:\tex` is common.
            Some('"' | '\\') if c == '\\' => plain.extend(rest.next()),
            _ => plain.push(c),
        }
    }
    plain
}

#[cfg(test)]
mod tests;
