//! The real router over a real engine in a temporary folder.

mod access;
mod jobs;
mod package;
mod page;
mod preview;
mod repeats;
mod simulated;
mod surface;
mod tcp;
mod tls;
mod uploads;
mod webhooks;
mod worker;

use super::{App, HostPolicy};
use crate::{config::Config, engine::Engine};
use axum::{
    Router,
    body::Body,
    http::{HeaderMap, Request, StatusCode, header},
};
use bytes::Bytes;
use serde_json::Value;
use std::{collections::BTreeSet, path::Path, sync::Arc};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;

/// A triangle of one square metre or so: the smallest scene there is.
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\ng floor\nf 1/1/1 2/2/1 3/3/1\n";

/// An engine in its own folder with the router over it.
struct Bench {
    engine: Arc<Engine>,
    router: Router,
    folder: TempDir,
}

/// An answer, read to its end.
struct Reply {
    status: StatusCode,
    headers: HeaderMap,
    body: Bytes,
}

impl Reply {
    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error} in {:?}", self.body))
    }

    /// Status, the last segment of the problem's type, and its detail.
    fn problem(&self) -> (u16, String, String) {
        assert_eq!(self.headers[header::CONTENT_TYPE], "application/problem+json", "{:?}", self.body);
        let json = self.json();
        assert_eq!(json["status"], self.status.as_u16());
        let text = |field: &str| json[field].as_str().unwrap_or_default().to_owned();
        (self.status.as_u16(), text("type").trim_start_matches("/problems/").to_owned(), text("detail"))
    }
}

impl Bench {
    async fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let engine = Engine::open(config(&folder)).await.unwrap();
        Self::over(engine, folder)
    }

    fn over(engine: Arc<Engine>, folder: TempDir) -> Self {
        let router = App::new(Arc::clone(&engine), HostPolicy::Loopback, None, CancellationToken::new()).router();
        Self { engine, router, folder }
    }

    async fn send(&self, request: Request<Body>) -> Reply {
        send(&self.router, request).await
    }

    async fn get(&self, path: &str) -> Reply {
        self.send(Request::get(path).body(Body::empty()).unwrap()).await
    }

    async fn post_json(&self, path: &str, json: &str) -> Reply {
        self.send(Request::post(path).header(header::CONTENT_TYPE, "application/json").body(json.to_owned().into()).unwrap()).await
    }

    async fn post_parts(&self, path: &str, body: String) -> Reply {
        self.send(Request::post(path).header(header::CONTENT_TYPE, MULTIPART).body(body.into()).unwrap()).await
    }

    /// Every file in the folder, to see that a refused request left nothing behind.
    fn files(&self) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        walk(self.folder.path(), &mut found);
        found
    }
}

fn config(folder: &TempDir) -> Config {
    Config { data_dir: folder.path().join("data"), workers: 0, reserve_bytes: 0, ..Config::default() }
}

async fn send(router: &Router, request: Request<Body>) -> Reply {
    let response = router.clone().oneshot(request).await.unwrap();
    let (head, body) = response.into_parts();
    let body = axum::body::to_bytes(body, 64 << 20).await.unwrap();
    Reply { status: head.status, headers: head.headers, body }
}

fn walk(folder: &Path, found: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            walk(&path, found);
        } else {
            found.insert(path.display().to_string());
        }
    }
}

/// The media type of bodies made by [`parts`].
const MULTIPART: &str = "multipart/form-data; boundary=frontier";

/// A multipart body: (field, filename, content).
fn parts(parts: &[(&str, Option<&str>, &str)]) -> String {
    let mut body = String::new();
    for (field, filename, content) in parts {
        let filename = filename.map(|name| format!("; filename=\"{name}\"")).unwrap_or_default();
        body += &format!("--frontier\r\nContent-Disposition: form-data; name=\"{field}\"{filename}\r\n\r\n{content}\r\n");
    }
    body + "--frontier--\r\n"
}
