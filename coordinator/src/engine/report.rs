//! `report.json`: how the bake went. Times and workers, so it is no part of the package's hash.

use super::{EngineError, core::Core};
use crate::{
    records::{JobState, UnixMillis},
    store::{Contribution, JobRow},
};
use kiln_proto::{ids::JobId, wire::message::Phase};
use serde::Serialize;

/// The report's form; later versions only add fields.
#[derive(Debug, Serialize)]
struct Report {
    version: u32,
    job: JobId,
    created_ms: UnixMillis,
    published_ms: UnixMillis,
    /// How long each state lasted, seconds, in order.
    states: Vec<Span>,
    rays: u64,
    /// Tiles that the package does without; its manifest lists them.
    holes: u64,
    /// Processor seconds of all workers, by their word.
    core_seconds: f64,
    /// Largest resident memory of any worker, bytes, by their word.
    worker_peak_rss_bytes: u64,
    /// Largest resident memory of this coordinator so far, bytes; `None` where the system does not tell.
    coordinator_peak_rss_bytes: Option<u64>,
    workers: Vec<Contribution>,
}

#[derive(Debug, Serialize)]
struct Span {
    state: JobState,
    #[serde(skip_serializing_if = "Option::is_none")]
    phase: Option<Phase>,
    seconds: f64,
}

/// The report of a job that is about to be published.
pub(super) async fn report(core: &Core, row: &JobRow, holes: u64) -> Result<Vec<u8>, EngineError> {
    let workers = core.store.contributions(row.spec.id).await?;
    let now = core.now();
    let report = Report {
        version: 1,
        job: row.spec.id,
        created_ms: row.created_ms,
        published_ms: now,
        states: spans(&row.marks, now),
        rays: row.rays,
        holes,
        core_seconds: workers.iter().map(|w| w.core_seconds).sum(),
        worker_peak_rss_bytes: workers.iter().map(|w| w.peak_rss_bytes).max().unwrap_or(0),
        coordinator_peak_rss_bytes: peak_rss(),
        workers,
    };
    serde_json::to_vec_pretty(&report).map_err(|e| EngineError::Broken(format!("the report cannot be written: {e}")))
}

fn spans(marks: &[(JobState, Option<Phase>, UnixMillis)], now: UnixMillis) -> Vec<Span> {
    let ends = marks.iter().skip(1).map(|(.., at)| *at).chain([now]);
    marks
        .iter()
        .zip(ends)
        .map(|((state, phase, at), end)| Span { state: *state, phase: *phase, seconds: (end - at) as f64 / 1e3 })
        .collect()
}

/// `VmHWM` of this process, bytes.
fn peak_rss() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse::<u64>().ok().map(|kib| kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_lasts_until_the_next_and_the_last_until_now() {
        let marks = [(JobState::Queued, None, 1_000), (JobState::Baking, Some(Phase::Probe), 3_500)];
        let seconds: Vec<f64> = spans(&marks, 10_000).iter().map(|s| s.seconds).collect();
        assert_eq!(seconds, [2.5, 6.5]);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_has_a_peak() {
        assert!(peak_rss().unwrap() > 1 << 20);
    }
}
