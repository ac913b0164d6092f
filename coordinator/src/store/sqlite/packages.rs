//! What assembly leaves behind: reports of surfaces and the files of the package.

use super::rows::{count, from_json, int, json, parse};
use crate::{
    records::PackageFile,
    store::{StoreError, StoredPackageFile},
};
use kiln_proto::ids::JobId;
use sqlx::{Row, SqliteConnection, sqlite::SqliteRow};

pub(super) async fn add_report(c: &mut SqliteConnection, job: JobId, surface: u32, report: &serde_json::Value) -> Result<(), StoreError> {
    sqlx::query("INSERT OR REPLACE INTO reports (job, surface, report) VALUES (?, ?, ?)")
        .bind(job.to_string())
        .bind(surface)
        .bind(json(report)?)
        .execute(c)
        .await?;
    Ok(())
}

pub(super) async fn reports(c: &mut SqliteConnection, job: JobId) -> Result<Vec<serde_json::Value>, StoreError> {
    let query = sqlx::query_scalar("SELECT report FROM reports WHERE job = ? ORDER BY surface").bind(job.to_string());
    let all: Vec<String> = query.fetch_all(c).await?;
    all.iter().map(|text| from_json("a surface's report", text)).collect()
}

pub(super) async fn add_files(c: &mut SqliteConnection, job: JobId, files: &[StoredPackageFile]) -> Result<(), StoreError> {
    for stored in files {
        let query =
            sqlx::query("INSERT OR REPLACE INTO package_files (job, path, media_type, bytes, sha256, blob) VALUES (?, ?, ?, ?, ?, ?)");
        query
            .bind(job.to_string())
            .bind(&stored.file.path)
            .bind(&stored.file.media_type)
            .bind(int(stored.file.bytes))
            .bind(&stored.file.sha256)
            .bind(stored.blob.to_string())
            .execute(&mut *c)
            .await?;
    }
    Ok(())
}

pub(super) async fn files(c: &mut SqliteConnection, job: JobId) -> Result<Vec<StoredPackageFile>, StoreError> {
    let one = |row: &SqliteRow| {
        let file = PackageFile {
            path: row.try_get("path")?,
            media_type: row.try_get("media_type")?,
            bytes: count(row.try_get("bytes")?),
            sha256: row.try_get("sha256")?,
        };
        Ok(StoredPackageFile { file, blob: parse("a blob name", &row.try_get::<String, _>("blob")?)? })
    };
    let query = sqlx::query("SELECT * FROM package_files WHERE job = ? ORDER BY path").bind(job.to_string());
    query.fetch_all(c).await?.iter().map(one).collect()
}
