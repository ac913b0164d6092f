//! The client side of the HTTP API, for the commands that talk to a coordinator.

use crate::{
    access_args::{self, AccessArgs},
    error::CommandError,
};
use futures_util::StreamExt;
use kiln_coordinator::engine::JobPage;
use kiln_coordinator::import::bundle::{Bundle, Content};
use kiln_coordinator::records::{JobChange, JobRecord, NewJob, Problem, SceneRecord, SceneState, WorkerRecord};
use kiln_proto::{chain, ids::JobId, options::ImportOptions};
use kiln_worker::client::transport;
use reqwest::{RequestBuilder, Response, StatusCode, multipart};
use serde::{Deserialize, de::DeserializeOwned};
use std::{path::Path, time::Duration};
use tokio::io::AsyncWriteExt;
use uuid::Uuid;

/// How long a coordinator may be away before a command gives up on it.
const PATIENCE: Duration = Duration::from_secs(60);
/// How long to wait before it is asked again.
const RETRY: Duration = Duration::from_millis(300);
/// The header of a request that may be repeated.
const KEY: &str = "idempotency-key";
/// The problem of a request whose first try is still under way.
const IN_USE: &str = "/problems/idempotency-key-in-use";

/// A coordinator, from outside.
#[derive(Clone)]
pub struct Api {
    http: reqwest::Client,
    base: String,
}

/// RFC 9457, as far as a person wants to read it.
#[derive(Deserialize)]
struct ProblemBody {
    #[serde(rename = "type")]
    kind: Option<String>,
    title: Option<String>,
    detail: Option<String>,
    #[serde(default)]
    problems: Vec<Problem>,
}

/// The answer of `GET /v1/workers`.
#[derive(Deserialize)]
struct WorkerList {
    workers: Vec<WorkerRecord>,
}

impl Api {
    /// A client of the coordinator at `server`.
    pub fn new(server: &str, access: &AccessArgs) -> Result<Self, CommandError> {
        let base = access_args::address(server);
        let http = transport::builder(&base, &access.to(&base)).map_err(|e| CommandError::usage(chain(&e)))?;
        let http = http.read_timeout(Duration::from_secs(90)).build();
        let http = http.map_err(|e| CommandError::from_error("cannot start an HTTP client", &e))?;
        Ok(Self { http, base })
    }

    /// Its address.
    pub fn base(&self) -> &str {
        &self.base
    }

    fn url(&self, path: &str) -> String {
        format!("{}{path}", self.base)
    }

    /// Uploads a scene and waits until it is imported with these options.
    pub async fn upload(&self, bundle: &Bundle, options: &ImportOptions) -> Result<SceneRecord, CommandError> {
        // The answer comes within 30 s of the last byte, or is 202 while a large scene is still being imported.
        let send = async |key: &str| {
            let request = self.http.post(self.url("/v1/scenes")).header(KEY, key).query(options);
            self.json(request.multipart(form(bundle).await?)).await
        };
        let mut record: SceneRecord = self.once(send).await?;
        while matches!(record.state, SceneState::Uploaded | SceneState::Importing) {
            tokio::time::sleep(Duration::from_millis(500)).await;
            record = self.json(self.http.get(self.url(&format!("/v1/scenes/{}", record.id)))).await?;
        }
        if record.state == SceneState::Rejected {
            return Err(rejected(&record.problems));
        }
        Ok(record)
    }

    /// Creates a job.
    pub async fn create_job(&self, job: &NewJob) -> Result<JobRecord, CommandError> {
        self.once(async |key: &str| self.json(self.http.post(self.url("/v1/jobs")).header(KEY, key).json(job)).await).await
    }

    /// Repeats a call that creates something, under one key, so that it is created once. A coordinator that is away is waited for up to
    /// [`PATIENCE`], but not one that was never there.
    async fn once<T>(&self, call: impl AsyncFn(&str) -> Result<T, CommandError>) -> Result<T, CommandError> {
        let (key, start) = (Uuid::new_v4().to_string(), tokio::time::Instant::now());
        let mut reached = false;
        loop {
            match call(&key).await {
                Err(error) if error.is_away() && (reached || !error.is_absent()) && start.elapsed() < PATIENCE => {
                    reached = true;
                    tokio::time::sleep(RETRY).await;
                }
                other => return other,
            }
        }
    }

    /// A job as it is now; a coordinator that is away is waited for.
    pub async fn job_patiently(&self, id: JobId) -> Result<JobRecord, CommandError> {
        self.patiently(|| self.json(self.http.get(self.url(&format!("/v1/jobs/{id}"))))).await
    }

    /// Repeats a call while the coordinator is away, up to [`PATIENCE`].
    async fn patiently<T>(&self, call: impl AsyncFn() -> Result<T, CommandError>) -> Result<T, CommandError> {
        let start = tokio::time::Instant::now();
        loop {
            match call().await {
                Err(error) if error.is_away() && start.elapsed() < PATIENCE => tokio::time::sleep(RETRY).await,
                other => return other,
            }
        }
    }

    /// All jobs, newest first.
    pub async fn jobs(&self, state: Option<&str>, label: Option<&str>) -> Result<Vec<JobRecord>, CommandError> {
        let mut all = Vec::new();
        let mut cursor: Option<String> = None;
        loop {
            let query: Vec<(&str, &str)> = [("state", state), ("label", label), ("cursor", cursor.as_deref())]
                .into_iter()
                .filter_map(|(key, value)| Some((key, value?)))
                .collect();
            let page: JobPage = self.json(self.http.get(self.url("/v1/jobs")).query(&query)).await?;
            all.extend(page.jobs);
            cursor = page.next.map(|id| id.to_string());
            if cursor.is_none() {
                return Ok(all);
            }
        }
    }

    /// Cancels a job.
    pub async fn cancel(&self, id: JobId) -> Result<JobRecord, CommandError> {
        self.json(self.http.post(self.url(&format!("/v1/jobs/{id}/cancel")))).await
    }

    /// Pauses or resumes a job.
    pub async fn change(&self, id: JobId, change: &JobChange) -> Result<JobRecord, CommandError> {
        self.json(self.http.patch(self.url(&format!("/v1/jobs/{id}"))).json(change)).await
    }

    /// Tries the tiles of a failed job again that were given up.
    pub async fn retry(&self, id: JobId) -> Result<JobRecord, CommandError> {
        self.json(self.http.post(self.url(&format!("/v1/jobs/{id}/retry")))).await
    }

    /// Workers that are connected.
    pub async fn workers(&self) -> Result<Vec<WorkerRecord>, CommandError> {
        Ok(self.json::<WorkerList>(self.http.get(self.url("/v1/workers"))).await?.workers)
    }

    /// The job's event stream after `seq`, as raw bytes.
    pub async fn events(&self, id: JobId, seq: i64) -> Result<Response, CommandError> {
        let request = self.http.get(self.url(&format!("/v1/jobs/{id}/events"))).header("last-event-id", seq.to_string());
        self.ok(request).await
    }

    /// The manifest of a finished job, as its bytes.
    pub async fn manifest(&self, id: JobId) -> Result<Vec<u8>, CommandError> {
        self.patiently(|| async {
            let response = self.ok(self.http.get(self.url(&format!("/v1/jobs/{id}/assets")))).await?;
            Ok(response.bytes().await.map_err(|e| self.unreachable(&e))?.to_vec())
        })
        .await
    }

    /// Downloads one file of a package.
    pub async fn asset(&self, id: JobId, path: &str, to: &Path) -> Result<(), CommandError> {
        self.patiently(|| self.download(format!("/v1/jobs/{id}/assets/{path}"), to)).await
    }

    async fn download(&self, path: String, to: &Path) -> Result<(), CommandError> {
        let at = |e: std::io::Error| CommandError::work(format!("{}: {e}", to.display()));
        let response = self.ok(self.http.get(self.url(&path))).await?;
        let mut file = tokio::fs::File::create(to).await.map_err(at)?;
        let mut body = response.bytes_stream();
        while let Some(piece) = body.next().await {
            file.write_all(&piece.map_err(|e| self.unreachable(&e))?).await.map_err(at)?;
        }
        file.flush().await.map_err(at)
    }

    async fn json<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, CommandError> {
        let response = request.send().await.map_err(|e| self.unreachable(&e))?;
        self.read(response).await
    }

    async fn read<T: DeserializeOwned>(&self, response: Response) -> Result<T, CommandError> {
        let response = self.refuse_errors(response).await?;
        let bytes = response.bytes().await.map_err(|e| self.unreachable(&e))?;
        serde_json::from_slice(&bytes).map_err(|e| CommandError::work(format!("{} gave an answer that cannot be read: {e}", self.base)))
    }

    async fn ok(&self, request: RequestBuilder) -> Result<Response, CommandError> {
        let response = request.send().await.map_err(|e| self.unreachable(&e))?;
        self.refuse_errors(response).await
    }

    async fn refuse_errors(&self, response: Response) -> Result<Response, CommandError> {
        let status = response.status();
        if status.is_success() {
            return Ok(response);
        }
        let body = response.bytes().await.unwrap_or_default();
        // A disk that is too small is no larger a moment later.
        let is_away = status.is_server_error() && status != StatusCode::INSUFFICIENT_STORAGE;
        let Ok(problem) = serde_json::from_slice::<ProblemBody>(&body) else {
            let said = format!("{} answered {status}; is it a Kiln coordinator?", self.base);
            return Err(if is_away { CommandError::away(said) } else { CommandError::work(said) });
        };
        if !problem.problems.is_empty() {
            return Err(rejected(&problem.problems));
        }
        let mut said = problem.detail.or(problem.title).unwrap_or_else(|| status.to_string());
        if status == StatusCode::UNAUTHORIZED {
            said += "; give one that is good with --token or KILN_TOKEN";
        }
        let is_away = is_away || problem.kind.as_deref() == Some(IN_USE);
        Err(if is_away { CommandError::away(said) } else { CommandError::work(said) })
    }

    fn unreachable(&self, error: &reqwest::Error) -> CommandError {
        let said = format!("the coordinator at {} cannot be reached: {}; is `kiln serve` running there?", self.base, chain(error));
        if error.is_connect() { CommandError::absent(said) } else { CommandError::away(said) }
    }
}

/// The files of a scene as an upload has them.
async fn form(bundle: &Bundle) -> Result<multipart::Form, CommandError> {
    let mut form = multipart::Form::new();
    for (name, content) in bundle.files() {
        let part = match content {
            Content::Bytes(bytes) => multipart::Part::bytes(bytes.clone()),
            Content::File(path) => multipart::Part::file(path).await.map_err(|e| CommandError::work(format!("{}: {e}", path.display())))?,
        };
        form = form.part("file", part.file_name(name.as_str().to_owned()));
    }
    Ok(form)
}

/// A scene that was not taken, with every reason.
pub fn rejected(problems: &[Problem]) -> CommandError {
    CommandError::work(problems.iter().fold("the scene was rejected".to_owned(), |text, p| format!("{text}\n  {p}")))
}
