//! Who may do what: every route for every role, owners, sessions, links, limits, and what the log tells.

mod limits;
mod log;
mod owners;
mod session;
mod streams;
mod table;

use super::*;
use crate::{
    auth::{Desk, Role, Roles, TokenId},
    config::AccessConfig,
    engine::Parts,
};
use kiln_proto::secret::Secret;
use std::sync::atomic::{AtomicI64, Ordering};

/// A holder of a token.
struct Holder {
    id: TokenId,
    token: Secret,
}

impl Holder {
    fn bearer(&self) -> String {
        format!("Bearer {}", self.token.expose())
    }

    fn request(&self, method: &str, path: &str, body: impl Into<Body>) -> Request<Body> {
        let request = Request::builder().method(method).uri(path).header(header::AUTHORIZATION, self.bearer());
        request.header(header::CONTENT_TYPE, "application/json").body(body.into()).unwrap()
    }
}

impl Bench {
    /// A service that asks for tokens.
    async fn closed(access: AccessConfig) -> Self {
        let folder = TempDir::new().unwrap();
        let config = Config { access: AccessConfig { require_tokens: true, ..access }, ..config(&folder) };
        Self::over(Engine::open(config).await.unwrap(), folder)
    }

    /// As [`Bench::closed`], at a moment that does not pass.
    async fn frozen(access: AccessConfig) -> Self {
        Self::timed(access, Arc::new(AtomicI64::new(1_000_000))).await
    }

    /// As [`Bench::closed`], by the test's own clock.
    async fn timed(access: AccessConfig, time: Arc<AtomicI64>) -> Self {
        let folder = TempDir::new().unwrap();
        let config = Config { access: AccessConfig { require_tokens: true, ..access }, ..config(&folder) };
        std::fs::create_dir_all(&config.data_dir).unwrap();
        let parts = Parts { clock: Arc::new(move || time.load(Ordering::Relaxed)), ..Parts::of(&config).await.unwrap() };
        Self::over(Engine::open_with(config, parts).await.unwrap(), folder)
    }

    async fn holder(&self, roles: &[Role]) -> Holder {
        let desk = Desk::new(self.engine.tokens());
        let minted = desk.create("test", Roles::of(roles), None, self.engine.now()).await.unwrap();
        Holder { id: minted.row.id, token: minted.text }
    }

    async fn by(&self, who: &Holder, method: &str, path: &str) -> Reply {
        self.send(who.request(method, path, Body::empty())).await
    }

    /// A job of the smallest scene; ids of job, upload and canonical scene.
    async fn job_of(&self, who: &Holder) -> (String, String, String) {
        let body = parts(&[("settings", None, r#"{"preset": "draft"}"#), ("scene", Some("room.obj"), OBJ)]);
        let request = Request::post("/v1/bakes").header(header::AUTHORIZATION, who.bearer()).header(header::CONTENT_TYPE, MULTIPART);
        let reply = self.send(request.body(body.into()).unwrap()).await;
        assert_eq!(reply.status, StatusCode::CREATED, "{:?}", reply.body);
        let json = reply.json();
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        (text(&json["job"]["id"]), text(&json["scene"]["id"]), text(&json["scene"]["scene"]))
    }
}
