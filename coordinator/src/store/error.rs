//! How a store fails.

use std::path::PathBuf;

/// Why the store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database cannot be opened.
    #[error("the database {} cannot be opened", path.display())]
    Open {
        /// Its file.
        path: PathBuf,
        /// Why.
        #[source]
        source: sqlx::Error,
    },
    /// The file is not a database, or one that is damaged.
    #[error("the database {} is damaged: {reason}; restore a copy or choose another data folder", path.display())]
    Damaged {
        /// Its file.
        path: PathBuf,
        /// What the check said.
        reason: String,
    },
    /// Written by a later Kiln.
    #[error("the database {} has schema {found}; this Kiln knows schemas up to {known}", path.display())]
    Newer {
        /// Its file.
        path: PathBuf,
        /// The schema found.
        found: i64,
        /// The latest schema known.
        known: i64,
    },
    /// The disk is full.
    #[error("the disk of the database is full")]
    Full,
    /// A row holds what this program never wrote.
    #[error("the database holds {found} where {expected} is expected")]
    Row {
        /// What should be there.
        expected: &'static str,
        /// What is.
        found: String,
    },
    /// The database failed.
    #[error("the database failed")]
    Database(#[source] sqlx::Error),
}

impl StoreError {
    /// Whether room on the disk is what is missing.
    #[must_use]
    pub fn is_full(&self) -> bool {
        matches!(self, StoreError::Full)
    }
}

/// SQLITE_FULL.
const FULL: &str = "13";

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        match error.as_database_error().and_then(|e| e.code()) {
            Some(code) if code == FULL => StoreError::Full,
            _ => StoreError::Database(error),
        }
    }
}
