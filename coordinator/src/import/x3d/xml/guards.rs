//! What the XML reader must not be given: texts that are cheap to write and dear to read.
//!
//! A few abbreviations are fine; entities made of entities are how a kilobyte becomes a gigabyte. The reader's own guards bound the
//! number of expansions and not what they come to, so what they come to is added up here: no entity may be made of others, and all of
//! them together may not write more than the file has twice over. And it compares every attribute of an element with every other, and
//! every name space with those around it, which no scene notices.

/// What entities may add in any file, bytes.
const ALLOWANCE: usize = 1 << 16;
/// Entities of a file; each costs a search of it.
const ENTITIES: usize = 64;
/// Declarations of name spaces in a file; one is common.
const NAME_SPACES: usize = 256;
/// Attributes of an element; the node with the most fields has about fifty.
const ATTRIBUTES: usize = 1_000;

/// Refuses a text with the byte to blame, and the reason.
pub(super) fn check(text: &str) -> Result<(), (usize, String)> {
    entities(text)?;
    attributes(text)?;
    match text.match_indices("xmlns").nth(NAME_SPACES) {
        Some((at, _)) => Err((at, format!("more than {NAME_SPACES} declarations of name spaces"))),
        None => Ok(()),
    }
}

/// Refuses elements with too many attributes.
fn attributes(text: &str) -> Result<(), (usize, String)> {
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|found| at + found) {
        let tag = &text[start..];
        let until = |end: &str| tag.find(end).map_or(tag.len(), |e| e + end.len());
        let length = match () {
            () if tag.starts_with("<!--") => until("-->"),
            () if tag.starts_with("<![CDATA[") => until("]]>"),
            () if tag.starts_with("<?") => until("?>"),
            () if tag.starts_with("<!") => 2,
            () => {
                let (length, count) = measure(tag);
                if count > ATTRIBUTES {
                    return Err((start, format!("an element of {count} attributes; at most {ATTRIBUTES} are allowed")));
                }
                length
            }
        };
        at = start + length;
    }
    Ok(())
}

/// The bytes of a tag, and its attributes.
fn measure(tag: &str) -> (usize, usize) {
    let mut quote = None;
    let mut count = 0;
    for (at, byte) in tag.bytes().enumerate() {
        match (quote, byte) {
            (Some(q), b) if b == q => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => count += 1,
            (None, b'>') => return (at + 1, count),
            (None, _) => {}
        }
    }
    (tag.len(), count)
}

/// Refuses texts whose entities would outgrow them.
fn entities(text: &str) -> Result<(), (usize, String)> {
    let mut added = 0usize;
    let mut declared = 0;
    let mut at = 0;
    // A declaration inside a comment or a string only makes this stricter.
    while let Some(found) = text[at..].find("<!ENTITY") {
        let start = at + found;
        declared += 1;
        if declared > ENTITIES {
            return Err((start, format!("more than {ENTITIES} entities; write out what they stand for")));
        }
        let Some((name, value, end)) = declaration(text, start) else {
            return Err((start, "an entity declaration without its end".to_owned()));
        };
        if value.contains('&') && !value.split('&').skip(1).all(|v| v.starts_with('#')) {
            return Err((start, format!("the entity `{name}` is made of others, which is not supported; write out what it stands for")));
        }
        let uses = if name.is_empty() { 0 } else { text.matches(&format!("&{name};")).count() };
        added = added.saturating_add(uses.saturating_mul(value.len()));
        if added > text.len().saturating_add(ALLOWANCE) {
            return Err((start, format!("the entities up to `{name}` write more than the file has; write out what they stand for")));
        }
        at = end;
    }
    Ok(())
}

/// Name and value of the declaration at `start`, and where it ends.
fn declaration(text: &str, start: usize) -> Option<(&str, &str, usize)> {
    let rest = &text[start + "<!ENTITY".len()..];
    let name = rest.split_whitespace().next().unwrap_or_default();
    let quote = rest.find(['"', '\'', '>'])?;
    let base = start + "<!ENTITY".len();
    let mark = rest.as_bytes()[quote];
    if mark == b'>' {
        return Some((name, "", base + quote));
    }
    let value = &rest[quote + 1..];
    let length = value.find(char::from(mark))?;
    Some((name, &value[..length], base + quote + 1 + length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn abbreviations_pass_and_bombs_do_not() {
        let of = |entities: &str, body: &str| check(&format!("<!DOCTYPE X3D [{entities}]><X3D>{body}</X3D>"));
        assert_eq!(of("", "&amp;"), Ok(()));
        assert_eq!(of("<!ENTITY a 'b&#65;'>", "&a;"), Ok(()));
        assert_eq!(of("<!ENTITY a SYSTEM \"file:///etc/passwd\">", ""), Ok(()));
        let (at, message) = of("<!ENTITY a 'b'><!ENTITY c '&a;&a;'>", "&c;").unwrap_err();
        assert!(at == 30 && message.contains("`c` is made of others"), "{at} {message}");
        let long = format!("<!ENTITY a '{}'>", "x".repeat(10_000));
        assert!(of(&long, &"&a;".repeat(5)).is_ok());
        assert!(of(&long, &"&a;".repeat(100)).unwrap_err().1.contains("more than the file has"));
        assert!(of("<!ENTITY a 'b", "").is_err());
        assert!(of(&"<!ENTITY a 'b'>".repeat(65), "").unwrap_err().1.contains("more than 64 entities"));
    }

    #[test]
    fn elements_have_a_bounded_number_of_attributes() {
        let many = |n: usize| {
            format!("<!-- {} --><X3D><![CDATA[<a {}>]]><Box {}/></X3D>", "a='' ".repeat(9_999), "=".repeat(9_999), "a='<>=' ".repeat(n))
        };
        assert_eq!(check(&many(1_000)), Ok(()));
        assert!(check(&many(1_001)).unwrap_err().1.contains("an element of 1001 attributes"));
        assert!(check(&"<a xmlns:b='c'>".repeat(257)).unwrap_err().1.contains("name spaces"));
        assert_eq!(check("<a b='"), Ok(()));
    }
}
