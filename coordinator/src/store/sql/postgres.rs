//! PostgreSQL: several coordinators on one database.
//!
//! Read committed, with the rows that a decision rests on locked first (see [`tables`](super::super::tables) for the order); a transaction that
//! PostgreSQL gives up all the same is begun anew. Hints travel by NOTIFY, in a statement of their own outside of any transaction and at
//! most a few times a second: NOTIFY takes a lock that all commits of the database share.

use super::{super::StoreError, Tx};
use crate::{records::UnixMillis, store::Hints};
use futures_util::{StreamExt, stream};
use kiln_proto::ids::JobId;
use sqlx::{
    PgConnection, PgPool,
    postgres::{PgConnectOptions, PgListener, PgPoolOptions},
};
use std::{str::FromStr, time::Duration};

/// One entry per schema: what takes a database from the one before to it, and the oldest schema whose programs can go on beside it. Entries
/// are never edited, only added.
const MIGRATIONS: [(&str, i64); 3] = [
    (include_str!("schema/postgres1.sql"), 1),
    (include_str!("schema/postgres2.sql"), 1),
    // Programs before it would take the tasks that tell webhooks, and not know what they are.
    (include_str!("schema/postgres3.sql"), 3),
];

/// Connections of one coordinator.
const CONNECTIONS: u32 = 10;
/// How long a call waits for a connection; whoever asked is told to come back then.
const PATIENCE: Duration = Duration::from_secs(10);
/// The key of the lock under which the schema changes: "kiln".
const SCHEMA_LOCK: i64 = 0x6b69_6c6e;
/// The channel of hints.
const CHANNEL: &str = "kiln";
/// Ids in one hint, at most: PostgreSQL takes 8,000 bytes.
const IDS: usize = 200;

/// A database that others may use too.
pub(super) struct PostgresDatabase {
    pub(super) pool: PgPool,
    name: String,
}

impl PostgresDatabase {
    /// Connects, and brings the schema up to date.
    pub(super) async fn open(url: &str) -> Result<Self, StoreError> {
        let options = PgConnectOptions::from_str(url).map_err(|source| StoreError::Open { database: without_password(url), source })?;
        let options = options.application_name("kiln");
        let name = format!("postgres://{}:{}/{}", options.get_host(), options.get_port(), options.get_database().unwrap_or("postgres"));
        let fail = |source| StoreError::Open { database: name.clone(), source };
        let pool = PgPoolOptions::new().max_connections(CONNECTIONS).acquire_timeout(PATIENCE).connect_with(options);
        let pool = pool.await.map_err(fail)?;
        migrate(&mut *pool.acquire().await.map_err(fail)?, &name).await?;
        Ok(Self { pool, name })
    }

    pub(super) async fn write(&self) -> Result<Tx, StoreError> {
        Ok(Tx::Postgres(self.pool.begin().await?))
    }

    pub(super) async fn read(&self) -> Result<Tx, StoreError> {
        Ok(Tx::PostgresRead(self.pool.acquire().await?))
    }

    /// The time by the database's clock.
    pub(super) async fn clock(&self) -> Result<UnixMillis, StoreError> {
        let query = sqlx::query_scalar("SELECT CAST(EXTRACT(EPOCH FROM clock_timestamp()) * 1000 AS BIGINT)");
        Ok(query.fetch_one(&self.pool).await?)
    }

    /// Tells the other coordinators which jobs changed.
    pub(super) async fn hint(&self, jobs: &[JobId]) -> Result<(), StoreError> {
        for some in jobs.chunks(IDS) {
            let ids: Vec<String> = some.iter().map(JobId::to_string).collect();
            sqlx::query("SELECT pg_notify($1, $2)").bind(CHANNEL).bind(ids.join(" ")).execute(&self.pool).await?;
        }
        Ok(())
    }

    /// What the other coordinators tell; connects again by itself.
    pub(super) async fn hints(&self) -> Result<Hints, StoreError> {
        let mut listener = PgListener::connect_with(&self.pool).await?;
        listener.listen(CHANNEL).await?;
        let name = self.name.clone();
        let told = stream::unfold((listener, name), |(mut listener, name)| async move {
            loop {
                match listener.recv().await {
                    Ok(note) => {
                        let jobs = note.payload().split(' ').filter_map(|id| id.parse().ok()).collect();
                        return Some((jobs, (listener, name)));
                    }
                    // Hints that are lost meanwhile cost a moment: everybody looks by themselves once a second.
                    Err(error) => {
                        tracing::warn!(%error, database = name, "waiting for hints failed");
                        tokio::time::sleep(Duration::from_secs(1)).await;
                    }
                }
            }
        });
        Ok(told.boxed())
    }

    pub(super) async fn close(&self) {
        self.pool.close().await;
    }
}

/// A URL as messages may show it.
fn without_password(url: &str) -> String {
    match (url.find("://"), url.rfind('@')) {
        (Some(scheme), Some(at)) if scheme + 3 <= at => format!("{}{}", &url[..scheme + 3], &url[at + 1..]),
        _ => url.to_owned(),
    }
}

/// Brings the schema up to date while no other coordinator does. A database that a later Kiln has changed is used as it is where that Kiln
/// says so, so that coordinators can be replaced one by one.
async fn migrate(c: &mut PgConnection, name: &str) -> Result<(), StoreError> {
    sqlx::query("SELECT pg_advisory_lock($1)").bind(SCHEMA_LOCK).execute(&mut *c).await?;
    let outcome = migrate_locked(c, name).await;
    sqlx::query("SELECT pg_advisory_unlock($1)").bind(SCHEMA_LOCK).execute(&mut *c).await?;
    outcome
}

async fn migrate_locked(c: &mut PgConnection, name: &str) -> Result<(), StoreError> {
    use sqlx::Connection;
    let known = MIGRATIONS.len() as i64;
    sqlx::raw_sql("CREATE TABLE IF NOT EXISTS kiln_schema (version BIGINT PRIMARY KEY, oldest BIGINT NOT NULL)").execute(&mut *c).await?;
    let query = sqlx::query_as("SELECT version, oldest FROM kiln_schema ORDER BY version DESC LIMIT 1");
    let (found, oldest): (i64, i64) = query.fetch_optional(&mut *c).await?.unwrap_or((0, 0));
    if oldest > known {
        return Err(StoreError::Newer { database: name.to_owned(), found, known });
    }
    for (index, (migration, oldest)) in MIGRATIONS.iter().enumerate().skip(usize::try_from(found).unwrap_or(0)) {
        let mut tx = c.begin().await?;
        sqlx::raw_sql(*migration).execute(&mut *tx).await?;
        let insert = sqlx::query("INSERT INTO kiln_schema (version, oldest) VALUES ($1, $2)").bind(index as i64 + 1).bind(*oldest);
        insert.execute(&mut *tx).await?;
        tx.commit().await?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_show_no_password() {
        assert_eq!(without_password("postgres://a:s@cret@db:5/x"), "postgres://db:5/x");
        assert_eq!(without_password("postgres://db/x"), "postgres://db/x");
    }
}
