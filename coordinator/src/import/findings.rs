//! What an import has to say: errors and warnings with their places, bounded so that a hostile file cannot make a gigabyte of complaints.

use crate::records::Problem;
use std::collections::{BTreeMap, BTreeSet};

/// Errors kept; the import stops reading soon after the last.
const MAX_ERRORS: usize = 20;
/// Warnings kept.
const MAX_WARNINGS: usize = 100;

/// A place in the bundle.
#[derive(Debug, Clone, Copy)]
pub(super) struct At<'a> {
    file: &'a str,
    line: Option<u32>,
    column: Option<u32>,
}

impl<'a> At<'a> {
    /// A line, from 1, of a file.
    pub(super) fn line(file: &'a str, line: u32) -> Self {
        Self { file, line: Some(line), column: None }
    }

    /// A file as a whole.
    pub(super) fn file(file: &'a str) -> Self {
        Self { file, line: None, column: None }
    }

    /// A column, from 1, of a line, from 1. It is said in the message: a [`Problem`] has lines.
    pub(super) fn column(file: &'a str, line: u32, column: u32) -> Self {
        Self { file, line: Some(line), column: Some(column) }
    }

    /// A problem here.
    pub(super) fn problem(self, message: impl Into<String>) -> Problem {
        let message = message.into();
        let message = if let Some(column) = self.column { format!("column {column}: {message}") } else { message };
        Problem { message, file: Some(self.file.to_owned()), line: self.line }
    }
}

/// Errors and warnings of one import.
#[derive(Debug, Default)]
pub(super) struct Findings {
    errors: Vec<Problem>,
    warnings: Vec<Problem>,
    /// Warnings cut off at [`MAX_WARNINGS`].
    unsaid: usize,
    /// Warnings that are said once with a count, by their words: the first place, with what stands before the words, and how many.
    counted: BTreeMap<&'static str, (Problem, u64)>,
    /// What was already said once.
    said: BTreeSet<String>,
}

impl Findings {
    pub(super) fn error(&mut self, at: At<'_>, message: impl Into<String>) {
        self.push_error(at.problem(message));
    }

    pub(super) fn push_error(&mut self, problem: Problem) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(problem);
        }
    }

    pub(super) fn warn(&mut self, at: At<'_>, message: impl Into<String>) {
        self.warn_lazily(|| (at, message.into()));
    }

    /// Warns where there is still room: `make` finds the place and the words, which may cost more than the warning is worth, only then.
    pub(super) fn warn_lazily<'a>(&mut self, make: impl FnOnce() -> (At<'a>, String)) {
        if self.warnings.len() < MAX_WARNINGS {
            let (at, message) = make();
            self.warnings.push(at.problem(message));
        } else {
            self.unsaid += 1;
        }
    }

    /// Warns at the first place where `key` happens in this file, and is silent afterwards.
    pub(super) fn warn_once(&mut self, at: At<'_>, key: &str, message: impl Into<String>) {
        self.warn_once_lazily(at.file, key, || (at, message.into()));
    }

    /// The same for a place in `file` and words that are found only where they are said.
    pub(super) fn warn_once_lazily<'a>(&mut self, file: &str, key: &str, make: impl FnOnce() -> (At<'a>, String)) {
        let key = format!("{file}\n{key}");
        if self.said.contains(&key) {
            return;
        }
        // Where there is no room for further keys, their warnings are not told apart and all count.
        if self.said.len() < MAX_WARNINGS {
            self.said.insert(key);
            self.warn_lazily(make);
        } else {
            self.unsaid += 1;
        }
    }

    /// Counts something that may happen a million times; reported as `what: N, the first here`.
    pub(super) fn count(&mut self, at: At<'_>, what: &'static str) {
        self.count_lazily(what, 1, || (at, String::new()));
    }

    /// Counts `number` of them at once. `first` finds the place, and what is said before the words, only where these are the first.
    pub(super) fn count_lazily<'a>(&mut self, what: &'static str, number: u64, first: impl FnOnce() -> (At<'a>, String)) {
        if number > 0 {
            let first = || {
                // Where in its line the first of many stands tells nothing of the others.
                let (At { file, line, .. }, before) = first();
                (Problem { message: before, file: Some(file.to_owned()), line }, 0)
            };
            self.counted.entry(what).or_insert_with(first).1 += number;
        }
    }

    /// Makes errors of all warnings so far: where nothing is left, what was left out is the reason.
    pub(super) fn promote(&mut self) {
        let warnings = std::mem::take(self).into_parts();
        self.errors = warnings.0;
        warnings.1.into_iter().for_each(|w| self.push_error(w));
    }

    fn into_parts(mut self) -> (Vec<Problem>, Vec<Problem>) {
        let errors = std::mem::take(&mut self.errors);
        (errors, self.into_warnings())
    }

    pub(super) fn has_errors(&self) -> bool {
        !self.errors.is_empty()
    }

    /// Whether further reading would only find errors that nobody is told.
    pub(super) fn is_full(&self) -> bool {
        self.errors.len() >= MAX_ERRORS
    }

    /// The warnings in the order found, then the counted ones.
    pub(super) fn into_warnings(self) -> Vec<Problem> {
        let mut warnings = self.warnings;
        for (what, (first, count)) in self.counted {
            let before = &first.message;
            let message = if count == 1 { format!("{before}{what}: 1, here") } else { format!("{before}{what}: {count}, the first here") };
            warnings.push(Problem { message, ..first });
        }
        if self.unsaid > 0 {
            warnings.push(Problem::new(format!("{} further warnings are not listed", self.unsaid)));
        }
        warnings
    }

    /// The errors by file and line; at least one, about `file`, so that a refusal is never silent.
    pub(super) fn into_errors(self, file: &str) -> Vec<Problem> {
        let mut errors = self.errors;
        errors.sort_by(|a, b| (&a.file, a.line).cmp(&(&b.file, b.line)));
        if errors.is_empty() {
            errors.push(At::file(file).problem("the scene could not be imported"));
        } else if errors.len() == MAX_ERRORS {
            errors.push(At::file(file).problem(format!("reading stopped after {MAX_ERRORS} errors; there may be more")));
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_once_counts_beyond_the_last_key() {
        let mut findings = Findings::default();
        for key in 0..MAX_WARNINGS + 3 {
            for _ in 0..2 {
                findings.warn_once(At::file("a"), &key.to_string(), "odd");
            }
        }
        let warnings = findings.into_warnings();
        assert_eq!(warnings.len(), MAX_WARNINGS + 1);
        assert_eq!(warnings[MAX_WARNINGS].message, "6 further warnings are not listed");
    }

    #[test]
    fn what_is_counted_is_said_however_much_else_was() {
        let mut findings = Findings::default();
        (0..MAX_WARNINGS).for_each(|i| findings.warn(At::file("a"), i.to_string()));
        findings.count(At::column("a", 2, 7), "odd");
        findings.count_lazily("even", 0, || unreachable!());
        for _ in 0..2 {
            findings.count_lazily("even", 3, || (At::line("b", 5), "/here: ".to_owned()));
        }
        let warnings: Vec<String> = findings.into_warnings()[MAX_WARNINGS..].iter().map(ToString::to_string).collect();
        assert_eq!(warnings, ["b:5: /here: even: 6, the first here", "a:2: odd: 1, here"]);
    }
}
