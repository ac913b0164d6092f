//! Where blobs live, as `--blobs` says it.

use object_store::path::Path as ObjectPath;
use std::{fmt, path::PathBuf, str::FromStr};

/// Whose object storage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cloud {
    /// Amazon S3, and what speaks its language.
    S3,
    /// Google Cloud Storage.
    Google,
    /// Azure Blob Storage.
    Azure,
}

/// Where blobs live.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// Files below an absolute folder.
    Folder(PathBuf),
    /// Objects of a bucket.
    Bucket {
        /// Whose.
        cloud: Cloud,
        /// The bucket's or container's name.
        bucket: String,
        /// What all names begin with; empty for the whole bucket.
        prefix: ObjectPath,
    },
}

/// A text that says no [`Location`]. It is not repeated where it may hold a secret.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{what} says no place for blobs: {reason}; allowed are s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX and \
     file:///FOLDER, with credentials and endpoint in the environment"
)]
pub struct BadLocation {
    what: String,
    reason: String,
}

impl FromStr for Location {
    type Err = BadLocation;

    fn from_str(text: &str) -> Result<Self, BadLocation> {
        let bad = |reason: String| BadLocation { what: format!("`{}`", text.chars().take(200).collect::<String>()), reason };
        let (scheme, rest) = text.split_once("://").ok_or_else(|| bad("it is no URL".into()))?;
        let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
        if authority.contains('@') {
            let what = format!("a URL that begins with `{}://` and holds a user or password", scheme.chars().take(20).collect::<String>());
            return Err(BadLocation { what, reason: "credentials do not belong into it".into() });
        }
        if let Some(sign) = rest.chars().find(|c| matches!(c, '?' | '#')) {
            let what = format!("a URL that begins with `{scheme}://{}`", authority.split(['?', '#']).next().unwrap_or_default());
            return Err(BadLocation { what, reason: format!("nothing may follow after a `{sign}`") });
        }
        let cloud = match scheme {
            "s3" => Cloud::S3,
            "gs" => Cloud::Google,
            "az" | "azure" => Cloud::Azure,
            "file" if !authority.is_empty() => return Err(bad("a folder begins with a third slash".into())),
            "file" if path.split('/').any(|part| part == "..") => return Err(bad("a folder has no `..`".into())),
            "file" if path.trim_matches('/').is_empty() => return Err(bad("it names no folder".into())),
            "file" => return Ok(Self::Folder(PathBuf::from(format!("/{path}")))),
            other => return Err(bad(format!("`{other}` is no scheme that is known here"))),
        };
        if authority.is_empty() {
            return Err(bad("it names no bucket".into()));
        }
        if !authority.bytes().all(|c| c.is_ascii_alphanumeric() || matches!(c, b'.' | b'-' | b'_')) {
            return Err(bad(format!("`{authority}` is no name of a bucket")));
        }
        if path.starts_with('/') {
            return Err(bad("its prefix begins with a slash".into()));
        }
        if path.contains('%') {
            return Err(bad("the prefix is written as it is, without escapes".into()));
        }
        let prefix = ObjectPath::parse(path).map_err(|e| bad(format!("its prefix cannot be used: {e}")))?;
        Ok(Self::Bucket { cloud, bucket: authority.to_owned(), prefix })
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (cloud, bucket, prefix) = match self {
            Self::Folder(path) => return write!(f, "file://{}", path.display()),
            Self::Bucket { cloud, bucket, prefix } => (cloud, bucket, prefix.as_ref()),
        };
        let scheme = match cloud {
            Cloud::S3 => "s3",
            Cloud::Google => "gs",
            Cloud::Azure => "az",
        };
        let slash = if prefix.is_empty() { "" } else { "/" };
        write!(f, "{scheme}://{bucket}{slash}{prefix}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bucket(cloud: Cloud, bucket: &str, prefix: &str) -> Location {
        Location::Bucket { cloud, bucket: bucket.into(), prefix: ObjectPath::parse(prefix).unwrap() }
    }

    #[test]
    fn places_are_read_and_written() {
        let cases = [
            ("s3://b/p/q", bucket(Cloud::S3, "b", "p/q"), "s3://b/p/q"),
            ("s3://my.bucket-1", bucket(Cloud::S3, "my.bucket-1", ""), "s3://my.bucket-1"),
            ("s3://b/", bucket(Cloud::S3, "b", ""), "s3://b"),
            ("gs://b_1/p/", bucket(Cloud::Google, "b_1", "p"), "gs://b_1/p"),
            ("az://c/p", bucket(Cloud::Azure, "c", "p"), "az://c/p"),
            ("azure://c", bucket(Cloud::Azure, "c", ""), "az://c"),
            ("file:///srv/kiln", Location::Folder("/srv/kiln".into()), "file:///srv/kiln"),
        ];
        for (text, place, written) in cases {
            assert_eq!(text.parse::<Location>(), Ok(place.clone()), "{text}");
            assert_eq!(place.to_string(), written);
        }
    }

    #[test]
    fn what_is_no_place_says_why_and_what_is_allowed() {
        let cases = [
            ("kiln-blobs", "no URL"),
            ("http://host/b", "`http`"),
            ("S3://b", "`S3`"),
            ("s3:///p", "no bucket"),
            ("s3://", "no bucket"),
            ("s3://host:9000/b", "`host:9000`"),
            ("s3://b/p?region=x", "after a `?`"),
            ("s3://b/p#x", "after a `#`"),
            ("s3://b//p", "prefix"),
            ("s3://b/../p", "prefix"),
            ("s3://b/a%20b", "escapes"),
            ("file://host/p", "third slash"),
            ("file:///", "no folder"),
            ("file:///a/../b", "`..`"),
        ];
        for (text, why) in cases {
            let said = text.parse::<Location>().unwrap_err().to_string();
            assert!(said.contains(why) && said.contains("s3://BUCKET/PREFIX"), "{text}: {said}");
        }
    }

    #[test]
    fn secrets_are_not_repeated() {
        for text in ["s3://key:secret@b/p", "az://c/p?sig=secret", "s3://b?secret"] {
            let said = text.parse::<Location>().unwrap_err().to_string();
            assert!(!said.contains("secret") && !said.contains("key:"), "{said}");
        }
    }
}
