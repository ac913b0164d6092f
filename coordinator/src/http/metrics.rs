//! `/metrics`: Prometheus text.
//!
//! Each server has its own registry, entered for the length of one synchronous closure, instead of the crate's process-wide recorder:
//! servers in one process (tests, `kiln bake` beside another) do not count each other's requests. The engine's figures are read from the
//! store when someone asks, so that every coordinator of a farm tells the same.

use super::{App, problem::Answer};
use crate::{engine::Statistics, records::WorkerRecord};
use ::metrics::{Unit, counter, describe_counter, describe_gauge, describe_histogram, gauge, histogram, with_local_recorder};
use axum::{
    extract::State,
    http::{HeaderName, Method, StatusCode, header},
};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle, PrometheusRecorder};
use std::time::Duration;

/// Upper bounds of the latency histogram, seconds: from a heartbeat to a long poll.
const SECONDS: &[f64] = &[0.001, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0];

/// The registry of one server.
pub(super) struct Metrics {
    recorder: PrometheusRecorder,
    handle: PrometheusHandle,
}

impl Default for Metrics {
    fn default() -> Self {
        let latency = Matcher::Full("kiln_http_request_seconds".into());
        // The builder refuses only an empty list of bounds; without ours it would fall back to quantiles.
        let builder = PrometheusBuilder::new().set_buckets_for_metric(latency, SECONDS);
        let recorder = builder.unwrap_or_else(|_| PrometheusBuilder::new()).build_recorder();
        let handle = recorder.handle();
        with_local_recorder(&recorder, describe);
        Self { recorder, handle }
    }
}

fn describe() {
    describe_gauge!("kiln_tiles_pending", "Tiles that wait for a worker, over all baking jobs.");
    describe_gauge!("kiln_tiles_leased", "Tiles in leases.");
    describe_gauge!("kiln_attempts_held", "Lease attempts held by workers.");
    describe_gauge!("kiln_jobs", "Jobs by state.");
    describe_gauge!("kiln_workers", "Workers heard within a lease's lifetime.");
    describe_gauge!("kiln_tasks", "Coordinator tasks (import, merge, assembly) that wait or run.");
    describe_gauge!("kiln_disk_free_bytes", Unit::Bytes, "Bytes free on the disk of the data folder.");
    describe_counter!("kiln_tiles_done_total", "Segments accepted.");
    describe_counter!("kiln_tiles_duplicate_total", "Segments that were there already, with the same bytes.");
    describe_counter!("kiln_tiles_conflicting_total", "Segments that differed from the accepted one: determinism faults.");
    describe_counter!("kiln_rays_total", "Rays traced, by the word of the workers on record.");
    describe_counter!("kiln_leases_granted_total", "Leases granted.");
    describe_counter!("kiln_attempts_expired_total", "Attempts that ended because their worker fell silent.");
    describe_counter!("kiln_chunks_total", "Chunks of segments by verdict.");
    describe_counter!("kiln_chunk_bytes_total", Unit::Bytes, "Bytes of accepted chunks.");
    describe_counter!("kiln_frames_refused_total", "Frames of the worker protocol that were damaged, oversized or of another kind.");
    describe_counter!("kiln_http_requests_total", "Requests by matched route, method and status.");
    describe_histogram!("kiln_http_request_seconds", Unit::Seconds, "Time to the head of the response, by matched route and method.");
    counter!("kiln_frames_refused_total").absolute(0); // A counter that begins at its first event hides that event from `rate`.
}

impl Metrics {
    /// Counts a request. `route` is the pattern it matched, never the path itself, so that the number of series is bounded.
    pub(super) fn request(&self, route: &str, method: &Method, status: StatusCode, took: Duration) {
        let method = match method.as_str() {
            name @ ("GET" | "HEAD" | "POST" | "PUT" | "PATCH" | "DELETE" | "OPTIONS") => name.to_owned(),
            _ => "other".to_owned(),
        };
        with_local_recorder(&self.recorder, || {
            let status = status.as_str().to_owned();
            counter!("kiln_http_requests_total", "route" => route.to_owned(), "method" => method.clone(), "status" => status).increment(1);
            histogram!("kiln_http_request_seconds", "route" => route.to_owned(), "method" => method).record(took.as_secs_f64());
        });
    }

    /// Counts a frame that was refused.
    pub(super) fn frame_refused(&self) {
        with_local_recorder(&self.recorder, || counter!("kiln_frames_refused_total").increment(1));
    }

    /// Folds recorded samples into buckets. Without it they pile up until somebody scrapes.
    pub(super) fn upkeep(&self) {
        self.handle.run_upkeep();
    }

    /// Everything as Prometheus text, with the engine's figures of this moment.
    #[must_use]
    pub(super) fn text(&self, figures: &Statistics, workers: &[WorkerRecord]) -> String {
        // `absolute` never goes back, so that a worker's record that ages out does not look like a restart.
        let rays = workers.iter().map(|worker| worker.rays).sum();
        with_local_recorder(&self.recorder, || {
            record(figures);
            counter!("kiln_rays_total").absolute(rays);
        });
        self.handle.render()
    }
}

/// Gauges are exact up to 2^53, far above any of these.
#[allow(clippy::cast_precision_loss)]
fn record(figures: &Statistics) {
    for (name, value) in [
        ("kiln_tiles_pending", figures.tiles_pending),
        ("kiln_tiles_leased", figures.tiles_leased),
        ("kiln_attempts_held", figures.attempts_held),
        ("kiln_workers", figures.workers),
        ("kiln_tasks", figures.tasks),
        ("kiln_disk_free_bytes", figures.disk_free_bytes),
    ] {
        gauge!(name).set(value as f64);
    }
    for (state, count) in &figures.jobs {
        gauge!("kiln_jobs", "state" => state.clone()).set(*count as f64);
    }
    for (name, value) in [
        ("kiln_tiles_done_total", figures.tiles_accepted),
        ("kiln_tiles_duplicate_total", figures.tiles_duplicate),
        ("kiln_tiles_conflicting_total", figures.tiles_conflicting),
        ("kiln_leases_granted_total", figures.leases_granted),
        ("kiln_attempts_expired_total", figures.attempts_expired),
        ("kiln_chunk_bytes_total", figures.chunk_bytes),
    ] {
        counter!(name).absolute(value);
    }
    counter!("kiln_chunks_total", "verdict" => "accepted").absolute(figures.chunks_accepted);
    counter!("kiln_chunks_total", "verdict" => "refused").absolute(figures.chunks_refused);
}

/// Figures in Prometheus' text format.
#[utoipa::path(get, path = "/metrics", operation_id = "metrics", tag = "operations", responses((status = 200, description = "Metrics", body = String, content_type = "text/plain")))]
pub(super) async fn render(State(app): State<App>) -> Answer<([(HeaderName, &'static str); 1], String)> {
    let figures = app.engine.statistics().await?;
    let workers = app.engine.workers().await?;
    Ok(([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], app.metrics.text(&figures, &workers)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_has_help_type_and_figures() {
        let metrics = Metrics::default();
        let millis = Duration::from_millis(3);
        metrics.request("/v1/jobs/{id}", &Method::GET, StatusCode::OK, millis);
        metrics.request("/v1/jobs/{id}", &"BREW".parse().unwrap(), StatusCode::NOT_FOUND, millis);
        metrics.frame_refused();
        let jobs = [("baking".to_owned(), 2)].into();
        let text = metrics.text(&Statistics { tiles_pending: 7, tiles_accepted: 5, jobs, ..Statistics::default() }, &[]);
        for line in [
            "# HELP kiln_tiles_pending Tiles that wait",
            "# TYPE kiln_tiles_pending gauge",
            "kiln_tiles_pending 7",
            "# TYPE kiln_tiles_done_total counter",
            "kiln_tiles_done_total 5",
            "kiln_jobs{state=\"baking\"} 2",
            "kiln_frames_refused_total 1",
            "# TYPE kiln_http_request_seconds histogram",
            "kiln_http_request_seconds_bucket{route=\"/v1/jobs/{id}\",method=\"GET\",le=\"0.005\"} 1",
            "kiln_http_requests_total{route=\"/v1/jobs/{id}\",method=\"other\",status=\"404\"} 1",
        ] {
            assert!(text.contains(line), "{line} is missing in\n{text}");
        }
    }

    #[test]
    fn servers_do_not_count_for_each_other() {
        let (one, other) = (Metrics::default(), Metrics::default());
        one.frame_refused();
        assert!(other.text(&Statistics::default(), &[]).contains("kiln_frames_refused_total 0"));
    }
}
