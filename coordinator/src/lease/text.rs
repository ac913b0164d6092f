//! What the texts of stored values have in common: runs of tiles as `3` or `3-7`, bounds included, and lists with one separator.

use kiln_proto::tile::TileRun;

/// A text that this program never wrote.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found `{found}`")]
pub struct BadText {
    /// What was expected, for the sentence.
    pub expected: &'static str,
    /// The beginning of what was found.
    pub found: String,
}

impl BadText {
    /// A text that is not what was expected.
    pub(super) fn new(expected: &'static str, found: &str) -> Self {
        Self { expected, found: found.chars().take(200).collect() }
    }
}

/// A run that is not empty, as text.
pub(super) fn run_text(run: TileRun) -> String {
    if run.len() == 1 { run.start.to_string() } else { format!("{}-{}", run.start, run.end.saturating_sub(1)) }
}

/// The inverse of [`run_text`].
pub(super) fn parse_run(text: &str) -> Option<TileRun> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let run = TileRun { start: number(first)?, end: number(last)?.checked_add(1)? };
    (!run.is_empty() && (run.len() == 1) != text.contains('-')).then_some(run)
}

/// A number as this program writes it: digits alone, none in vain.
pub(super) fn number(text: &str) -> Option<u64> {
    let plain = text.bytes().all(|b| b.is_ascii_digit()) && (text == "0" || !text.starts_with('0'));
    if plain { text.parse().ok() } else { None }
}

/// The parts of a list; none for the empty text.
pub(super) fn parts(text: &str, separator: char) -> impl Iterator<Item = &str> {
    text.split(separator).filter(move |_| !text.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_have_one_text_each() {
        for (run, text) in [(TileRun { start: 3, end: 4 }, "3"), (TileRun { start: 0, end: 8 }, "0-7")] {
            assert_eq!((run_text(run).as_str(), parse_run(text)), (text, Some(run)));
        }
        for bad in ["", "x", "3-", "-3", "5-2", "3-3", "+3", "03", "0-18446744073709551615"] {
            assert_eq!(parse_run(bad), None, "{bad}");
        }
    }
}
