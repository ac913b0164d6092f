//! SQLite against the suite, and what only a file can do wrong.

use super::{SqlStore, database::Database, sqlite::SqliteDatabase};
use crate::{
    blob::BlobName,
    store::{Store, StoreError, StoredFile, conformance},
};
use kiln_proto::options::ImportOptions;
use std::sync::Arc;
use uuid::Uuid;

fn file(store: &SqlStore) -> &SqliteDatabase {
    match &*store.database {
        Database::Sqlite(file) => file,
        Database::Postgres(_) => unreachable!("opened as a file"),
    }
}

#[tokio::test]
async fn it_conforms() {
    let dir = tempfile::tempdir().unwrap();
    let count = std::cell::Cell::new(0);
    conformance::all(|| {
        count.set(count.get() + 1);
        let path = dir.path().join(format!("{}.db", count.get()));
        async move { Arc::new(SqlStore::sqlite(&path).await.unwrap()) as Arc<dyn Store> }
    })
    .await;
}

#[tokio::test]
async fn a_later_schema_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("kiln.db");
    let store = SqlStore::sqlite(&path).await.unwrap();
    sqlx::raw_sql("PRAGMA user_version = 99").execute(&file(&store).writer).await.unwrap();
    store.close().await;
    let error = SqlStore::sqlite(&path).await.err().unwrap();
    assert!(matches!(error, StoreError::Newer { found: 99, known: 7, .. }), "{error}");
}

/// What SQLite rolls back by itself must not be waited for: `max_page_count` makes a full disk of any.
#[tokio::test]
async fn it_writes_again_when_the_disk_has_room_again() {
    let dir = tempfile::tempdir().unwrap();
    let store = SqlStore::sqlite(&dir.path().join("kiln.db")).await.unwrap();
    let pages: i64 = sqlx::query_scalar("PRAGMA page_count").fetch_one(&file(&store).writer).await.unwrap();
    let limit = |n: i64| sqlx::raw_sql(sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {n}"))).execute(&file(&store).writer);
    limit(pages).await.unwrap();
    let files = |n: usize| [StoredFile { name: "x".repeat(n), blob: BlobName::of(b"x") }];
    let full = store.add_scene(Uuid::now_v7(), &files(100_000), &ImportOptions::default(), None, 0).await.unwrap_err();
    assert!(
        full.to_string().contains("full") || std::error::Error::source(&full).is_some_and(|e| e.to_string().contains("full")),
        "{full:?}"
    );
    limit(1 << 30).await.unwrap();
    let id = Uuid::now_v7();
    store.add_scene(id, &files(100_000), &ImportOptions::default(), None, 0).await.unwrap();
    assert!(store.scene(id).await.unwrap().is_some());
}

#[tokio::test]
async fn it_is_opened_with_full_durability() {
    let dir = tempfile::tempdir().unwrap();
    let store = SqlStore::sqlite(&dir.path().join("kiln.db")).await.unwrap();
    let mode: String = sqlx::query_scalar("PRAGMA journal_mode").fetch_one(&file(&store).writer).await.unwrap();
    let synchronous: i64 = sqlx::query_scalar("PRAGMA synchronous").fetch_one(&file(&store).writer).await.unwrap();
    assert_eq!((mode.as_str(), synchronous), ("wal", 2));
    let write = sqlx::query("DELETE FROM jobs").execute(&file(&store).readers).await;
    assert!(write.is_err(), "readers cannot write");
}
