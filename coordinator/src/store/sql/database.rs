//! Which of the two databases it is.

use super::{super::StoreError, Tx, postgres::PostgresDatabase, sqlite::SqliteDatabase};
use crate::{records::UnixMillis, store::Hints};
use futures_util::{StreamExt, stream};
use kiln_proto::ids::JobId;
use std::{
    path::Path,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

/// A database.
pub(super) enum Database {
    Sqlite(SqliteDatabase),
    Postgres(PostgresDatabase),
}

impl Database {
    pub(super) async fn sqlite(path: &Path) -> Result<Self, StoreError> {
        SqliteDatabase::open(path).await.map(Self::Sqlite)
    }

    pub(super) async fn postgres(url: &str) -> Result<Self, StoreError> {
        PostgresDatabase::open(url).await.map(Self::Postgres)
    }

    pub(super) fn is_shared(&self) -> bool {
        matches!(self, Self::Postgres(_))
    }

    pub(super) async fn write(&self) -> Result<Tx, StoreError> {
        match self {
            Self::Sqlite(database) => database.write().await,
            Self::Postgres(database) => database.write().await,
        }
    }

    pub(super) async fn read(&self) -> Result<Tx, StoreError> {
        match self {
            Self::Sqlite(database) => database.read().await,
            Self::Postgres(database) => database.read().await,
        }
    }

    /// One coordinator's own clock is the clock of its own database.
    pub(super) async fn clock(&self) -> Result<UnixMillis, StoreError> {
        match self {
            Self::Sqlite(_) => Ok(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)),
            Self::Postgres(database) => database.clock().await,
        }
    }

    pub(super) async fn hint(&self, jobs: &[JobId]) -> Result<(), StoreError> {
        match self {
            Self::Sqlite(_) => Ok(()),
            Self::Postgres(database) => database.hint(jobs).await,
        }
    }

    pub(super) async fn hints(&self) -> Result<Hints, StoreError> {
        match self {
            Self::Sqlite(_) => Ok(stream::pending().boxed()),
            Self::Postgres(database) => database.hints().await,
        }
    }

    pub(super) async fn close(&self) {
        match self {
            Self::Sqlite(database) => database.close().await,
            Self::Postgres(database) => database.close().await,
        }
    }
}

/// How often a transaction that PostgreSQL gave up is begun anew.
pub(super) const TRIES: u32 = 5;

/// How long to wait before the next try.
pub(super) fn pause(tries: u32) -> Duration {
    Duration::from_millis(5 << tries.min(5))
}

/// Runs statements in a transaction and commits it; one that the database gave up for the sake of another is begun anew.
///
/// A macro, because what it would take as a function (a closure whose future borrows the transaction and may be sent to other threads) cannot
/// be written down.
macro_rules! writing {
    ($database:expr, $tx:ident => $work:expr) => {{
        let mut tries = 0;
        loop {
            let mut transaction = $database.write().await?;
            let worked = {
                let $tx = &mut transaction;
                async { $work }.await
            };
            let outcome = match worked {
                Ok(value) => transaction.commit().await.map(|()| value),
                Err(error) => Err(error),
            };
            match outcome {
                Err(error) if error.is_contention() && tries < $crate::store::sql::database::TRIES => {
                    tries += 1;
                    tokio::time::sleep($crate::store::sql::database::pause(tries)).await;
                }
                outcome => break outcome,
            }
        }
    }};
}
pub(super) use writing;
