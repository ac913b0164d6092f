//! How long the lists of a text become, so that each is made at once: one that grows takes up to three times what it holds while it moves.

use super::text;

/// How many statements and corners a text has at least: what a `\` continues is not counted, and lists grow for it.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    /// `v`, `vt` and `vn`.
    pub(super) vertices: [usize; 3],
    pub(super) faces: usize,
    pub(super) corners: usize,
}

/// Counts what a text has. Cost: a look at the first word of every line, and at all words of faces.
pub(super) fn count(text: &str) -> Counts {
    let mut counts = Counts::default();
    for (_, line) in text::lines(text) {
        let Some((word, rest)) = line.trim_start().split_once(char::is_whitespace) else { continue };
        match word {
            "v" => counts.vertices[0] += 1,
            "vt" => counts.vertices[1] += 1,
            "vn" => counts.vertices[2] += 1,
            "f" | "fo" => {
                counts.faces += 1;
                counts.corners += text::without_comment(rest).split_whitespace().count();
            }
            _ => {}
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statements_and_corners_are_counted_and_comments_are_not() {
        let text = "v 0 0 0\r\tv 1 0 0 # v 2\nvt 0 0\n#v 9\nvn 0 0 1\nf 1 2 3 # 4 5\r\nfo 1 2 3 4\nf\n";
        assert_eq!(count(text), Counts { vertices: [2, 1, 1], faces: 2, corners: 7 });
    }
}
