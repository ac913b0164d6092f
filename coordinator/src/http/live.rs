//! `/v1/jobs/{id}/scene.kiln` and `/v1/jobs/{id}/segments`: what a page needs to show a job while it bakes.

use super::{
    App,
    admission::{Admission, Leave},
    assets::{REVALIDATE, explain, whole},
    catalogue::Kind,
    conditional::strong_etag,
    extract::{JobInPath, Query},
    problem::{Answer, Failure},
    tiles,
};
use axum::{
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue, header},
    response::{IntoResponse, Response},
};
use serde::Deserialize;
use utoipa::IntoParams;

/// Segments one after another, each behind its tile and length.
pub(super) const SEGMENTS: &str = "application/vnd.kiln.segments";
/// Live views that are answered at the same time.
const ACTIVE: usize = 4;
/// Requests of live views that wait for their turn: pages ask again and again.
const WAITING: usize = 16;
/// Bytes of segments where the client does not say.
const USUAL: usize = 16 << 20;
/// Bytes of segments that a client may ask for at once.
const MOST: usize = 64 << 20;

/// The scene of a job and its plan as it is now, as `scene.kiln` of a package holds them. The plan changes once, when Probe is merged into
/// it.
#[utoipa::path(get, path = "/v1/jobs/{id}/scene.kiln", operation_id = "liveScene", tag = "jobs", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "scene.kiln", content_type = "application/octet-stream", body = Vec<u8>)))]
pub(super) async fn scene(State(app): State<App>, JobInPath(job): JobInPath, headers: HeaderMap) -> Answer<Response> {
    let live = match app.engine.live_scene(job).await {
        Ok(live) => live,
        Err(error) => return Err(explain(&app, job, error).await),
    };
    match whole(&strong_etag(&live.digest().to_string()), REVALIDATE, &headers)? {
        Ok(headers) => {
            let media_type = [(header::CONTENT_TYPE, "application/octet-stream")];
            let leave = app.live.leave().await?;
            Ok((headers, media_type, held(leave, app.engine.live_scene_bytes(&live).await?)).into_response())
        }
        Err(held) => Ok(held),
    }
}

/// Query of the segments.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SegmentsQuery {
    /// Tiles of the Bake phase, `FIRST-LAST` or `TILE`, with commas between them.
    #[param(example = "0-9,12")]
    pub runs: String,
    /// Bytes after which the answer ends, at most 67108864.
    #[param(minimum = 1, maximum = 67_108_864, default = 16_777_216)]
    pub max_bytes: Option<usize>,
}

/// Segments of tiles that are done, in ascending order: of each the tile (u64) and the length (u32), little-endian, then the segment
/// without raw samples. Tiles that are not done are left out. The answer ends before it would pass `max_bytes` or 1024 tiles, but not
/// without a first tile: ask again for the rest. Empty before the Bake phase, and when the job is done and its segments are collected.
#[utoipa::path(get, path = "/v1/jobs/{id}/segments", operation_id = "liveSegments", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"), SegmentsQuery),
    responses((status = 200, description = "The segments", content_type = "application/vnd.kiln.segments", body = Vec<u8>)))]
pub(super) async fn segments(State(app): State<App>, JobInPath(job): JobInPath, Query(query): Query<SegmentsQuery>) -> Answer<Response> {
    let asked = tiles::parse(&query.runs)?;
    let most = query.max_bytes.unwrap_or(USUAL);
    if !(1..=MOST).contains(&most) {
        return Err(Failure::new(Kind::InvalidRequest, format!("max_bytes: {most}; expected 1 to {MOST}")).field("max_bytes"));
    }
    let leave = app.live.leave().await?;
    let body = app.engine.live_segments(job, &asked, most).await?;
    Ok(([(header::CONTENT_TYPE, SEGMENTS)], held(leave, body)).into_response())
}

/// Who may be given what a live view needs: each holds a scene, or some megabytes of segments, until its client has taken them.
pub(super) fn admission() -> Admission {
    Admission::new("live views are answered", ACTIVE, WAITING)
}

/// A body that keeps its leave until it is gone, with its length.
fn held(leave: Leave, bytes: Vec<u8>) -> ([(HeaderName, HeaderValue); 1], Body) {
    ([(header::CONTENT_LENGTH, HeaderValue::from(bytes.len()))], leave.body(bytes))
}
