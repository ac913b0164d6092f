//! Why blobs could not be stored or read, told apart by what helps: bake again, wait, or mend access.

use super::BlobName;

/// Why the blob store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum BlobError {
    /// No such blob.
    #[error("the blob {0} does not exist")]
    Missing(BlobName),
    /// The disk is full.
    #[error("the disk is full: {0} could not be written")]
    Full(String),
    /// More bytes than the caller is ready to hold.
    #[error("the blob {name} has {found} bytes; at most {max} are expected")]
    TooLarge {
        /// The blob.
        name: BlobName,
        /// Its length.
        found: u64,
        /// What was allowed.
        max: u64,
    },
    /// A file could not be written or moved.
    #[error("{what} could not be written")]
    Write {
        /// Which.
        what: String,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The object store failed to give a blob.
    #[error("the blob {name} could not be read")]
    Read {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: object_store::Error,
    },
    /// The object store failed to take or remove a blob.
    #[error("the blob {name} could not be stored or removed")]
    Store {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: object_store::Error,
    },
    /// The object store does not let this process do that.
    #[error("access to the blob {name} was denied; check the credentials and what they may do (get, put, delete and list)")]
    Denied {
        /// Which.
        name: String,
        /// Why.
        #[source]
        source: object_store::Error,
    },
}

impl BlobError {
    /// Whether room on the disk is what is missing.
    #[must_use]
    pub fn is_full(&self) -> bool {
        matches!(self, BlobError::Full(_))
    }

    /// Whether storage failed and nothing is wrong with what was stored: waiting, room or mended access makes the same work succeed.
    #[must_use]
    pub fn is_storage(&self) -> bool {
        match self {
            Self::Full(_) | Self::Write { .. } | Self::Read { .. } | Self::Store { .. } | Self::Denied { .. } => true,
            Self::Missing(_) | Self::TooLarge { .. } => false,
        }
    }

    /// A failed write; a full disk is told apart.
    #[must_use]
    pub fn write(what: impl Into<String>, source: std::io::Error) -> Self {
        let what = what.into();
        if Self::no_room(&source) { BlobError::Full(what) } else { BlobError::Write { what, source } }
    }

    /// Whether a file could not be written because the disk, or this user's part of it, is full.
    #[must_use]
    pub fn no_room(source: &std::io::Error) -> bool {
        matches!(source.kind(), std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded | std::io::ErrorKind::FileTooLarge)
    }

    /// A blob that could not be read.
    pub(super) fn read(name: BlobName, source: object_store::Error) -> Self {
        match source {
            object_store::Error::NotFound { .. } if !is_bucket_gone(&source) => Self::Missing(name),
            source if is_denied(&source) => Self::Denied { name: name.to_string(), source },
            source => Self::Read { name: name.to_string(), source },
        }
    }

    /// A blob that could not be stored or removed.
    pub(super) fn store(name: BlobName, source: object_store::Error) -> Self {
        let name = name.to_string();
        if is_denied(&source) { Self::Denied { name, source } } else { Self::Store { name, source } }
    }

    /// A list of blobs that could not be had.
    pub(super) fn list(source: object_store::Error) -> Self {
        let name = "(list)".to_owned();
        if is_denied(&source) { Self::Denied { name, source } } else { Self::Read { name, source } }
    }
}

pub(super) fn is_denied(error: &object_store::Error) -> bool {
    matches!(error, object_store::Error::PermissionDenied { .. } | object_store::Error::Unauthenticated { .. })
}

/// Whether it is the bucket that does not exist. All clouds answer 404 for both; taking a bucket that was renamed for ten thousand lost
/// blobs would bake ten hours of work again. The codes are those of S3, Azure and Google Cloud.
fn is_bucket_gone(error: &object_store::Error) -> bool {
    let text = error.to_string();
    ["NoSuchBucket", "ContainerNotFound", "The specified bucket does not exist"].iter().any(|code| text.contains(code))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    fn not_found(text: &str) -> object_store::Error {
        object_store::Error::NotFound { path: "x".into(), source: text.into() }
    }

    #[test]
    fn a_full_disk_is_told_apart() {
        assert!(BlobError::write("x", io::Error::from(io::ErrorKind::StorageFull)).is_full());
        assert!(!BlobError::write("x", io::Error::from(io::ErrorKind::NotFound)).is_full());
    }

    #[test]
    fn missing_transient_and_denied_are_told_apart() {
        let name = BlobName::of(b"x");
        let missing = BlobError::read(name, not_found("<Code>NoSuchKey</Code>"));
        assert!(matches!(missing, BlobError::Missing(n) if n == name) && !missing.is_storage());
        let bucket = BlobError::read(name, not_found("<Code>NoSuchBucket</Code>"));
        assert!(matches!(bucket, BlobError::Read { .. }) && bucket.is_storage());
        let denied = || object_store::Error::PermissionDenied { path: "x".into(), source: "403".into() };
        for error in [BlobError::read(name, denied()), BlobError::store(name, denied()), BlobError::list(denied())] {
            assert!(matches!(error, BlobError::Denied { .. }) && error.is_storage());
            assert!(error.to_string().contains("credentials"), "{error}");
        }
        let busy = || object_store::Error::Generic { store: "S3", source: "503".into() };
        assert!(matches!(BlobError::read(name, busy()), BlobError::Read { .. }));
        assert!(matches!(BlobError::store(name, busy()), BlobError::Store { .. }));
        assert!(BlobError::store(name, not_found("NoSuchBucket")).is_storage());
    }
}
