//! Counts over everything, and which blobs are named.

use crate::{
    blob::BlobName,
    store::{
        Figures, StoreError, rows,
        sql::{Tx, sql},
    },
};

/// Whether any row names a blob.
pub(in super::super) async fn named(c: &mut Tx, blob: BlobName) -> Result<bool, StoreError> {
    let query = sql("SELECT CAST(1 AS BIGINT) AS one WHERE EXISTS (SELECT 1 FROM chunks WHERE blob = $1)
         OR EXISTS (SELECT 1 FROM package_files WHERE blob = $1) OR EXISTS (SELECT 1 FROM plans WHERE blob = $1)
         OR EXISTS (SELECT 1 FROM scenes WHERE canonical = $1)
         OR EXISTS (SELECT 1 FROM scenes WHERE files LIKE '%' || CAST($1 AS TEXT) || '%')");
    Ok(c.one(query.bind(blob.to_string())).await?.is_some())
}

/// Counts for metrics.
pub(in super::super) async fn figures(c: &mut Tx) -> Result<Figures, StoreError> {
    let rows = c.all(sql("SELECT public, COUNT(*) AS jobs FROM jobs GROUP BY public")).await?;
    let jobs = rows.iter().map(|row| Ok((row.text("public")?, row.count("jobs")?))).collect::<Result<_, StoreError>>()?;
    let sum = |column: &'static str, row: Option<crate::store::sql::Row>| row.map_or(Ok(0), |row| row.count(column));
    let pending = sql("SELECT CAST(COALESCE(SUM(s.waiting + s.unasked), 0) AS BIGINT) AS pending
         FROM jobs j CROSS JOIN shards s WHERE s.job = j.id AND (s.waiting > 0 OR s.unasked > 0) AND j.public = 'baking'");
    let tiles_pending = sum("pending", c.one(pending).await?)?;
    let held = c.all(sql("SELECT remaining FROM attempts WHERE state = 'held'")).await?;
    let tiles_leased = held.iter().map(|row| Ok(rows::runs(&row.text("remaining")?)?.len())).sum::<Result<u64, StoreError>>()?;
    let tasks = sum("tasks", c.one(sql("SELECT COUNT(*) AS tasks FROM tasks WHERE notice = 0")).await?)?;
    Ok(Figures { jobs, tiles_pending, tiles_leased, attempts_held: held.len() as u64, tasks })
}
