//! SQLite: one file, nothing to install, and enough for one machine and hundreds of workers.
//!
//! WAL with `synchronous = FULL`: a transaction that returned survives a power cut. One connection writes, so that requests queue in order
//! instead of failing busy; a few others read beside it.

use super::{super::StoreError, Tx};
use sqlx::{
    Connection, SqliteConnection, SqlitePool,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};
use std::{path::Path, time::Duration};

/// One entry per schema: what takes a database from the one before to it. Entries are never edited, only added.
const MIGRATIONS: [&str; 7] = [
    include_str!("schema/sqlite1.sql"),
    include_str!("schema/sqlite2.sql"),
    include_str!("schema/sqlite3.sql"),
    include_str!("schema/sqlite4.sql"),
    include_str!("schema/sqlite5.sql"),
    include_str!("schema/sqlite6.sql"),
    include_str!("schema/sqlite7.sql"),
];

/// SQLITE_CORRUPT and SQLITE_NOTADB.
const DAMAGED: [&str; 2] = ["11", "26"];

/// Readers at the same time. SQLite reads in parallel with its one writer under WAL.
const READERS: u32 = 4;

/// A database in a file.
pub(super) struct SqliteDatabase {
    pub(super) writer: SqlitePool,
    pub(super) readers: SqlitePool,
}

impl SqliteDatabase {
    /// Opens the file, creates it when missing, and brings its schema up to date.
    pub(super) async fn open(path: &Path) -> Result<Self, StoreError> {
        let options = SqliteConnectOptions::new()
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(10));
        let fail = |source: sqlx::Error| failed(path, source);
        // One writer: requests queue here in order instead of waking up to find the database busy.
        let writer = SqlitePoolOptions::new().max_connections(1).acquire_timeout(Duration::from_secs(60)).connect_with(options.clone());
        let writer = writer.await.map_err(fail)?;
        let mut connection = writer.acquire().await.map_err(fail)?;
        check(&mut connection, path).await.map_err(|e| match e {
            StoreError::Database(source) => fail(source),
            other => other,
        })?;
        migrate(&mut connection, path).await?;
        drop(connection);
        let readers = SqlitePoolOptions::new().max_connections(READERS).connect_with(options.read_only(true)).await.map_err(fail)?;
        Ok(Self { writer, readers })
    }

    /// Begins a transaction that writes.
    ///
    /// On a full or failing disk SQLite may roll back by itself; sqlx's own rollback then meets no transaction and fails, and sqlx believes
    /// for ever that the connection is within one. Such a connection is given up for a new one, or a disk that was full once would stop all
    /// writes until a restart.
    pub(super) async fn write(&self) -> Result<Tx, StoreError> {
        const BEGIN: &str = "BEGIN IMMEDIATE";
        match self.writer.begin_with(BEGIN).await {
            Err(sqlx::Error::InvalidSavePointStatement) => {
                self.writer.acquire().await?.close().await?;
                Ok(Tx::Sqlite(self.writer.begin_with(BEGIN).await?))
            }
            begun => Ok(Tx::Sqlite(begun?)),
        }
    }

    pub(super) async fn read(&self) -> Result<Tx, StoreError> {
        Ok(Tx::SqliteRead(self.readers.acquire().await?))
    }

    pub(super) async fn close(&self) {
        self.readers.close().await;
        self.writer.close().await;
    }
}

fn failed(path: &Path, source: sqlx::Error) -> StoreError {
    let database = path.display().to_string();
    match source.as_database_error().and_then(|e| e.code()) {
        Some(code) if DAMAGED.contains(&&*code) => StoreError::Damaged { database, reason: source.to_string() },
        _ => StoreError::Open { database, source },
    }
}

async fn check(c: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("PRAGMA quick_check(1)").fetch_one(c).await?;
    if found == "ok" { Ok(()) } else { Err(StoreError::Damaged { database: path.display().to_string(), reason: found }) }
}

async fn migrate(c: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let known = MIGRATIONS.len() as i64;
    let found: i64 = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut *c).await?;
    if found > known {
        return Err(StoreError::Newer { database: path.display().to_string(), found, known });
    }
    for (index, migration) in MIGRATIONS.iter().enumerate().skip(usize::try_from(found).unwrap_or(0)) {
        let mut tx = c.begin().await?;
        sqlx::raw_sql(*migration).execute(&mut *tx).await?;
        let version = format!("PRAGMA user_version = {}", index + 1);
        sqlx::raw_sql(sqlx::AssertSqlSafe(version)).execute(&mut *tx).await?;
        tx.commit().await?;
    }
    Ok(())
}
