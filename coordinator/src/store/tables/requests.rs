//! Requests that may be repeated.

use crate::{
    records::UnixMillis,
    store::{
        Claimed, KeptAnswer, NewRequest, REQUEST_KEPT, StoreError,
        rows::{from_json, json, parse},
        sql::{Tx, sql},
    },
};
use kiln_proto::ids::Token;

pub(in super::super) async fn claim(c: &mut Tx, request: &NewRequest, now: UnixMillis) -> Result<Claimed, StoreError> {
    let owner = request.owner.map_or_else(String::new, |id| id.to_string());
    // One statement, so that of two requests at the same moment one gets it. What is forgotten begins anew, with another id.
    let query = sql("INSERT INTO requests (owner, key, print, subject, claim, deadline, began) VALUES ($1, $2, $3, $4, $5, $6, $7)
         ON CONFLICT (owner, key) DO UPDATE SET claim = excluded.claim, deadline = excluded.deadline, answer = NULL, print = excluded.print,
         subject = CASE WHEN requests.began <= $8 THEN excluded.subject ELSE requests.subject END,
         began = CASE WHEN requests.began <= $8 THEN excluded.began ELSE requests.began END
         WHERE requests.began <= $8 OR (requests.answer IS NULL AND requests.deadline <= $7 AND requests.print = excluded.print)
         RETURNING subject");
    let query = query.bind(&owner).bind(&request.key).bind(request.print.to_string()).bind(request.subject.to_string());
    let query = query.bind(request.claim.to_string()).bind(request.deadline).bind(now).bind(now - REQUEST_KEPT);
    if let Some(row) = c.one(query).await? {
        return Ok(Claimed::Granted(parse("an id", &row.text("subject")?)?));
    }
    let query = sql("SELECT print, answer FROM requests WHERE owner = $1 AND key = $2").bind(owner).bind(&request.key);
    // Given up since: whoever asks again gets it.
    let Some(row) = c.one(query).await? else { return Ok(Claimed::Running) };
    if row.text("print")? != request.print.to_string() {
        return Ok(Claimed::Other);
    }
    Ok(row.maybe_text("answer")?.map(|text| from_json("an answer", &text)).transpose()?.map_or(Claimed::Running, Claimed::Answered))
}

pub(in super::super) async fn renew(c: &mut Tx, claim: Token, deadline: UnixMillis) -> Result<bool, StoreError> {
    let query = sql("UPDATE requests SET deadline = $1 WHERE claim = $2").bind(deadline).bind(claim.to_string());
    Ok(c.run(query).await? > 0)
}

pub(in super::super) async fn answer(c: &mut Tx, claim: Token, answer: &KeptAnswer) -> Result<bool, StoreError> {
    let query = sql("UPDATE requests SET answer = $1, claim = NULL, deadline = NULL WHERE claim = $2");
    Ok(c.run(query.bind(json(answer)?).bind(claim.to_string())).await? > 0)
}

/// Lets whoever asks again try at once, under the same id: what failed may have created what it was to create all the same.
pub(in super::super) async fn release(c: &mut Tx, claim: Token) -> Result<bool, StoreError> {
    let query = sql("UPDATE requests SET claim = NULL, deadline = 0 WHERE claim = $1").bind(claim.to_string());
    Ok(c.run(query).await? > 0)
}

pub(in super::super) async fn forget(c: &mut Tx, before: UnixMillis) -> Result<u64, StoreError> {
    c.run(sql("DELETE FROM requests WHERE began <= $1").bind(before)).await
}
