//! Names that are safe as file names: letters, digits, `-`, `_` and `.`, no device names, and distinct even where case is ignored.

use std::collections::BTreeSet;

/// Longest stem, bytes: room for an ending on every file system.
const STEM_BYTES: usize = 100;
/// Names that some file systems reserve for devices.
const RESERVED: [&str; 6] = ["con", "prn", "aux", "nul", "com", "lpt"];

/// Hands out file stems, each once.
#[derive(Debug, Default)]
pub(super) struct Stems {
    taken: BTreeSet<String>,
}

impl Stems {
    /// Stems of which these are already taken.
    pub(super) fn of<'a>(taken: impl Iterator<Item = &'a str>) -> Self {
        Self { taken: taken.map(str::to_lowercase).collect() }
    }

    /// A stem for `name`: what is unsafe becomes `_`; a stem already taken gets `-2`, `-3`, … in the order of asking.
    pub(super) fn take(&mut self, name: &str) -> String {
        let base = sanitise(name);
        unique(&base, |candidate| self.taken.insert(candidate.to_lowercase()))
    }
}

/// `base`, or `base-2`, `base-3`, …: the first that `take` accepts.
pub(super) fn unique(base: &str, mut take: impl FnMut(&str) -> bool) -> String {
    let mut candidate = base.to_owned();
    let mut n = 2u64;
    while !take(&candidate) {
        candidate = format!("{base}-{n}");
        n += 1;
    }
    candidate
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
