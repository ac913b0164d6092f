//! What glTF cannot say: counted, because it may be true of every one of ten thousand lights, and told with the first of them.

use crate::records::Problem;
use std::collections::BTreeMap;

/// What was left out or approximated, by what it is: whom it happened to first and how often.
#[derive(Debug, Default)]
pub(super) struct Notes(BTreeMap<&'static str, (String, u64)>);

impl Notes {
    /// Counts `what`, which happened to `whom`.
    pub(super) fn count(&mut self, what: &'static str, whom: &str) {
        self.0.entry(what).or_insert_with(|| (whom.to_owned(), 0)).1 += 1;
    }

    /// All of them as warnings, in the order of their words.
    pub(super) fn into_warnings(self) -> Vec<Problem> {
        let say = |(what, (whom, count)): (&str, (String, u64))| {
            let first = if count == 1 { format!("`{whom}`") } else { format!("the first is `{whom}`") };
            Problem::new(format!("{what}: {count}, {first}"))
        };
        self.0.into_iter().map(say).collect()
    }
}
