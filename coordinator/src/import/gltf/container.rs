//! The outermost layer: a JSON text as it is, or the chunks of a binary glTF.

use super::report::Report;
use std::ops::Range;

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;

/// The parts of a file.
pub(super) struct Parts<'b> {
    /// The JSON text.
    pub(super) text: &'b str,
    /// The first binary chunk.
    pub(super) binary: Option<&'b [u8]>,
}

/// Whether a file of this name with these bytes is a binary glTF.
pub(super) fn is_binary(name: &str, bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) || (crate::import::format::extension(name) == "glb" && !bytes.trim_ascii_start().starts_with(b"{"))
}

/// Takes a file apart.
pub(super) fn open<'b>(name: &str, bytes: &'b [u8], report: &mut Report<'_>) -> Option<Parts<'b>> {
    let opened = if is_binary(name, bytes) { chunks(bytes, report) } else { Ok((0..bytes.len(), None)) };
    let (json, binary) = opened.map_err(|message| report.error_in_file(message)).ok()?;
    let mut json = &bytes[json];
    if is_binary(name, bytes) && json.ends_with(b"\0") {
        report.warn_in_file("the JSON is filled up with zeros, where glTF wants blanks; they were left out");
        json = &json[..json.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1)];
    }
    if json.starts_with(b"\xef\xbb\xbf") {
        report.error_in_file("the JSON begins with a byte order mark, which glTF forbids; save it as UTF-8 without one");
        return None;
    }
    match std::str::from_utf8(json) {
        Ok(text) => Some(Parts { text, binary: binary.map(|range| &bytes[range]) }),
        Err(e) => {
            report.error_in_file(format!("the JSON is not UTF-8: byte {} is no character", e.valid_up_to()));
            None
        }
    }
}

/// Where the JSON and the binary chunk of a binary glTF lie (glTF 2.0, section 4).
fn chunks(bytes: &[u8], report: &mut Report<'_>) -> Result<(Range<usize>, Option<Range<usize>>), String> {
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(version), Some(length)) = (word(4).filter(|_| bytes.starts_with(MAGIC)), word(8)) else {
        return Err("this is no binary glTF: it does not begin with the 12 bytes of its header (`glTF`, version, length)".to_owned());
    };
    if version != 2 {
        return Err(format!("this is binary glTF of version {version}; version 2 is read"));
    }
    let length = length as usize;
    if length < 20 || length > bytes.len() {
        return Err(format!("the header says that the file has {length} bytes; it has {}", bytes.len()));
    }
    if length < bytes.len() {
        report.warn_in_file(format!("{} bytes behind the end of the binary glTF were ignored", bytes.len() - length));
    }
    let (mut json, mut binary, mut at, mut index) = (None, None, 12, 0);
    while at < length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(format!("the file ends inside the header of chunk {index} at byte {at}"));
        };
        let range = at + 8..at + 8 + size as usize;
        if range.end > length {
            return Err(format!(
                "chunk {index} at byte {at} says that it has {size} bytes; only {} are left",
                length - range.start.min(length)
            ));
        }
        match (kind, index) {
            (JSON, 0) => json = Some(range.clone()),
            (_, 0) => return Err("the first chunk is not JSON".to_owned()),
            (BINARY, 1) => binary = Some(range.clone()),
            (JSON | BINARY, _) => return Err(format!("chunk {index} at byte {at} is a second JSON chunk or a binary chunk out of place")),
            _ => {}
        }
        if size % 4 != 0 {
            return Err(format!("chunk {index} at byte {at} has {size} bytes, which is no multiple of 4"));
        }
        (at, index) = (range.end, index + 1);
    }
    json.map(|json| (json, binary)).ok_or_else(|| "the file has no JSON chunk".to_owned())
}
