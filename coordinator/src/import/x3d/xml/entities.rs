//! Entities that a document declares for itself, before anything expands them.
//!
//! A few abbreviations are fine; ones made of others are how a kilobyte becomes a gigabyte. The reader's own guards bound the number of
//! expansions and not what they come to, so what they come to is added up here: no entity may be made of others, and all of them
//! together may not write more than the file has twice over.

/// What entities may add in any file, bytes.
const ALLOWANCE: usize = 1 << 16;
/// Entities of a file; each costs a search of it.
const MOST: usize = 64;

/// Refuses texts whose entities would outgrow them, with the byte of the declaration to blame.
pub(super) fn check(text: &str) -> Result<(), (usize, String)> {
    let mut added = 0usize;
    let mut declared = 0;
    let mut at = 0;
    // A declaration inside a comment or a string only makes this stricter.
    while let Some(found) = text[at..].find("<!ENTITY") {
        let start = at + found;
        declared += 1;
        if declared > MOST {
            return Err((start, format!("more than {MOST} entities; write out what they stand for")));
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
    }
}
