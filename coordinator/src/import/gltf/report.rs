//! What there is to say of a glTF file: every fault is told with its JSON pointer and, in a text, its line.
//!
//! A pointer costs a walk over the siblings on its path, so it is made only for what is told: of the same fault at the same place the
//! first, of warnings as many as are kept. A list of a million faults costs no more than the list.

use super::json::Json;
use crate::{
    import::findings::{At, Findings},
    records::Problem,
};
use std::collections::BTreeSet;

/// Errors and warnings of one glTF file.
pub(super) struct Report<'f> {
    place: Place<'f>,
    findings: &'f mut Findings,
    /// Errors so far, by value and words: what several readers run into is told once. Bounded by the number of errors kept.
    told: BTreeSet<(u32, String)>,
}

/// How places of a glTF file are told.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place<'f> {
    file: &'f str,
    /// Whether lines mean something: the JSON is the file itself, not a chunk of it.
    has_lines: bool,
}

impl<'f> Place<'f> {
    /// The place of a value.
    fn at(self, json: Json<'_>) -> At<'f> {
        if self.has_lines { At::line(self.file, json.line()) } else { At::file(self.file) }
    }

    /// An error at a value, for who may say what went wrong only later.
    pub(super) fn problem(self, json: Json<'_>, message: &str) -> Problem {
        self.at(json).problem(located(json, message))
    }
}

impl<'f> Report<'f> {
    pub(super) fn new(file: &'f str, has_lines: bool, findings: &'f mut Findings) -> Self {
        Self { place: Place { file, has_lines }, findings, told: BTreeSet::new() }
    }

    /// How places of this file are told.
    pub(super) fn place(&self) -> Place<'f> {
        self.place
    }

    /// The findings with a place for code that serves several formats.
    pub(super) fn raw(&mut self, json: Json<'_>) -> (At<'f>, &mut Findings) {
        (self.place.at(json), self.findings)
    }

    /// Something that must be mended.
    pub(super) fn error(&mut self, json: Json<'_>, message: impl AsRef<str>) {
        if !self.findings.is_full() {
            let message = message.as_ref();
            if self.told.insert((json.id(), message.to_owned())) {
                self.findings.error(self.place.at(json), located(json, message));
            }
        }
    }

    /// An error that the bundle has already located.
    pub(super) fn push_error(&mut self, problem: Problem) {
        self.findings.push_error(problem);
    }

    /// An error of the file as a whole.
    pub(super) fn error_in_file(&mut self, message: impl Into<String>) {
        self.findings.error(At::file(self.place.file), message);
    }

    /// An error of a line of the file.
    pub(super) fn error_at_line(&mut self, line: u32, message: impl Into<String>) {
        let at = if self.place.has_lines { At::line(self.place.file, line) } else { At::file(self.place.file) };
        self.findings.error(at, message);
    }

    /// A warning of the file as a whole.
    pub(super) fn warn_in_file(&mut self, message: impl Into<String>) {
        self.findings.warn(At::file(self.place.file), message);
    }

    /// Something that was repaired, ignored or approximated.
    pub(super) fn warn(&mut self, json: Json<'_>, message: impl AsRef<str>) {
        let place = self.place;
        self.findings.warn_lazily(|| (place.at(json), located(json, message.as_ref())));
    }

    /// The same, said at its first place only.
    pub(super) fn warn_once(&mut self, json: Json<'_>, key: &str, message: impl AsRef<str>) {
        let place = self.place;
        self.findings.warn_once_lazily(place.file, key, || (place.at(json), located(json, message.as_ref())));
    }

    /// Counts something that may happen a million times.
    pub(super) fn count(&mut self, json: Json<'_>, what: &'static str) {
        self.count_many(json, what, 1);
    }

    /// Counts `number` of them at once.
    pub(super) fn count_many(&mut self, json: Json<'_>, what: &'static str, number: u64) {
        let place = self.place;
        self.findings.count_lazily(what, number, || (place.at(json), located(json, "")));
    }

    /// Whether further reading would only find errors that nobody is told.
    pub(super) fn is_full(&self) -> bool {
        self.findings.is_full()
    }

    /// Whether there were errors.
    pub(super) fn has_errors(&self) -> bool {
        self.findings.has_errors()
    }
}

fn located(json: Json<'_>, message: &str) -> String {
    let pointer = json.pointer();
    if pointer.is_empty() { message.to_owned() } else { format!("{pointer}: {message}") }
}
