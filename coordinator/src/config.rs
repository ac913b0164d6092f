//! What `kiln serve` can be told, from a TOML file, with a default for everything.
//!
//! Unknown keys are refused by name. [`Config::check`] finds every problem at once, because a person who fixes a file wants the whole list.

use crate::records::Problem;
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
    /// Where state and blobs live. Created when missing.
    pub data_dir: PathBuf,
    /// Worker processes that `kiln serve` starts beside itself.
    pub workers: u32,
    /// Threads of each of those workers; 0 for all cores.
    pub worker_threads: u32,
    /// How leases are sized and how long they live.
    pub lease: LeaseConfig,
    /// How chunks are closed and bounded.
    pub chunks: ChunkConfig,
    /// How long things are kept.
    pub keep: KeepConfig,
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
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            data_dir: PathBuf::from("kiln-data"),
            workers: 1,
            worker_threads: 0,
            lease: LeaseConfig::default(),
            chunks: ChunkConfig::default(),
            keep: KeepConfig::default(),
            tasks: 2,
            reserve_bytes: 256 << 20,
        }
    }
}

impl Default for LeaseConfig {
    fn default() -> Self {
        Self { ttl_ms: 30_000, heartbeat_ms: 10_000, target_ms: 10_000, hard_cap_ms: 3_600_000, poll_ms: 30_000 }
    }
}

impl Default for ChunkConfig {
    fn default() -> Self {
        Self { bytes: 8 << 20, age_ms: 2_000, concurrent: 8 }
    }
}

impl Default for KeepConfig {
    fn default() -> Self {
        Self { dead_workers_ms: 24 * 3_600_000, unnamed_blobs_ms: 3_600_000 }
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
                problems.push(Problem { message, file: None, line: None });
            }
        };
        let (lease, chunks) = (&self.lease, &self.chunks);
        require(!self.data_dir.as_os_str().is_empty(), "data_dir: must name a folder".into());
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
        require(
            (1..=kiln_proto::limits::CHUNK_BYTES).contains(&chunks.bytes),
            format!("chunks.bytes: {} is not between 1 and {}", chunks.bytes, kiln_proto::limits::CHUNK_BYTES),
        );
        require((1..=1_024).contains(&chunks.concurrent), format!("chunks.concurrent: {} is not between 1 and 1024", chunks.concurrent));
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
        let mut config = Config { tasks: 0, ..Config::default() };
        config.lease.ttl_ms = 5_000;
        config.chunks.bytes = 0;
        let text: Vec<String> = config.check().iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 3, "{text:?}");
        for (problem, key) in text.iter().zip(["tasks", "lease.ttl_ms", "chunks.bytes"]) {
            assert!(problem.starts_with(key), "{problem}");
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = Config::read(Path::new("/nonexistent/kiln.toml")).unwrap_err().to_string();
        assert!(error.contains("/nonexistent/kiln.toml"), "{error}");
    }
}
