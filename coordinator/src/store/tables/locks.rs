//! The rows that a group of calls about attempts will touch, locked in the one order before the first of them is looked at.
//!
//! Without it, two groups that share two jobs (or two shards) and meet them in another order would wait for each other until PostgreSQL gives
//! one of them up, a second later. SQLite has one writer, and needs none of this.

use crate::{
    lease::shard_of,
    store::{
        StoreError,
        rows::int,
        sql::{Tx, sql},
    },
};
use kiln_proto::{ids::Token, tile::TileIndex};

/// Locks the jobs, attempts and shards of these tokens.
pub(super) async fn of_attempts(c: &mut Tx, tokens: impl Iterator<Item = Token>) -> Result<(), StoreError> {
    if !c.is_postgres() {
        return Ok(());
    }
    let tokens: Vec<String> = tokens.map(|token| token.to_string()).collect();
    let query = sql("SELECT id FROM jobs WHERE id = ANY(ARRAY(SELECT job FROM attempts WHERE token = ANY($1))) ORDER BY id").locking();
    c.all(query.bind(tokens.clone())).await?;
    let query = sql("SELECT job, phase, first FROM attempts WHERE token = ANY($1) ORDER BY token").locking();
    let (mut jobs, mut phases, mut shards) = (vec![], vec![], vec![]);
    for row in c.all(query.bind(tokens)).await? {
        jobs.push(row.text("job")?);
        phases.push(row.text("phase")?);
        shards.push(int(shard_of(TileIndex(row.count("first")?))));
    }
    let query = sql("SELECT job FROM shards WHERE (job, phase, shard) IN (SELECT * FROM unnest($1::TEXT[], $2::TEXT[], $3::BIGINT[]))
         ORDER BY job, phase, shard");
    c.all(query.locking().bind(jobs).bind(phases).bind(shards)).await?;
    Ok(())
}
