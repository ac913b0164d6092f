//! `/v1/jobs/{id}/events`: a job's history and future as server-sent events.
//!
//! The stream is a loop over the store: read a page behind the last sequence number sent, send it, wait for a hint that there is more. A
//! subscriber list in memory would be faster and would lose events on a restart; here any coordinator serves any position, and a slow
//! reader costs one page. The stream ends after the event of a final state; a client that comes back behind it gets 204, which tells
//! browsers to stop asking.

use super::{
    App,
    catalogue::Kind,
    extract::{JobInPath, Query},
    gate::{Caller, Gate},
    problem::{Answer, Failure},
};
use crate::{
    engine::{Engine, EngineError, EventPage},
    records::{EventKind, JobEvent, JobRecord},
};
use axum::{
    extract::State,
    http::{HeaderMap, StatusCode},
    response::{
        IntoResponse, Response,
        sse::{Event, KeepAlive, Sse},
    },
};
use futures_util::stream;
use kiln_proto::{chain, ids::JobId, tile::TileRun, wire::message::Phase};
use serde::{Deserialize, Serialize};
use std::{collections::VecDeque, convert::Infallible, sync::Arc, time::Duration};
use tokio_util::sync::CancellationToken;
use utoipa::{IntoParams, ToSchema};

/// Events read from the store at once.
const PAGE: u32 = 256;
/// Pause after a hint that led to nothing: an engine that is stopping gives nothing but such hints.
const PAUSE: Duration = Duration::from_millis(100);
/// A comment this often keeps proxies from closing a quiet stream.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// Query of the stream.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EventsQuery {
    /// Only events behind this sequence number; the header Last-Event-ID takes precedence.
    #[param(minimum = 0)]
    pub after: Option<u64>,
}

/// Sent first where the events asked for are no longer kept: the job as it is, from which the events that follow continue.
#[derive(Debug, Serialize, ToSchema)]
pub struct Snapshot {
    /// The job.
    pub job: JobRecord,
    /// The phase whose tiles follow.
    #[schema(value_type = Option<String>)]
    pub phase: Option<Phase>,
    /// Its tiles that are done.
    #[schema(value_type = Vec<Object>)]
    pub runs: Vec<TileRun>,
}

/// Follow a job.
///
/// Server-sent events named `state`, `tiles`, `problem` (data: JobEvent) and `snapshot` (data: Snapshot); the id of each is its sequence
/// number. Comments keep the connection alive; the stream ends after a final state.
#[utoipa::path(get, path = "/v1/jobs/{id}/events", operation_id = "followJob", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"), EventsQuery,
        ("last-event-id" = Option<u64>, Header, description = "Sequence number of the last event received")),
    responses(
        (status = 200, description = "The stream", body = JobEvent, content_type = "text/event-stream"),
        (status = 204, description = "The job has ended and nothing came after that event")))]
pub(super) async fn stream(
    State(app): State<App>,
    caller: Caller,
    JobInPath(job): JobInPath,
    Query(query): Query<EventsQuery>,
    headers: HeaderMap,
) -> Answer<Response> {
    let after = position(&headers, query.after)?;
    let record = app.engine.job(job).await?;
    let App { engine, gate, closing, .. } = app;
    let mut follower = Follower { engine, gate, caller, job, after, closing, queue: VecDeque::new(), ended: false };
    let mut first = follower.engine.events(job, after, PAGE).await?;
    if first.dropped && first.events.is_empty() {
        // A position that this stream never had, as after a restored backup: only the beginning is certain.
        follower.after = 0;
        first = follower.engine.events(job, 0, PAGE).await?;
    }
    if record.state.is_final() && first.events.is_empty() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    follower.take(first).await?;
    let events = stream::unfold(follower, |mut follower| async move {
        let event = follower.next().await?;
        Some((Ok::<_, Infallible>(event), follower))
    });
    let stream = Sse::new(events).keep_alive(KeepAlive::new().interval(KEEP_ALIVE).text("keep-alive"));
    Ok(([("x-accel-buffering", "no")], stream).into_response())
}

/// Where to begin.
fn position(headers: &HeaderMap, after: Option<u64>) -> Answer<i64> {
    let Some(value) = headers.get("last-event-id") else {
        return Ok(after.map_or(0, |seq| i64::try_from(seq).unwrap_or(i64::MAX)));
    };
    let seq = value.to_str().ok().and_then(|text| text.parse::<i64>().ok()).filter(|seq| *seq >= 0);
    seq.ok_or_else(|| Failure::new(Kind::InvalidRequest, "Last-Event-ID is not a sequence number of this stream").field("last-event-id"))
}

/// One client's position in one job's history.
struct Follower {
    engine: Arc<Engine>,
    gate: Arc<Gate>,
    caller: Caller,
    job: JobId,
    after: i64,
    closing: CancellationToken,
    queue: VecDeque<Event>,
    ended: bool,
}

impl Follower {
    /// The next event; `None` when the stream is over: final state, deleted job, token that is no longer good, shut-down.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.queue.pop_front() {
                return Some(event);
            }
            if self.ended || self.closing.is_cancelled() {
                return None;
            }
            let closing = self.closing.clone();
            tokio::select! {
                () = self.engine.wait_for_events(self.job, self.after) => {}
                () = closing.cancelled() => return None,
            }
            let refilled = self.refill().await;
            if refilled.is_ok() && self.queue.is_empty() {
                tokio::time::sleep(PAUSE).await;
            }
            if let Err(error) = refilled {
                if !matches!(error, EngineError::NotFound { .. }) {
                    tracing::warn!(job = %self.job, error = chain(&error), "event stream ended early; the client will come back");
                }
                return None;
            }
        }
    }

    async fn refill(&mut self) -> Result<(), EngineError> {
        if !self.gate.still_admits(&self.caller).await? {
            self.ended = true;
            return Ok(());
        }
        let page = self.engine.events(self.job, self.after, PAGE).await?;
        self.take(page).await
    }

    /// Queues a page, behind a snapshot where events before it have been dropped.
    async fn take(&mut self, page: EventPage) -> Result<(), EngineError> {
        if page.dropped {
            let job = self.engine.job(self.job).await?;
            let (phase, runs) = self.engine.done_tiles(self.job).await?;
            let before = page.events.first().map_or(self.after, |event| event.seq - 1);
            self.push("snapshot", before, &Snapshot { job, phase, runs: runs.into() });
        }
        for event in &page.events {
            self.push(name(event), event.seq, event);
            self.after = event.seq;
            self.ended |= ends(event);
        }
        Ok(())
    }

    fn push(&mut self, name: &'static str, seq: i64, data: &impl Serialize) {
        match Event::default().event(name).id(seq.to_string()).json_data(data) {
            Ok(event) => self.queue.push_back(event),
            Err(error) => tracing::error!(job = %self.job, seq, error = chain(&error), "event cannot be written as JSON"),
        }
    }
}

fn name(event: &JobEvent) -> &'static str {
    match event.kind {
        EventKind::State { .. } => "state",
        EventKind::Tiles { .. } => "tiles",
        EventKind::Problem { .. } => "problem",
    }
}

fn ends(event: &JobEvent) -> bool {
    matches!(event.kind, EventKind::State { state, .. } if state.is_final())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_wins_over_the_query() {
        let with = |text: &str| [("last-event-id".parse().unwrap(), text.parse().unwrap())].into_iter().collect::<HeaderMap>();
        assert_eq!(position(&HeaderMap::new(), None).unwrap(), 0);
        assert_eq!(position(&HeaderMap::new(), Some(7)).unwrap(), 7);
        assert_eq!(position(&with("9"), Some(7)).unwrap(), 9);
        assert!(position(&with("-1"), None).is_err() && position(&with("x"), None).is_err());
    }
}
