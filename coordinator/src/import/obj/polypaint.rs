//! ZBrush's polypaint: colours of all vertices in comments, `#MRGB` and eight digits for each (mask, red, green, blue), 64 a line.
//!
//! A comment means nothing to the format, but this is the only place where that program writes its colours, and whoever exports them wants
//! them. Masks say where sculpting is forbidden and are left out.

use crate::import::findings::{At, Findings};

/// The colours of a text in order, coded for the eye, and the line of the first; nothing where it has none or they are broken, which is said.
pub(super) fn read(file: &str, text: &str, findings: &mut Findings) -> Option<(u32, Vec<[f32; 3]>)> {
    if !text.contains("#MRGB") {
        return None;
    }
    let (mut colours, mut first) = (vec![], None);
    for (line, paint) in (1..).zip(text.lines()).filter_map(|(line, text)| Some((line, text.trim().strip_prefix("#MRGB ")?))) {
        first.get_or_insert(line);
        for digits in paint.split_whitespace().flat_map(|word| word.as_bytes().chunks(8)) {
            let Some(colour) = colour(digits) else {
                findings
                    .warn(At::line(file, line), "polypaint (#MRGB) is not written in eight hexadecimal digits a vertex; it was ignored");
                return None;
            };
            colours.push(colour);
        }
    }
    Some((first?, colours))
}

fn colour(digits: &[u8]) -> Option<[f32; 3]> {
    let value = u32::from_str_radix(std::str::from_utf8(digits).ok().filter(|d| d.len() == 8)?, 16).ok()?;
    Some([value >> 16, value >> 8, value].map(|v| (v & 255) as f32 / 255.0))
}
