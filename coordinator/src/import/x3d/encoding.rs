//! Which encoding a file is in, by its content, and its text.

use super::limits::MAX_INFLATION;
use flate2::read::MultiGzDecoder;
use kiln_proto::limits;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use std::{borrow::Cow, fmt, io::Read};

/// The encodings of X3D.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// ISO/IEC 19776-1.
    Xml,
    /// ISO/IEC 19776-2, and VRML97 (ISO/IEC 14772), of which it is an extension.
    Classic,
    /// ISO/IEC 19776-5.
    Json,
}

/// Why a file has no text to read.
#[derive(Debug, thiserror::Error)]
pub(super) enum EncodingError {
    #[error("this is VRML 1.0, which is not supported; convert it to VRML 97 or X3D")]
    Vrml1,
    #[error("this is neither X3D nor VRML: it begins with neither `#X3D`, `#VRML V2.0`, `<` nor `{{\"X3D\"`")]
    Other,
    #[error("this is X3D in the compressed binary encoding, which is not supported; save it as XML, ClassicVRML or JSON")]
    Binary,
    #[error("the gzip stream is broken: {0}")]
    Gzip(#[source] std::io::Error),
    #[error("the gzip stream expands to more than {0} bytes; unpack the file and send it as it is")]
    Inflation(u64),
    #[error("the UTF-16 text is broken; save it as UTF-8")]
    Utf16,
    #[error("the file has NUL bytes, so it is not a text")]
    Nul,
}

/// The text of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Decoded {
    pub(super) encoding: Encoding,
    pub(super) text: String,
    /// Whether bytes were replaced that are not UTF-8.
    pub(super) replaced: bool,
}

/// Whether this is X3D or VRML97 by its content, gzip or not.
pub(super) fn is_x3d(bytes: &[u8]) -> bool {
    let Ok(plain) = unpacked(bytes) else { return false };
    let Ok((text, _)) = text(&plain) else { return false };
    match encoding(&text) {
        Ok(Encoding::Xml) => super::xml::has_x3d_root(&text),
        other => other.is_ok(),
    }
}

/// Unpacks and decodes a file. Memory: the text, and the unpacked bytes while they are decoded.
pub(super) fn decode(bytes: &[u8]) -> Result<Decoded, EncodingError> {
    let plain = unpacked(bytes)?;
    let (text, replaced) = text(&plain)?;
    let encoding = encoding(&text)?;
    Ok(Decoded { encoding, text, replaced })
}

fn unpacked(bytes: &[u8]) -> Result<Cow<'_, [u8]>, EncodingError> {
    if !bytes.starts_with(b"\x1f\x8b") {
        return Ok(Cow::Borrowed(bytes));
    }
    let most = (bytes.len() as u64 * MAX_INFLATION + (1 << 20)).min(limits::TEXT_BYTES);
    let mut plain = vec![];
    MultiGzDecoder::new(bytes).take(most + 1).read_to_end(&mut plain).map_err(EncodingError::Gzip)?;
    if plain.len() as u64 > most { Err(EncodingError::Inflation(most)) } else { Ok(Cow::Owned(plain)) }
}

/// UTF-8, UTF-16 by its byte order mark, or the Latin alphabet where an XML declaration says so.
fn text(bytes: &[u8]) -> Result<(String, bool), EncodingError> {
    let units = |swap: bool| bytes[2..].chunks(2).map(move |p| if swap { [p[1 % p.len()], p[0]] } else { [p[0], p[1 % p.len()]] });
    let wide = |swap: bool| {
        let text = char::decode_utf16(units(swap).map(u16::from_le_bytes)).collect::<Result<String, _>>();
        text.map(|t| (t, false)).map_err(|_| EncodingError::Utf16)
    };
    if bytes.starts_with(b"\xff\xfe") {
        return wide(false);
    }
    if bytes.starts_with(b"\xfe\xff") {
        return wide(true);
    }
    if bytes.starts_with(b"\xe0\x00\x00\x01") {
        return Err(EncodingError::Binary);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if bytes.contains(&0) {
        return Err(EncodingError::Nul);
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok((text.to_owned(), false)),
        Err(_) if declares_latin(bytes) => Ok((bytes.iter().map(|b| char::from(*b)).collect(), false)),
        Err(_) => Ok((String::from_utf8_lossy(bytes).into_owned(), true)),
    }
}

fn declares_latin(bytes: &[u8]) -> bool {
    let head = bytes.get(..200.min(bytes.len())).unwrap_or_default().to_ascii_lowercase();
    let declaration = head.split(|b| *b == b'>').next().unwrap_or_default();
    let says = |name: &[u8]| declaration.windows(name.len()).any(|w| w == name);
    declaration.starts_with(b"<?xml") && (says(b"iso-8859-1") || says(b"windows-1252") || says(b"latin1"))
}

fn encoding(text: &str) -> Result<Encoding, EncodingError> {
    let text = text.trim_start();
    let starts = |magic: &str| text.get(..magic.len()).is_some_and(|head| head.eq_ignore_ascii_case(magic));
    match () {
        () if starts("#VRML V1") => Err(EncodingError::Vrml1),
        () if starts("#X3D") || starts("#VRML") => Ok(Encoding::Classic),
        () if starts("<") => Ok(Encoding::Xml),
        () if starts("{") && names_x3d(text) => Ok(Encoding::Json),
        () => Err(EncodingError::Other),
    }
}

/// Whether a JSON text is about X3D: glTF is JSON too. The first key decides where it can, so that a broken text is still told its error.
fn names_x3d(text: &str) -> bool {
    if text[1..].trim_start().starts_with("\"X3D\"") {
        return true;
    }
    serde_json::Deserializer::from_str(text).deserialize_map(HasX3d).unwrap_or(false)
}

struct HasX3d;

impl<'de> Visitor<'de> for HasX3d {
    type Value = bool;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<bool, A::Error> {
        let mut found = false;
        while let Some(key) = map.next_key::<Cow<'_, str>>()? {
            found |= key == "X3D";
            map.next_value::<IgnoredAny>()?;
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write;

    fn of(bytes: &[u8]) -> Result<Encoding, String> {
        decode(bytes).map(|d| d.encoding).map_err(|e| e.to_string())
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut out = GzEncoder::new(vec![], Compression::best());
        out.write_all(bytes).unwrap();
        out.finish().unwrap()
    }

    #[test]
    fn content_decides() {
        assert_eq!(of(b"#X3D V3.2 utf8\n"), Ok(Encoding::Classic));
        assert_eq!(of(b"\xef\xbb\xbf#vrml v2.0 utf8"), Ok(Encoding::Classic));
        assert_eq!(of(b"\n <?xml version='1.0'?><X3D/>"), Ok(Encoding::Xml));
        assert_eq!(of(b"{ \"X3D\": {"), Ok(Encoding::Json));
        assert_eq!(of(b"{\"$schema\": [1], \"X3D\": {}}"), Ok(Encoding::Json));
        assert_eq!(of(&gzip(b"#X3D V3.2 utf8\n")), Ok(Encoding::Classic));
        let utf16: Vec<u8> = "\u{feff}<X3D/>".encode_utf16().flat_map(u16::to_be_bytes).collect();
        assert_eq!(of(&utf16), Ok(Encoding::Xml));
    }

    #[test]
    fn others_are_refused_by_name() {
        assert!(of(b"#VRML V1.0 ascii\n").unwrap_err().contains("VRML 1.0"));
        assert!(of(b"{\"asset\": {\"version\": \"2.0\"}}").unwrap_err().contains("neither X3D nor VRML"));
        assert!(of(b"solid stl").is_err() && of(b"").is_err() && of(b"{").is_err());
        assert!(of(b"#X3D V3.0 utf8\n\0").unwrap_err().contains("NUL"));
        assert!(of(b"\xff\xfe\x00\xd8").unwrap_err().contains("UTF-16"));
        assert!(of(b"\x1f\x8bnonsense").unwrap_err().contains("broken"));
        assert!(of(b"\xe0\x00\x00\x01\x00").unwrap_err().contains("binary"));
    }

    #[test]
    fn a_bomb_is_not_unpacked() {
        let bomb = gzip(&vec![b' '; 64 << 20]);
        assert!(bomb.len() < 100_000);
        assert!(of(&bomb).unwrap_err().contains("expands to more than"));
    }

    #[test]
    fn odd_bytes_are_latin_where_declared_and_else_replaced() {
        let latin = decode(b"<?xml version='1.0' encoding='ISO-8859-1'?><X3D a='\xe4'/>").unwrap();
        assert!(latin.text.contains('\u{e4}') && !latin.replaced);
        let odd = decode(b"#X3D V3.0 utf8 \xe4").unwrap();
        assert!(odd.text.contains('\u{fffd}') && odd.replaced);
    }

    #[test]
    fn x3d_is_told_from_others() {
        assert!(is_x3d(b"#VRML V2.0 utf8\n") && is_x3d(b"{\"X3D\":{}}") && is_x3d(b"<X3D/>") && is_x3d(&gzip(b"<X3D/>")));
        assert!(!is_x3d(b"<COLLADA/>") && !is_x3d(b"{\"asset\":{}}") && !is_x3d(b"v 0 0 0") && !is_x3d(b"#VRML V1.0 ascii"));
    }
}
