//! Tokens, the secret of the service, and whose jobs are.

use crate::{
    auth::{Scope, TokenId, TokenRow},
    records::UnixMillis,
    store::{
        StoreError,
        rows::{parse, strange},
        sql::{Row, Tx, sql},
    },
};
use kiln_proto::ids::{Digest, JobId};

fn row(row: &Row) -> Result<TokenRow, StoreError> {
    Ok(TokenRow {
        id: parse("a token id", &row.text("id")?)?,
        name: row.text("name")?,
        roles: parse("roles", &row.text("roles")?)?,
        hash: parse("a hash", &row.text("hash")?)?,
        created_ms: row.int("created")?,
        used_ms: row.maybe_int("used")?,
        expires_ms: row.maybe_int("expires")?,
        revoked_ms: row.maybe_int("revoked")?,
    })
}

/// Whose a row is.
pub(super) fn owner(row: &Row) -> Result<Option<TokenId>, StoreError> {
    row.maybe_text("owner")?.map(|text| parse("a token id", &text)).transpose()
}

/// A scope as two parameters of `(CAST($a AS TEXT) IS NULL OR owner = $a)`: the owner, where one is asked for. Nobody owns what `Nothing` asks.
pub(super) fn owned_by(scope: Scope) -> Option<String> {
    match scope {
        Scope::All => None,
        Scope::Own(id) => Some(id.to_string()),
        Scope::Nothing => Some(String::new()),
    }
}

pub(in super::super) async fn add(c: &mut Tx, token: &TokenRow) -> Result<(), StoreError> {
    let query = sql("INSERT INTO tokens (id, name, roles, hash, created, used, expires, revoked) VALUES ($1, $2, $3, $4, $5, $6, $7, $8)");
    let query = query.bind(token.id.to_string()).bind(&token.name).bind(token.roles.to_string()).bind(token.hash.to_string());
    c.run(query.bind(token.created_ms).bind(token.used_ms).bind(token.expires_ms).bind(token.revoked_ms)).await?;
    Ok(())
}

pub(in super::super) async fn get(c: &mut Tx, id: TokenId) -> Result<Option<TokenRow>, StoreError> {
    c.one(sql("SELECT * FROM tokens WHERE id = $1").bind(id.to_string())).await?.as_ref().map(row).transpose()
}

pub(in super::super) async fn list(c: &mut Tx) -> Result<Vec<TokenRow>, StoreError> {
    c.all(sql("SELECT * FROM tokens ORDER BY created, id")).await?.iter().map(row).collect()
}

pub(in super::super) async fn any(c: &mut Tx) -> Result<bool, StoreError> {
    Ok(c.one(sql("SELECT id FROM tokens LIMIT 1")).await?.is_some())
}

pub(in super::super) async fn rotate(c: &mut Tx, id: TokenId, hash: Digest) -> Result<bool, StoreError> {
    let query = sql("UPDATE tokens SET hash = $1 WHERE id = $2 AND revoked IS NULL");
    Ok(c.run(query.bind(hash.to_string()).bind(id.to_string())).await? > 0)
}

pub(in super::super) async fn revoke(c: &mut Tx, id: TokenId, now: UnixMillis) -> Result<bool, StoreError> {
    let query = sql("UPDATE tokens SET revoked = $1 WHERE id = $2 AND revoked IS NULL");
    Ok(c.run(query.bind(now).bind(id.to_string())).await? > 0)
}

pub(in super::super) async fn touch(c: &mut Tx, id: TokenId, now: UnixMillis) -> Result<(), StoreError> {
    let query = sql("UPDATE tokens SET used = CASE WHEN used > $1 THEN used ELSE $1 END WHERE id = $2");
    c.run(query.bind(now).bind(id.to_string())).await?;
    Ok(())
}

pub(in super::super) async fn service_secret(c: &mut Tx, fresh: [u8; 32]) -> Result<[u8; 32], StoreError> {
    let query = sql("INSERT INTO secrets (name, value) VALUES ('service', $1) ON CONFLICT DO NOTHING");
    c.run(query.bind(Digest(fresh).to_string())).await?;
    let row = c.one(sql("SELECT value FROM secrets WHERE name = 'service'")).await?;
    let row = row.ok_or_else(|| strange("the secret of the service", "nothing"))?;
    // What is wrong with it must not be told.
    row.text("value")?.parse::<Digest>().map(|Digest(secret)| secret).map_err(|_| strange("a secret of 32 bytes", "something else"))
}

pub(in super::super) async fn job_owner(c: &mut Tx, id: JobId) -> Result<Option<Option<TokenId>>, StoreError> {
    c.one(sql("SELECT owner FROM jobs WHERE id = $1").bind(id.to_string())).await?.as_ref().map(owner).transpose()
}
