//! What `kiln serve` can be told, from a TOML file, with a default for everything.
//!
//! Unknown keys are refused by name. [`Config::check`] finds every problem at once, because a person who fixes a file wants the whole list.

use crate::{blob::Location, records::Problem, sandbox::SandboxConfig, webhook::WebhookConfig};
use serde::{Deserialize, Serialize};
use std::{
    net::SocketAddr,
    path::{Path, PathBuf},
};

/// The configuration of a coordinator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Where the service listens.
    pub listen: SocketAddr,
    /// Where state lives, and blobs unless `blobs` says otherwise. Created when missing.
    pub data_dir: PathBuf,
    /// The database of state, as a `postgres://` URL; SQLite in the data folder where there is none.
    pub store: Option<String>,
    /// Where blobs live; in the data folder where nothing is said. Credentials and endpoints come from the environment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blobs: Option<String>,
    /// Worker processes that `kiln serve` starts beside itself.
    pub workers: u32,
    /// Threads of each of those workers; 0 for all cores.
    pub worker_threads: u32,
    /// How leases are sized and how long they live.
    pub lease: LeaseConfig,
    /// The share of tiles that two workers bake, in [0, 1], for jobs that do not ask for another.
    pub verify: f64,
    /// How chunks are closed and bounded.
    pub chunks: ChunkConfig,
    /// How long things are kept.
    pub keep: KeepConfig,
    /// What a process that imports or lays out a scene may take.
    pub sandbox: SandboxConfig,
    /// Who may do what, and over what.
    pub access: AccessConfig,
    /// Whom the service may tell of the end of jobs.
    pub webhooks: WebhookConfig,
    /// Coordinator tasks (import, assembly) that run at the same time.
    pub tasks: u32,
    /// Bytes that must stay free on the data folder's disk beside what a job is estimated to need.
    pub reserve_bytes: u64,
}

/// How leases are sized and how long they live.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LeaseConfig {
    /// An attempt expires this long after its last heartbeat, milliseconds.
    pub ttl_ms: u64,
    /// Workers are told to send heartbeats this often, milliseconds.
    pub heartbeat_ms: u64,
    /// A lease is sized for this much work, milliseconds.
    pub target_ms: u64,
    /// An attempt expires this long after its grant, whatever its heartbeats say, milliseconds.
    pub hard_cap_ms: u64,
    /// The longest long poll for work, milliseconds.
    pub poll_ms: u64,
    /// Leases that the jobs of one token hold at a time, at most; no bound where nothing is said. Without tokens it bounds each job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub per_token: Option<u64>,
    /// From which end pending tiles are leased. Results never depend on it; the choice exists so that tests can show that.
    pub order: LeaseOrder,
}

/// From which end pending tiles are leased.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LeaseOrder {
    /// First tiles first.
    #[default]
    Forward,
    /// Last tiles first.
    Reverse,
}

/// How chunks are closed and bounded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ChunkConfig {
    /// Workers close a chunk at this many bytes.
    pub bytes: u64,
    /// Workers close a chunk when its first segment is this old, milliseconds.
    pub age_ms: u64,
    /// Chunks that are checked at the same time; more are told to come back.
    pub concurrent: u32,
}

/// How long things are kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KeepConfig {
    /// Records of workers that fell silent, milliseconds.
    pub dead_workers_ms: u64,
    /// Blobs that no row names, milliseconds.
    pub unnamed_blobs_ms: u64,
    /// Jobs that have ended, with everything they hold, and uploads that no job uses, milliseconds; for ever where nothing is said.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jobs_ms: Option<u64>,
}

/// Access to the service. Tokens themselves are made with `kiln token`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccessConfig {
    /// Ask for a token also where none was ever made and the address is a loopback one.
    pub require_tokens: bool,
    /// Requests per second that one token may make for long; the worker protocol is not counted.
    pub requests_per_s: u32,
    /// Requests that one token may make at once.
    pub burst: u32,
    /// How long a browser's session lasts, seconds.
    pub session_s: u64,
    /// The server's certificate with its chain, PEM: the service speaks TLS. Needs `tls_key`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls_cert: Option<PathBuf>,
    /// The key of `tls_cert`, PEM.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls_key: Option<PathBuf>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            data_dir: PathBuf::from("kiln-data"),
            store: None,
            blobs: None,
            workers: 1,
            worker_threads: 0,
            lease: LeaseConfig::default(),
            verify: 0.0,
            chunks: ChunkConfig::default(),
            keep: KeepConfig::default(),
            sandbox: SandboxConfig::default(),
            access: AccessConfig::default(),
            webhooks: WebhookConfig::default(),
            tasks: 2,
            reserve_bytes: 256 << 20,
        }
    }
}

impl Default for LeaseConfig {
    fn default() -> Self {
        Self {
            ttl_ms: 30_000,
            heartbeat_ms: 10_000,
            target_ms: 10_000,
            hard_cap_ms: 3_600_000,
            poll_ms: 30_000,
            per_token: None,
            order: LeaseOrder::default(),
        }
    }
}

impl Default for ChunkConfig {
    fn default() -> Self {
        Self { bytes: 8 << 20, age_ms: 2_000, concurrent: 8 }
    }
}

impl Default for AccessConfig {
    fn default() -> Self {
        Self { require_tokens: false, requests_per_s: 200, burst: 400, session_s: 12 * 3_600, tls_cert: None, tls_key: None }
    }
}

impl Default for KeepConfig {
    fn default() -> Self {
        Self { dead_workers_ms: 24 * 3_600_000, unnamed_blobs_ms: 3_600_000, jobs_ms: None }
    }
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("the configuration {path} cannot be read")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The file is not such TOML; the text names line and key.
    #[error("the configuration {path} is not valid: {source}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its place.
        #[source]
        source: Box<toml::de::Error>,
    },
}

impl Config {
    /// Reads a TOML file. Values are not judged here: see [`Config::check`].
    ///
    /// # Errors
    /// Files that cannot be read, are not TOML, or have unknown keys or values of another type.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.to_owned(), source })?;
        toml::from_str(&text).map_err(|source| ConfigError::Parse { path: path.to_owned(), source: Box::new(source) })
    }

    /// Every problem with these values; empty when they can be used.
    #[must_use]
    pub fn check(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let mut require = |holds: bool, message: String| {
            if !holds {
                problems.push(Problem::new(message));
            }
        };
        let (lease, chunks, access) = (&self.lease, &self.chunks, &self.access);
        require(!self.data_dir.as_os_str().is_empty(), "data_dir: must name a folder".into());
        let is_postgres = |url: &String| url.starts_with("postgres://") || url.starts_with("postgresql://");
        require(
            self.store.as_ref().is_none_or(is_postgres),
            "store: expected postgres://USER:PASSWORD@HOST/DATABASE; without it state is kept in SQLite in data_dir".into(),
        );
        if let Some(Err(bad)) = self.blobs.as_ref().map(|text| text.parse::<Location>()) {
            require(false, format!("blobs: {bad}"));
        }
        require(self.workers <= 256, format!("workers: {} processes; at most 256 are started beside the service", self.workers));
        require((1..=64).contains(&self.tasks), format!("tasks: {} is not between 1 and 64", self.tasks));
        require(lease.heartbeat_ms >= 10, format!("lease.heartbeat_ms: {} is below 10", lease.heartbeat_ms));
        require(
            lease.ttl_ms >= 2 * lease.heartbeat_ms,
            format!(
                "lease.ttl_ms: {} is less than two heartbeats of {} ms; one lost heartbeat would cost the lease",
                lease.ttl_ms, lease.heartbeat_ms
            ),
        );
        require(lease.target_ms >= 1, "lease.target_ms: must be at least 1".into());
        require(
            lease.hard_cap_ms >= lease.ttl_ms,
            format!("lease.hard_cap_ms: {} is below lease.ttl_ms, {}", lease.hard_cap_ms, lease.ttl_ms),
        );
        require(lease.poll_ms <= 300_000, format!("lease.poll_ms: {} is above 300000", lease.poll_ms));
        require(lease.per_token != Some(0), "lease.per_token: 0 would lease nothing; leave it out for no bound".into());
        require((0.0..=1.0).contains(&self.verify), format!("verify: {} is not between 0 and 1", self.verify));
        require(
            (1..=kiln_proto::limits::CHUNK_BYTES).contains(&chunks.bytes),
            format!("chunks.bytes: {} is not between 1 and {}", chunks.bytes, kiln_proto::limits::CHUNK_BYTES),
        );
        let sandbox = &self.sandbox;
        require(
            sandbox.memory_bytes >= 256 << 20,
            format!("sandbox.memory_bytes: {} is below 268435456, which is what the program itself takes", sandbox.memory_bytes),
        );
        require(sandbox.cpu_seconds >= 1 && sandbox.seconds >= 1, "sandbox.cpu_seconds, sandbox.seconds: must be at least 1".into());
        require((1..=1_024).contains(&chunks.concurrent), format!("chunks.concurrent: {} is not between 1 and 1024", chunks.concurrent));
        require(
            // The moment that it comes to must be one that can be counted back to.
            self.keep.jobs_ms.is_none_or(|kept| (60_000..=1 << 52).contains(&kept)),
            "keep.jobs_ms: must be at least 60000, a minute; leave it out to keep jobs for ever".into(),
        );
        require(access.requests_per_s >= 1, "access.requests_per_s: must be at least 1".into());
        require(access.burst >= 1, "access.burst: must be at least 1".into());
        require(
            (60..=30 * 86_400).contains(&access.session_s),
            format!("access.session_s: {} is not between 60 and 2592000, thirty days", access.session_s),
        );
        require(
            access.tls_cert.is_some() == access.tls_key.is_some(),
            "access.tls_cert and access.tls_key: one is of no use without the other".into(),
        );
        problems.extend(self.webhooks.check());
        problems
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_sound_and_survive_toml() {
        let config = Config::default();
        assert_eq!(config.check(), vec![]);
        assert_eq!(toml::from_str::<Config>(&toml::to_string(&config).unwrap()).unwrap(), config);
        assert_eq!(toml::from_str::<Config>("").unwrap(), config);
    }

    #[test]
    fn unknown_keys_are_refused_by_name() {
        let error = toml::from_str::<Config>("[lease]\nttl = 5").unwrap_err().to_string();
        assert!(error.contains("ttl") && error.contains("ttl_ms"), "{error}");
    }

    #[test]
    fn every_problem_is_reported_at_once() {
        let mut config = Config { tasks: 0, blobs: Some("ftp://host".into()), ..Config::default() };
        config.lease.ttl_ms = 5_000;
        config.chunks.bytes = 0;
        config.store = Some("mysql://x".into());
        let text: Vec<String> = config.check().iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 5, "{text:?}");
        for (problem, key) in text.iter().zip(["store", "blobs", "tasks", "lease.ttl_ms", "chunks.bytes"]) {
            assert!(problem.starts_with(key), "{problem}");
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Config::read(Path::new("/nonexistent/kiln.toml")).unwrap_err().to_string();
        assert!(error.contains("/nonexistent/kiln.toml"), "{error}");
    }
}
