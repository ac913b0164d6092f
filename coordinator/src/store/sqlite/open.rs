//! Opening a database: pragmas, the health check, the schema.

use super::super::StoreError;
use sqlx::{
    Connection, SqliteConnection, SqlitePool,
    sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous},
};
use std::{path::Path, time::Duration};

/// One entry per schema: what takes a database from the one before to it. Entries are never edited, only added.
const MIGRATIONS: [&str; 3] = [include_str!("schema.sql"), include_str!("schema2.sql"), include_str!("schema3.sql")];

/// SQLITE_CORRUPT and SQLITE_NOTADB.
const DAMAGED: [&str; 2] = ["11", "26"];

/// Readers at the same time. SQLite reads in parallel with its one writer under WAL.
const READERS: u32 = 4;

pub(super) async fn open(path: &Path) -> Result<(SqlitePool, SqlitePool), StoreError> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(Duration::from_secs(10));
    let fail = |source: sqlx::Error| {
        let code = source.as_database_error().and_then(|e| e.code().map(|c| c.into_owned()));
        match code {
            Some(code) if DAMAGED.contains(&code.as_str()) => StoreError::Damaged { path: path.to_owned(), reason: source.to_string() },
            _ => StoreError::Open { path: path.to_owned(), source },
        }
    };
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
    Ok((writer, readers))
}

async fn check(c: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let found: String = sqlx::query_scalar("PRAGMA quick_check(1)").fetch_one(c).await?;
    if found == "ok" { Ok(()) } else { Err(StoreError::Damaged { path: path.to_owned(), reason: found }) }
}

async fn migrate(c: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let known = MIGRATIONS.len() as i64;
    let found: i64 = sqlx::query_scalar("PRAGMA user_version").fetch_one(&mut *c).await?;
    if found > known {
        return Err(StoreError::Newer { path: path.to_owned(), found, known });
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
