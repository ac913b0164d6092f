//! ZBrush's polypaint: colours of all vertices in comments, `#MRGB` and eight digits for each (mask, red, green, blue), 64 a line.
//!
//! A comment means nothing to the format, but this is the only place where that program writes its colours, and whoever exports them wants
//! them. Masks say where sculpting is forbidden and are left out.

use super::text;
use crate::import::findings::{At, Findings};

/// The paint of a text.
pub(super) struct Paint {
    /// The line of the first colour.
    pub(super) line: u32,
    /// How many colours there are.
    pub(super) found: usize,
    /// The first of them, in order, coded for the eye.
    pub(super) colours: Vec<[f32; 3]>,
}

/// The paint of a text with so many vertices; nothing where it has none or it is broken, which is said.
pub(super) fn read(file: &str, text: &str, vertices: usize, findings: &mut Findings) -> Option<Paint> {
    if !text.contains("#MRGB") {
        return None;
    }
    let lines = || text::lines(text).filter_map(|(line, text)| Some((line, text.trim().strip_prefix("#MRGB ")?)));
    let found: usize = lines().flat_map(|(_, paint)| paint.split_whitespace()).map(|word| word.len().div_ceil(8)).sum();
    let mut colours = Vec::with_capacity(found.min(vertices));
    for (line, paint) in lines() {
        for digits in paint.split_whitespace().flat_map(|word| word.as_bytes().chunks(8)) {
            let Some(colour) = colour(digits) else {
                findings
                    .warn(At::line(file, line), "polypaint (#MRGB) is not written in eight hexadecimal digits a vertex; it was ignored");
                return None;
            };
            // What no vertex has is read, so that it is told where it is broken, and not kept.
            if colours.len() < vertices {
                colours.push(colour);
            }
        }
    }
    let (line, _) = lines().next()?;
    Some(Paint { line, found, colours })
}

fn colour(digits: &[u8]) -> Option<[f32; 3]> {
    let value = u32::from_str_radix(std::str::from_utf8(digits).ok().filter(|d| d.len() == 8)?, 16).ok()?;
    Some([value >> 16, value >> 8, value].map(|v| (v & 255) as f32 / 255.0))
}
