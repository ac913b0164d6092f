//! `/v1/session`: a browser trades a token for a cookie that scripts cannot read, and hands it back.
//!
//! The cookie is HttpOnly and SameSite=Strict, and Secure where the browser came over TLS. It names the token and is sealed by the service;
//! nothing is stored. A token in the page's own storage lost: any script that ever runs in the page could take it away.

use super::{
    App,
    credentials::COOKIE,
    extract::Json as JsonBody,
    gate::Caller,
    peer::Peer,
    problem::{Answer, Failure},
};
use crate::{
    auth::{Roles, audit::Action},
    engine::EngineError,
    records::UnixMillis,
};
use axum::{
    Extension, Json,
    extract::{ConnectInfo, State},
    http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header},
};
use kiln_proto::secret::Secret;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

/// Who wants a session.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LogIn {
    /// The text of a token.
    #[serde(deserialize_with = "secret")]
    #[schema(value_type = String, format = "password")]
    pub token: Secret,
}

fn secret<'de, D: Deserializer<'de>>(d: D) -> Result<Secret, D::Error> {
    String::deserialize(d).map(|text| Secret::new(text.trim()))
}

/// A session.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct OpenSession {
    /// The id of the token.
    pub token: String,
    /// What a person calls it.
    pub name: String,
    /// What it may be used for.
    #[schema(value_type = Vec<String>)]
    pub roles: Roles,
    /// When the session ends.
    pub expires_ms: UnixMillis,
}

type Cookie = [(HeaderName, HeaderValue); 1];

/// Open a session: the answer's cookie stands for the token until it ends.
#[utoipa::path(post, path = "/v1/session", operation_id = "logIn", tag = "access", request_body = LogIn,
    responses((status = 200, description = "Open", body = OpenSession, headers(("set-cookie" = String, description = "The session")))))]
pub(super) async fn open(
    State(app): State<App>,
    caller: Caller,
    peer: Option<Extension<ConnectInfo<Peer>>>,
    headers: HeaderMap,
    JsonBody(LogIn { token }): JsonBody<LogIn>,
) -> Answer<(Cookie, Json<OpenSession>)> {
    let known = app.gate.token(token.expose(), caller.from).await?;
    let length = app.engine.config().access.session_s;
    let session = app.gate.verifier.open_session(&known, length as i64).await.map_err(EngineError::Store)?;
    let age = session.expires_s - app.gate.verifier.now() / 1_000;
    Caller { principal: known.principal(), ..caller }.note(Action::LoggedIn, &known.id);
    let secure = is_secure(peer.as_ref(), &headers);
    let told = OpenSession { token: known.id.to_string(), name: known.name, roles: known.roles, expires_ms: session.expires_s * 1_000 };
    Ok((cookie(&session.to_string(), age, secure)?, Json(told)))
}

/// Close the session: the browser forgets the cookie. A copy of it would live on until it ends; revoke the token where one may exist.
#[utoipa::path(delete, path = "/v1/session", operation_id = "logOut", tag = "access", responses((status = 204, description = "Closed")))]
pub(super) async fn close(caller: Caller, peer: Option<Extension<ConnectInfo<Peer>>>, headers: HeaderMap) -> Answer<(StatusCode, Cookie)> {
    caller.note(Action::LoggedOut, &"session");
    Ok((StatusCode::NO_CONTENT, cookie("", 0, is_secure(peer.as_ref(), &headers))?))
}

/// Whether the browser came over TLS, to us or to a proxy before us. A client that lies about it harms its own cookie only.
fn is_secure(peer: Option<&Extension<ConnectInfo<Peer>>>, headers: &HeaderMap) -> bool {
    peer.is_some_and(|peer| peer.0.0.tls) || headers.get("x-forwarded-proto").is_some_and(|proto| proto == "https")
}

fn cookie(value: &str, age_s: i64, secure: bool) -> Answer<Cookie> {
    let secure = if secure { "; Secure" } else { "" };
    let text = format!("{COOKIE}={value}; Path=/; Max-Age={}; HttpOnly; SameSite=Strict{secure}", age_s.max(0));
    Ok([(header::SET_COOKIE, HeaderValue::try_from(text).map_err(Failure::internal)?)])
}
