//! What there is to say of a glTF file: every fault is told with its JSON pointer and, in a text, its line.
//!
//! A pointer costs a walk over the siblings on its path, so it is made only for what is told: of the same fault at the same place the first,
//! of warnings as many as are kept. A list of a million faults costs no more than the list.

use super::json::Json;
use crate::{
    import::findings::{At, Findings},
    records::Problem,
};
use std::collections::{BTreeMap, BTreeSet};

/// Errors and warnings of one glTF file.
pub(super) struct Report<'f> {
    file: &'f str,
    /// Whether lines mean something: the JSON is the file itself, not a chunk of it.
    has_lines: bool,
    findings: &'f mut Findings,
    /// Errors so far, by value and words: what several readers run into is told once. Bounded by the number of errors kept.
    told: BTreeSet<(u32, String)>,
    /// The keys of warnings that are said once.
    once: BTreeSet<String>,
    /// Warnings said once with a number: the first place and how many.
    counts: BTreeMap<&'static str, (String, Option<u32>, u64)>,
}

impl<'f> Report<'f> {
    pub(super) fn new(file: &'f str, has_lines: bool, findings: &'f mut Findings) -> Self {
        Self { file, has_lines, findings, told: BTreeSet::new(), once: BTreeSet::new(), counts: BTreeMap::new() }
    }

    /// The findings with a place for code that serves several formats.
    pub(super) fn raw(&mut self, json: Json<'_>) -> (At<'f>, &mut Findings) {
        (place(self.file, self.has_lines, json), self.findings)
    }

    /// Something that must be mended.
    pub(super) fn error(&mut self, json: Json<'_>, message: impl AsRef<str>) {
        if !self.findings.is_full() {
            let message = message.as_ref();
            if self.told.insert((json.id(), message.to_owned())) {
                self.findings.error(place(self.file, self.has_lines, json), located(&json.pointer(), message));
            }
        }
    }

    /// An error that the bundle has already located.
    pub(super) fn push_error(&mut self, problem: Problem) {
        self.findings.push_error(problem);
    }

    /// An error of the file as a whole.
    pub(super) fn error_in_file(&mut self, message: impl Into<String>) {
        self.findings.error(At::file(self.file), message);
    }

    /// An error of a line of the file.
    pub(super) fn error_at_line(&mut self, line: u32, message: impl Into<String>) {
        let at = if self.has_lines { At::line(self.file, line) } else { At::file(self.file) };
        self.findings.error(at, message);
    }

    /// A warning of the file as a whole.
    pub(super) fn warn_in_file(&mut self, message: impl Into<String>) {
        self.findings.warn(At::file(self.file), message);
    }

    /// Something that was repaired, ignored or approximated.
    pub(super) fn warn(&mut self, json: Json<'_>, message: impl AsRef<str>) {
        self.findings.warn_lazily(|| (place(self.file, self.has_lines, json), located(&json.pointer(), message.as_ref())));
    }

    /// The same, said at its first place only; keys are kept while there is room for what they stand for.
    pub(super) fn warn_once(&mut self, json: Json<'_>, key: &str, message: impl AsRef<str>) {
        if !self.once.contains(key) {
            if self.findings.takes_warnings() {
                self.once.insert(key.to_owned());
            }
            self.warn(json, message);
        }
    }

    /// Counts something that may happen a million times.
    pub(super) fn count(&mut self, json: Json<'_>, what: &'static str) {
        self.count_many(json, what, 1);
    }

    /// Counts `number` of them at once.
    pub(super) fn count_many(&mut self, json: Json<'_>, what: &'static str, number: u64) {
        if number > 0 {
            let has_lines = self.has_lines;
            let first = || (json.pointer(), has_lines.then(|| json.line()), 0);
            self.counts.entry(what).or_insert_with(first).2 += number;
        }
    }

    /// Says what was counted.
    pub(super) fn finish(self) {
        for (what, (pointer, line, count)) in self.counts {
            let at = line.map_or(At::file(self.file), |line| At::line(self.file, line));
            let first = if count == 1 { "" } else { ", the first here" };
            self.findings.warn(at, located(&pointer, &format!("{what}: {count}{first}")));
        }
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

fn place<'f>(file: &'f str, has_lines: bool, json: Json<'_>) -> At<'f> {
    if has_lines { At::line(file, json.line()) } else { At::file(file) }
}

fn located(pointer: &str, message: &str) -> String {
    if pointer.is_empty() { message.to_owned() } else { format!("{pointer}: {message}") }
}
