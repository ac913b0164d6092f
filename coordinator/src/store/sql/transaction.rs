//! A transaction, or a connection that only reads, of either database.

use super::{
    super::StoreError,
    statement::{Row, Statement},
};
use sqlx::{PgConnection, Postgres, Sqlite, SqliteConnection, Transaction, pool::PoolConnection};

/// What statements run in. Dropping one that writes without [`Tx::commit`] undoes it.
pub(crate) enum Tx {
    /// One writer at a time.
    Sqlite(Transaction<'static, Sqlite>),
    /// Reads only; each statement sees one state.
    SqliteRead(PoolConnection<Sqlite>),
    /// Read committed: rows that decisions rest on are locked first.
    Postgres(Transaction<'static, Postgres>),
    /// Reads only; each statement sees one state.
    PostgresRead(PoolConnection<Postgres>),
}

/// The connection beneath.
enum Connection<'c> {
    Sqlite(&'c mut SqliteConnection),
    Postgres(&'c mut PgConnection),
}

impl Tx {
    fn connection(&mut self) -> Connection<'_> {
        match self {
            Tx::Sqlite(tx) => Connection::Sqlite(tx),
            Tx::SqliteRead(c) => Connection::Sqlite(c),
            Tx::Postgres(tx) => Connection::Postgres(tx),
            Tx::PostgresRead(c) => Connection::Postgres(c),
        }
    }

    /// Whether it is PostgreSQL: then arrays may be bound, and rows must be locked.
    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self, Tx::Postgres(_) | Tx::PostgresRead(_))
    }

    /// Runs a statement; how many rows it touched.
    pub(crate) async fn run(&mut self, statement: Statement) -> Result<u64, StoreError> {
        match self.connection() {
            Connection::Sqlite(c) => {
                let (text, arguments) = statement.for_sqlite()?;
                Ok(sqlx::query_with(text, arguments).execute(c).await?.rows_affected())
            }
            Connection::Postgres(c) => {
                let (text, arguments) = statement.for_postgres()?;
                Ok(sqlx::query_with(text, arguments).execute(c).await?.rows_affected())
            }
        }
    }

    /// All rows of a statement.
    pub(crate) async fn all(&mut self, statement: Statement) -> Result<Vec<Row>, StoreError> {
        match self.connection() {
            Connection::Sqlite(c) => {
                let (text, arguments) = statement.for_sqlite()?;
                Ok(sqlx::query_with(text, arguments).fetch_all(c).await?.into_iter().map(Row::Sqlite).collect())
            }
            Connection::Postgres(c) => {
                let (text, arguments) = statement.for_postgres()?;
                let rows = sqlx::query_with(text, arguments).fetch_all(c).await?;
                Ok(rows.into_iter().map(Row::Postgres).collect())
            }
        }
    }

    /// The first row of a statement, where there is one.
    pub(crate) async fn one(&mut self, statement: Statement) -> Result<Option<Row>, StoreError> {
        Ok(self.all(statement).await?.into_iter().next())
    }

    /// Makes everything since the beginning durable.
    pub(crate) async fn commit(self) -> Result<(), StoreError> {
        match self {
            Tx::Sqlite(tx) => Ok(tx.commit().await?),
            Tx::Postgres(tx) => Ok(tx.commit().await?),
            Tx::SqliteRead(_) | Tx::PostgresRead(_) => Ok(()),
        }
    }
}
