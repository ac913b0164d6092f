//! Statements with their values, and rows.

use super::super::{StoreError, rows};
use sqlx::{
    Arguments, AssertSqlSafe, Database, Decode, SqlSafeStr, SqlStr, Type,
    postgres::{PgArguments, PgRow},
    sqlite::{SqliteArguments, SqliteRow},
};
use std::borrow::Cow;

/// A value of a statement. Ids and hashes travel as text.
#[derive(Debug, Clone)]
enum Value {
    Int(Option<i64>),
    Real(f64),
    Text(Option<String>),
    /// Arrays exist in PostgreSQL alone.
    Ints(Vec<i64>),
    Texts(Vec<String>),
}

/// What can be bound to a parameter.
pub(crate) trait Bind {
    fn value(self) -> Bound;
}

/// A value of one of the kinds that both databases know.
pub(crate) struct Bound(Value);

macro_rules! bind {
    ($($type:ty => |$v:ident| $value:expr),* $(,)?) => {
        $(impl Bind for $type {
            fn value(self) -> Bound {
                let $v = self;
                Bound($value)
            }
        })*
    };
}

bind! {
    i64 => |v| Value::Int(Some(v)),
    i32 => |v| Value::Int(Some(v.into())),
    u32 => |v| Value::Int(Some(v.into())),
    u64 => |v| Value::Int(Some(rows::int(v))),
    Option<i64> => |v| Value::Int(v),
    f64 => |v| Value::Real(v),
    String => |v| Value::Text(Some(v)),
    &String => |v| Value::Text(Some(v.clone())),
    &str => |v| Value::Text(Some(v.to_owned())),
    Option<String> => |v| Value::Text(v),
    Vec<i64> => |v| Value::Ints(v),
    Vec<String> => |v| Value::Texts(v),
}

/// A statement with its values.
pub(crate) struct Statement {
    sqlite: &'static str,
    postgres: Cow<'static, str>,
    values: Vec<Value>,
}

/// A statement that both databases understand.
pub(crate) fn sql(text: &'static str) -> Statement {
    either(text, text)
}

/// A statement in each dialect. Parameters are the same.
pub(crate) fn either(sqlite: &'static str, postgres: &'static str) -> Statement {
    Statement { sqlite, postgres: Cow::Borrowed(postgres), values: Vec::new() }
}

impl Statement {
    /// Binds the next parameter.
    #[must_use]
    pub(crate) fn bind(mut self, value: impl Bind) -> Self {
        self.values.push(value.value().0);
        self
    }

    /// Locks the rows that it selects until the transaction ends. SQLite has one writer, and needs no locks.
    #[must_use]
    pub(crate) fn locking(mut self) -> Self {
        self.postgres = Cow::Owned(format!("{} FOR NO KEY UPDATE", self.postgres));
        self
    }

    pub(super) fn for_sqlite(self) -> Result<(&'static str, SqliteArguments), StoreError> {
        let mut arguments = SqliteArguments::default();
        for value in self.values {
            let added = match value {
                Value::Int(v) => arguments.add(v),
                Value::Real(v) => arguments.add(v),
                Value::Text(v) => arguments.add(v),
                Value::Ints(_) | Value::Texts(_) => return Err(rows::strange("a value that SQLite knows", "an array")),
            };
            added.map_err(|e| StoreError::Database(sqlx::Error::Encode(e)))?;
        }
        Ok((self.sqlite, arguments))
    }

    pub(super) fn for_postgres(self) -> Result<(SqlStr, PgArguments), StoreError> {
        let mut arguments = PgArguments::default();
        for value in self.values {
            let added = match value {
                Value::Int(v) => arguments.add(v),
                Value::Real(v) => arguments.add(v),
                Value::Text(v) => arguments.add(v),
                Value::Ints(v) => arguments.add(v),
                Value::Texts(v) => arguments.add(v),
            };
            added.map_err(|e| StoreError::Database(sqlx::Error::Encode(e)))?;
        }
        let text = match self.postgres {
            Cow::Borrowed(text) => text.into_sql_str(),
            // What `locking` has added.
            Cow::Owned(text) => AssertSqlSafe(text).into_sql_str(),
        };
        Ok((text, arguments))
    }
}

/// A row of an answer.
pub(crate) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

fn get<'r, R: sqlx::Row, T>(row: &'r R, column: &str) -> Result<T, StoreError>
where
    T: Decode<'r, R::Database> + Type<R::Database>,
    for<'c> &'c str: sqlx::ColumnIndex<R>,
    R::Database: Database,
{
    Ok(row.try_get(column)?)
}

macro_rules! column {
    ($($(#[$doc:meta])* $name:ident: $type:ty),* $(,)?) => {
        $($(#[$doc])*
        pub(crate) fn $name(&self, column: &str) -> Result<$type, StoreError> {
            match self {
                Row::Sqlite(row) => get(row, column),
                Row::Postgres(row) => get(row, column),
            }
        })*
    };
}

impl Row {
    column! {
        /// A text.
        text: String,
        /// A text or NULL.
        maybe_text: Option<String>,
        /// A whole number.
        int: i64,
        /// A whole number or NULL.
        maybe_int: Option<i64>,
        /// A number.
        real: f64,
    }

    /// A whole number that counts something.
    pub(crate) fn count(&self, column: &str) -> Result<u64, StoreError> {
        self.int(column).map(rows::count)
    }

    /// A whole number of 32 bits.
    pub(crate) fn small(&self, column: &str) -> Result<u32, StoreError> {
        let found = self.int(column)?;
        u32::try_from(found).map_err(|_| rows::strange("a number of 32 bits", found.to_string()))
    }
}
