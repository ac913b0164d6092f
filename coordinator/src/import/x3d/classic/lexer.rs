//! The words of ClassicVRML and VRML97.
//!
//! A word ends where the standard's punctuation begins and nowhere else: exporters write names such as `Cube.001` and `MA_ü-2` that the
//! standard forbids, and every viewer reads them.

use crate::import::x3d::{
    document::Place,
    literal,
    syntax::{Locator, SyntaxError},
};
use std::ops::Range;

/// What stands at a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A name or a keyword.
    Name,
    /// Something that begins like a number.
    Number,
    /// A string with its quotes.
    String,
    /// One of `[ ] { }`.
    Mark(u8),
    End,
}

/// A token and its bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) range: Range<usize>,
}

/// Reads tokens, with one to look ahead.
#[derive(Debug)]
pub(super) struct Lexer<'a> {
    text: &'a str,
    locator: Locator<'a>,
    next: Token,
}

impl<'a> Lexer<'a> {
    pub(super) fn new(text: &'a str, file: u32) -> Result<Self, SyntaxError> {
        let mut lexer = Self { text, locator: Locator::new(text, file), next: Token { kind: Kind::End, range: 0..0 } };
        lexer.next = lexer.scan(0)?;
        Ok(lexer)
    }

    /// The token that comes next.
    pub(super) fn peek(&self) -> &Token {
        &self.next
    }

    /// Its text.
    pub(super) fn peek_text(&self) -> &'a str {
        &self.text[self.next.range.clone()]
    }

    /// Where it begins.
    pub(super) fn place(&mut self) -> Place {
        self.locator.place(self.next.range.start)
    }

    /// The text of the next token, which is passed by.
    pub(super) fn take(&mut self) -> Result<&'a str, SyntaxError> {
        let text = self.peek_text();
        self.next = self.scan(self.next.range.end)?;
        Ok(text)
    }

    /// The next token if it is this mark.
    pub(super) fn take_mark(&mut self, mark: u8) -> Result<bool, SyntaxError> {
        let found = self.next.kind == Kind::Mark(mark);
        if found {
            self.take()?;
        }
        Ok(found)
    }

    /// An error at the next token: what was expected there.
    pub(super) fn expected<T>(&mut self, what: &str) -> Result<T, SyntaxError> {
        let found = match self.next.kind {
            Kind::End => "the end of the file".to_owned(),
            _ => format!("`{}`", literal::shown(self.peek_text())),
        };
        Err(SyntaxError { place: self.place(), message: format!("expected {what}, found {found}") })
    }

    fn scan(&mut self, from: usize) -> Result<Token, SyntaxError> {
        let bytes = self.text.as_bytes();
        let mut at = from;
        loop {
            match bytes.get(at) {
                None => return Ok(Token { kind: Kind::End, range: at..at }),
                Some(b'#') => at += self.text[at..].find(['\n', '\r']).unwrap_or(bytes.len() - at),
                Some(b) if b.is_ascii_whitespace() || *b == b',' => at += 1,
                Some(mark @ (b'[' | b']' | b'{' | b'}')) => return Ok(Token { kind: Kind::Mark(*mark), range: at..at + 1 }),
                Some(b'"') => {
                    return match literal::string_length(&self.text[at..]) {
                        Some(length) => Ok(Token { kind: Kind::String, range: at..at + length }),
                        None => {
                            let place = self.locator.place(at);
                            Err(SyntaxError { place, message: "a string begins here and its closing quote is missing".to_owned() })
                        }
                    };
                }
                Some(first) => {
                    let kind = if first.is_ascii_digit() || matches!(first, b'+' | b'-' | b'.') { Kind::Number } else { Kind::Name };
                    let ends = |b: &u8| b.is_ascii_whitespace() || matches!(b, b',' | b'"' | b'#' | b'[' | b']' | b'{' | b'}');
                    let end_from = |from: usize| bytes[from..].iter().position(ends).map_or(bytes.len(), |e| from + e);
                    let mut end = end_from(at);
                    if literal::is_no_number(&self.text[at..end], &self.text[end..]) {
                        end = end_from(end + 1);
                    }
                    return Ok(Token { kind, range: at..end });
                }
            }
        }
    }
}
