//! The lines of OBJ and MTL texts: decoded, joined where a `\` continues them, without comments, with their numbers.

use crate::import::findings::{At, Findings};
use std::borrow::Cow;

/// One statement: a keyword and what follows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Statement<'a> {
    /// The line on which it begins, from 1.
    pub(super) line: u32,
    text: Cow<'a, str>,
}

impl Statement<'_> {
    /// The keyword and the rest, both trimmed.
    pub(super) fn split(&self) -> (&str, &str) {
        let (word, rest) = self.text.split_once(char::is_whitespace).unwrap_or((&self.text, ""));
        (word, rest.trim())
    }
}

/// Decodes a text; bytes that are not UTF-8 become U+FFFD with a warning.
pub(super) fn decode<'a>(file: &str, bytes: &'a [u8], findings: &mut Findings) -> Option<Cow<'a, str>> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        findings.error(At::line(file, 1), "the text is UTF-16; save it as UTF-8");
        return None;
    }
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        findings.error(At::line(file, line_of(bytes, at)), "the file has NUL bytes, so it is not a text");
        return None;
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Some(Cow::Borrowed(text)),
        Err(e) => {
            findings.warn(At::line(file, line_of(bytes, e.valid_up_to())), "the text is not UTF-8; its odd bytes were replaced by U+FFFD");
            Some(String::from_utf8_lossy(bytes))
        }
    }
}

fn line_of(bytes: &[u8], at: usize) -> u32 {
    1 + bytes[..at].iter().filter(|b| **b == b'\n').count() as u32
}

/// The lines of a text with their numbers, from 1. They end with LF, CR LF or CR.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (u32, &str)> {
    Lines { rest: text, line: 0 }
}

/// The statements of a text, in order.
pub(super) fn statements(text: &str) -> impl Iterator<Item = Statement<'_>> {
    let mut lines = lines(text).map(|(line, text)| (line, without_comment(text).trim_end()));
    std::iter::from_fn(move || {
        loop {
            let (line, first) = lines.next()?;
            let mut text = Cow::Borrowed(first);
            if first.ends_with('\\') {
                let mut joined = first.to_owned();
                // Joined in place: a file of nothing but continued lines is one statement, and each of its bytes is copied once.
                while joined.ends_with('\\') {
                    joined.pop();
                    joined.push(' ');
                    joined.push_str(lines.next().map_or("", |(_, next)| next));
                }
                text = Cow::Owned(joined);
            }
            if !text.trim().is_empty() {
                let text = match text {
                    Cow::Borrowed(t) => Cow::Borrowed(t.trim()),
                    Cow::Owned(t) => Cow::Owned(t.trim().to_owned()),
                };
                return Some(Statement { line, text });
            }
        }
    })
}

/// Physical lines without their ends.
struct Lines<'a> {
    rest: &'a str,
    line: u32,
}

impl<'a> Iterator for Lines<'a> {
    type Item = (u32, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
        let (line, tail) = self.rest.split_at(end);
        self.rest = tail.strip_prefix("\r\n").or_else(|| tail.get(1..)).unwrap_or("");
        self.line += 1;
        Some((self.line, line))
    }
}

/// A `#` begins a comment at the start of a word only: names like `wall#2` are common.
pub(super) fn without_comment(line: &str) -> &str {
    let mut previous = ' ';
    for (at, c) in line.char_indices() {
        if c == '#' && previous.is_whitespace() {
            return &line[..at];
        }
        previous = c;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<(u32, String, String)> {
        statements(text)
            .map(|s| {
                let (word, rest) = s.split();
                (s.line, word.to_owned(), rest.to_owned())
            })
            .collect()
    }

    #[test]
    fn line_ends_comments_and_continuations() {
        let text = "# head \\\r\nv\t1 2 \\\r\n 3 # tail\r\n\n  usemtl a#b \r f 1 \\\n2 \\\n3\nend\\";
        let expected = [(2, "v", "1 2   3"), (5, "usemtl", "a#b"), (6, "f", "1  2  3"), (9, "end", "")];
        let found = all(text);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((line, word, rest), (l, w, r)) in found.iter().zip(expected) {
            assert_eq!((*line, word.as_str()), (l, w));
            assert_eq!(rest.split_whitespace().collect::<Vec<_>>(), r.split_whitespace().collect::<Vec<_>>());
        }
    }

    /// Joined one by one, these would be copied to the square of their number: 45 GB.
    #[test]
    fn many_continued_lines_are_one_statement() {
        let found = all(&format!("f{}1", " 1 \\\n".repeat(300_000)));
        assert_eq!((found.len(), found[0].0, found[0].2.split_whitespace().count()), (1, 1, 300_001));
    }

    #[test]
    fn texts_that_are_none_are_refused_and_odd_bytes_replaced() {
        let mut findings = Findings::default();
        assert!(decode("a", b"\xff\xfev\0", &mut findings).is_none());
        assert!(decode("a", b"v 0\n\0", &mut findings).is_none());
        let errors = findings.into_errors("a");
        assert_eq!(errors.iter().map(|e| e.line).collect::<Vec<_>>(), [Some(1), Some(2)]);
        let mut findings = Findings::default();
        assert_eq!(decode("a", b"\xef\xbb\xbfv\no \xe9", &mut findings).unwrap(), "v\no \u{fffd}");
        assert_eq!(findings.into_warnings()[0].line, Some(2));
    }
}
