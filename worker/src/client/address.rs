//! Which farm a worker works for: the coordinator's address, normalised, and a folder name made of it.
//!
//! Spooled chunks are kept by farm, so that those of one are never sent to another. A farm is known by its address alone, because a worker
//! that is cut off can ask nobody for a better name. The limits of that: one farm under two names has two spools, and what lies in one waits
//! for a worker that uses the same name; another farm that takes over an address is offered chunks of the earlier one, does not know their
//! tokens and refuses them, which loses nothing that still had a taker.

use kiln_proto::ids::Digest;
use reqwest::Url;

/// Characters of the host and of the digest that a folder's name keeps.
const NAME_CHARS: usize = 48;
const DIGEST_CHARS: usize = 16;

/// Why a text is not the address of a coordinator.
#[derive(Debug, thiserror::Error)]
pub enum AddressError {
    /// Not a URL.
    #[error("`{text}` is not an address; one looks like http://host:8080")]
    Syntax {
        /// What was given.
        text: String,
        /// What is wrong with it.
        #[source]
        source: <Url as std::str::FromStr>::Err,
    },
    /// A URL, but of something else.
    #[error("`{text}` is not the address of a coordinator: {why}; one looks like http://host:8080")]
    Kind {
        /// What was given.
        text: String,
        /// What is wrong with it.
        why: &'static str,
    },
}

/// The folder name of the farm at `address`: its host and port for people, a digest of all of it for certainty.
///
/// # Errors
/// Addresses that no coordinator can have.
pub fn farm_key(address: &str) -> Result<String, AddressError> {
    let url = Url::parse(address).map_err(|source| AddressError::Syntax { text: address.to_owned(), source })?;
    let wrong = |why| AddressError::Kind { text: address.to_owned(), why };
    if !matches!(url.scheme(), "http" | "https") {
        return Err(wrong("only http and https are spoken"));
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err(wrong("it has a query or a fragment"));
    }
    let (Some(host), Some(port)) = (url.host_str(), url.port_or_known_default()) else { return Err(wrong("it names no host")) };
    // Names and passwords are no part of where a farm is, and have no business in the name of a folder.
    let whole = format!("{}://{host}:{port}{}", url.scheme(), url.path().trim_end_matches('/'));
    let plain = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '-') { c } else { '_' };
    let host: String = host.chars().map(plain).take(NAME_CHARS).collect();
    let digest: String = Digest::of(whole.as_bytes()).to_string().chars().take(DIGEST_CHARS).collect();
    Ok(format!("{host}_{port}-{digest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_farm_has_the_same_key_and_others_have_others() {
        let key = |text: &str| farm_key(text).unwrap();
        let plain = key("http://bake.example:8080");
        assert!(plain.starts_with("bake.example_8080-"), "{plain}");
        for same in ["http://bake.example:8080/", "HTTP://Bake.Example:8080//", "http://user:secret@bake.example:8080"] {
            assert_eq!(key(same), plain, "{same}");
        }
        assert_eq!(key("https://bake.example"), key("https://bake.example:443/"));
        for other in ["http://bake.example", "http://bake.example:8080/farm", "https://bake.example:8080", "http://127.0.0.1:8080"] {
            assert_ne!(key(other), plain, "{other}");
        }
        assert!(key("http://[::1]:80").chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c)));
    }

    #[test]
    fn what_no_coordinator_can_have_is_refused_with_an_example() {
        for wrong in ["", "host", "http://", "http://a b", "ftp://host", "http://host?x=1", "http://host:99999"] {
            let said = farm_key(wrong).unwrap_err().to_string();
            assert!(said.contains("http://host:8080"), "{wrong}: {said}");
        }
    }
}
