//! Why the engine could not do what it was asked. Each variant is one kind of answer; `http::problem` maps them to statuses.

use crate::{
    blob::{BlobError, SetupError},
    records::Problem,
    store::StoreError,
    webhook::BadWebhook,
};
use std::path::PathBuf;

/// Why the engine could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// 404: nothing here has this name.
    #[error("there is no {what} `{id}`")]
    NotFound {
        /// Scene, job, plan, file.
        what: &'static str,
        /// The name that was asked for.
        id: String,
    },
    /// 409: it exists, but is not in a state that allows this.
    #[error("{what} is {state}; {needed}")]
    Conflict {
        /// What, with its name.
        what: String,
        /// The state it is in.
        state: String,
        /// The state it must be in, as a clause.
        needed: String,
    },
    /// 422: the request says something impossible; every problem found.
    #[error("{}", first(.0))]
    Invalid(Vec<Problem>),
    /// 422: a job asks to tell an address that may not be told.
    #[error(transparent)]
    Webhook(#[from] BadWebhook),
    /// 507: the disk is too small, or full.
    #[error("{needed} bytes are needed, but {free} are free on the disk of {}; free some space or lower the texel density", path.display())]
    NoSpace {
        /// Bytes that the job is estimated to need, reserve included.
        needed: u64,
        /// Bytes free now.
        free: u64,
        /// The data folder.
        path: PathBuf,
    },
    /// 503: shutting down, or not possible right now.
    #[error("the coordinator is not available: {0}")]
    Unavailable(&'static str),
    /// Start-up: another process holds the data folder.
    #[error("the data folder {} is used by another coordinator; stop it or choose another folder", path.display())]
    Locked {
        /// The data folder.
        path: PathBuf,
    },
    /// Start-up: the data folder cannot be used.
    #[error("the data folder {} cannot be used: {doing} failed", path.display())]
    DataFolder {
        /// The folder or the file in it.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why it failed.
        #[source]
        source: std::io::Error,
    },
    /// Start-up: the place for blobs cannot be used.
    #[error(transparent)]
    Blobs(Box<SetupError>),
    /// 500: the store failed.
    #[error("the store failed")]
    Store(#[from] StoreError),
    /// 500: the blob store failed.
    #[error("the blob store failed")]
    Blob(#[from] BlobError),
    /// 500: stored bytes are not what they were when they were written, or a task panicked.
    #[error("{0}")]
    Broken(String),
}

impl From<SetupError> for EngineError {
    fn from(error: SetupError) -> Self {
        Self::Blobs(Box::new(error))
    }
}

impl EngineError {
    /// Whether storage failed and nothing is wrong with what was stored: waiting, room or a repaired disk makes the same work succeed.
    #[must_use]
    pub fn is_storage(&self) -> bool {
        match self {
            Self::DataFolder { .. } => true,
            Self::Store(error) => error.is_full(),
            Self::Blob(error) => error.is_storage(),
            _ => false,
        }
    }

    /// Whether room on the disk is what is missing.
    #[must_use]
    pub fn is_full(&self) -> bool {
        match self {
            Self::DataFolder { source, .. } => BlobError::no_room(source),
            Self::Store(error) => error.is_full(),
            Self::Blob(error) => error.is_full(),
            _ => false,
        }
    }

    /// One problem with a request.
    #[must_use]
    pub fn invalid(message: impl Into<String>) -> Self {
        Self::Invalid(vec![Problem::new(message)])
    }
}

fn first(problems: &[Problem]) -> String {
    match problems {
        [] => "the request is not valid".into(),
        [only] => only.to_string(),
        [first, rest @ ..] => format!("{first} (and {} more)", rest.len()),
    }
}
