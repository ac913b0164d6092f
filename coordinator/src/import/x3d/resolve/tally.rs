//! What happens a thousand times and is said once: the first place and how often.

use crate::import::{
    findings::Findings,
    x3d::document::{Document, Place},
};
use std::collections::BTreeMap;

/// Different things counted; what comes later is counted as one.
const MOST: usize = 100;

#[derive(Debug, Default)]
pub(super) struct Tally {
    /// By their words: their number in `entries`.
    known: BTreeMap<String, usize>,
    entries: Vec<(String, Place, u64)>,
}

impl Tally {
    /// Counts `what`, which is to be read before `: N, the first here`.
    pub(super) fn add(&mut self, place: Place, what: String) {
        let what = if self.entries.len() < MOST || self.known.contains_key(&what) {
            what
        } else {
            "nodes and fields of further kinds were skipped".to_owned()
        };
        let next = self.entries.len();
        let index = *self.known.entry(what.clone()).or_insert(next);
        if index == next {
            self.entries.push((what, place, 0));
        }
        self.entries[index].2 += 1;
    }

    /// Says it, in the order in which it was first met.
    pub(super) fn report(self, document: &Document, findings: &mut Findings) {
        for (what, place, count) in self.entries {
            let said = if count == 1 { format!("{what}: 1, here") } else { format!("{what}: {count}, the first here") };
            findings.warn(document.at(place), said);
        }
    }
}
