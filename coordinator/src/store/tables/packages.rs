//! What assembly leaves behind: reports of surfaces and the files of the package.

use crate::{
    records::PackageFile,
    store::{
        StoreError, StoredPackageFile,
        rows::{from_json, json, parse},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::ids::JobId;

pub(super) async fn add_report(c: &mut Tx, job: JobId, surface: u32, report: &serde_json::Value) -> Result<(), StoreError> {
    let query = sql("INSERT INTO reports (job, surface, report) VALUES ($1, $2, $3)
         ON CONFLICT (job, surface) DO UPDATE SET report = excluded.report");
    c.run(query.bind(job.to_string()).bind(surface).bind(json(report)?)).await?;
    Ok(())
}

pub(in super::super) async fn reports(c: &mut Tx, job: JobId) -> Result<Vec<serde_json::Value>, StoreError> {
    let rows = c.all(sql("SELECT report FROM reports WHERE job = $1 ORDER BY surface").bind(job.to_string())).await?;
    rows.iter().map(|row| from_json("a surface's report", &row.text("report")?)).collect()
}

pub(super) async fn add_files(c: &mut Tx, job: JobId, files: &[StoredPackageFile]) -> Result<(), StoreError> {
    for StoredPackageFile { file, blob } in files {
        let query = sql("INSERT INTO package_files (job, path, media_type, bytes, sha256, blob) VALUES ($1, $2, $3, $4, $5, $6)
             ON CONFLICT (job, path) DO UPDATE SET media_type = excluded.media_type, bytes = excluded.bytes,
             sha256 = excluded.sha256, blob = excluded.blob");
        let query = query.bind(job.to_string()).bind(&file.path).bind(&file.media_type).bind(file.bytes);
        c.run(query.bind(&file.sha256).bind(blob.to_string())).await?;
    }
    Ok(())
}

pub(in super::super) async fn files(c: &mut Tx, job: JobId) -> Result<Vec<StoredPackageFile>, StoreError> {
    let one = |row: &Row| {
        let file = PackageFile {
            path: row.text("path")?,
            media_type: row.text("media_type")?,
            bytes: row.count("bytes")?,
            sha256: row.text("sha256")?,
        };
        Ok(StoredPackageFile { file, blob: parse("a blob name", &row.text("blob")?)? })
    };
    let rows = c.all(sql("SELECT * FROM package_files WHERE job = $1 ORDER BY path").bind(job.to_string())).await?;
    rows.iter().map(one).collect()
}
