//! Workers that get nothing any more, and what a worker that lied had delivered.

use super::{attempts, jobs, lost, shards};
use crate::{
    lease::Shard,
    records::{Problem, UnixMillis},
    store::{
        StoreError,
        rows::{parse, phase},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::{
    ids::{JobId, WorkerId},
    wire::message::Phase,
};

/// Gives a worker no lease any more and takes back what it holds. The followers of the job in which it came out are told.
pub(super) async fn bar(c: &mut Tx, worker: WorkerId, reason: &str, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("UPDATE workers SET barred = $1 WHERE id = $2 AND barred IS NULL").bind(reason);
    if c.run(query.bind(worker.to_string())).await? > 0 {
        jobs::add_problem(c, job, &Problem::new(format!("worker {worker} is barred: {reason}")), now).await?;
    }
    attempts::dismiss(c, worker, now).await
}

/// A worker lied, in this job: it is barred, its word counts nowhere any more, and what it delivered to phases that are still open, of any
/// job, is baked again.
pub(super) async fn expel(c: &mut Tx, worker: WorkerId, job: JobId, now: UnixMillis) -> Result<(), StoreError> {
    bar(c, worker, "two other workers agree that its bytes were wrong", job, now).await?;
    let query = sql("SELECT job, phase FROM chunks WHERE worker = $1 AND accepted <> '' GROUP BY job, phase ORDER BY job, phase");
    for row in c.all(query.bind(worker.to_string())).await? {
        let (of, phase) = (parse("a job id", &row.text("job")?)?, phase(&row.text("phase")?)?);
        lost::take_back(c, of, phase, worker, now).await?;
    }
    for (of, phase, index, mut shard) in heard(c, worker).await? {
        // Tiles that it delivered were taken back just now, and their checks with them.
        shard.checks.distrust(worker);
        shards::save(c, of, phase, index, &shard).await?;
    }
    Ok(())
}

/// Shards in which the word of a worker stands, locked.
async fn heard(c: &mut Tx, worker: WorkerId) -> Result<Vec<(JobId, Phase, u64, Shard)>, StoreError> {
    let query = sql("SELECT * FROM shards WHERE unchecked > 0 AND checks LIKE '%' || CAST($1 AS TEXT) || '%' ORDER BY job, phase, shard");
    let one = |row: &Row| Ok((parse("a job id", &row.text("job")?)?, phase(&row.text("phase")?)?, row.count("shard")?, shards::row(row)?));
    c.all(query.locking().bind(worker.to_string())).await?.iter().map(one).collect()
}
