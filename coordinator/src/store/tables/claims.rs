//! What each job that bakes has waiting, and what it holds already: what the choice of the next one rests on.

use super::tokens;
use crate::store::{
    ClaimRow, StoreError,
    rows::{parse, strange},
    sql::{Row, Tx, sql},
};

/// Jobs of a bake version that lease tiles, by age.
pub(in super::super) async fn claims(c: &mut Tx, bake_version: u32) -> Result<Vec<ClaimRow>, StoreError> {
    let query = sql("SELECT id, priority, owner,
         (SELECT CAST(COALESCE(SUM(waiting), 0) AS BIGINT) FROM shards s WHERE s.job = j.id AND s.waiting > 0) AS waiting,
         (SELECT CAST(COALESCE(SUM(unasked), 0) AS BIGINT) FROM shards s WHERE s.job = j.id AND s.unchecked > 0) AS unasked,
         (SELECT COUNT(*) FROM attempts a WHERE a.job = j.id AND a.state = 'held') AS leased
         FROM jobs j WHERE public = 'baking' AND bake_version = $1 ORDER BY id");
    c.all(query.bind(bake_version)).await?.iter().map(row).collect()
}

fn row(row: &Row) -> Result<ClaimRow, StoreError> {
    let priority = row.int("priority")?;
    Ok(ClaimRow {
        job: parse("a job id", &row.text("id")?)?,
        priority: i32::try_from(priority).map_err(|_| strange("a priority", priority.to_string()))?,
        owner: tokens::owner(row)?,
        waiting: row.count("waiting")?,
        unasked: row.count("unasked")?,
        leased: row.count("leased")?,
    })
}
