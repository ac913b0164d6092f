//! Names that are safe as file names: letters, digits, `-`, `_` and `.`, no device names, and distinct even where case is ignored.

use std::collections::{BTreeMap, BTreeSet};

/// Longest stem, bytes: room for an ending on every file system.
const STEM_BYTES: usize = 100;
/// Names that some file systems reserve for devices.
const RESERVED: [&str; 6] = ["con", "prn", "aux", "nul", "com", "lpt"];

/// Hands out names, each once.
#[derive(Debug, Default)]
pub(super) struct Names {
    taken: BTreeSet<String>,
    /// Where the search for a free number goes on: ten thousand copies of one thing must not cost a hundred million look-ups.
    next: BTreeMap<String, u64>,
}

impl Names {
    /// Names of which these are already taken.
    pub(super) fn of<'a>(taken: impl Iterator<Item = &'a str>) -> Self {
        Self { taken: taken.map(str::to_owned).collect(), next: BTreeMap::new() }
    }

    /// `base`, or `base-2`, `base-3`, …: the first that is free, in the order of asking.
    pub(super) fn take(&mut self, base: &str) -> String {
        self.take_by(base, str::to_owned)
    }

    /// The same for names that are one where `key` makes them equal.
    fn take_by(&mut self, base: &str, key: impl Fn(&str) -> String) -> String {
        if self.taken.insert(key(base)) {
            return base.to_owned();
        }
        let next = self.next.entry(key(base)).or_insert(2);
        loop {
            let candidate = format!("{base}-{next}");
            *next += 1;
            if self.taken.insert(key(&candidate)) {
                return candidate;
            }
        }
    }
}

/// Hands out file stems, each once.
#[derive(Debug, Default)]
pub(super) struct Stems(Names);

impl Stems {
    /// Stems of which these are already taken.
    pub(super) fn of<'a>(taken: impl Iterator<Item = &'a str>) -> Self {
        Self(Names { taken: taken.map(str::to_lowercase).collect(), next: BTreeMap::new() })
    }

    /// A stem for `name`: what is unsafe becomes `_`; a stem already taken gets `-2`, `-3`, … in the order of asking.
    pub(super) fn take(&mut self, name: &str) -> String {
        self.0.take_by(&sanitise(name), str::to_lowercase)
    }
}

fn sanitise(name: &str) -> String {
    let safe = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    let mut stem: String = name.chars().map(safe).take(STEM_BYTES).collect();
    let leading = stem.len() - stem.trim_start_matches('.').len();
    stem.replace_range(..leading, &"_".repeat(leading));
    let word = stem.split('.').next().unwrap_or_default().trim_end_matches(|c: char| c.is_ascii_digit()).to_lowercase();
    if stem.is_empty() || RESERVED.contains(&word.as_str()) || stem.ends_with('.') {
        stem.push('_');
    }
    stem
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_and_their_number_costs_little() {
        let mut names = Names::of(["a", "a-3"].into_iter());
        assert_eq!(["a", "a", "b", "a-2", "b"].map(|n| names.take(n)), ["a-2", "a-4", "b", "a-2-2", "b-2"]);
        let last = (0..60_000).map(|_| names.take("leaf")).last();
        assert_eq!(last.as_deref(), Some("leaf-60000"));
    }

    #[test]
    fn stems_are_safe_and_distinct() {
        let mut stems = Stems::default();
        let mut take = |n: &str| stems.take(n);
        assert_eq!(take("floor"), "floor");
        assert_eq!(take("Floor"), "Floor-2");
        assert_eq!(take("floor"), "floor-3");
        assert_eq!(take("front cube"), "front_cube");
        assert_eq!(take("../etc/passwd"), "___etc_passwd");
        assert_eq!(take(""), "_");
        assert_eq!(take("COM1"), "COM1_");
        assert_eq!(take("Bodenplatte-ü"), "Bodenplatte-_");
        assert!(take(&"x".repeat(5_000)).len() <= STEM_BYTES);
    }
}
