//! How a store fails.

/// Why the store could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The database cannot be opened.
    #[error("the database {database} cannot be opened")]
    Open {
        /// Its file, or its address without a password.
        database: String,
        /// Why.
        #[source]
        source: sqlx::Error,
    },
    /// The file is not a database, or one that is damaged.
    #[error("the database {database} is damaged: {reason}; restore a copy or choose another data folder")]
    Damaged {
        /// Its file.
        database: String,
        /// What the check said.
        reason: String,
    },
    /// Written by a later Kiln.
    #[error("the database {database} has schema {found}; this Kiln knows schemas up to {known}")]
    Newer {
        /// Its file or address.
        database: String,
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
    /// The store is being closed.
    #[error("the store is closed")]
    Closed,
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

    /// Whether the database gave a transaction up for the sake of another: begun anew it may succeed.
    #[must_use]
    pub(super) fn is_contention(&self) -> bool {
        let StoreError::Database(error) = self else { return false };
        error.as_database_error().and_then(|e| e.code()).is_some_and(|code| CONTENTION.contains(&&*code))
    }
}

/// SQLITE_FULL, and PostgreSQL's disk_full.
const FULL: [&str; 2] = ["13", "53100"];
/// PostgreSQL's serialization_failure and deadlock_detected.
const CONTENTION: [&str; 2] = ["40001", "40P01"];

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        match error.as_database_error().and_then(|e| e.code()) {
            Some(code) if FULL.contains(&&*code) => StoreError::Full,
            _ => StoreError::Database(error),
        }
    }
}
