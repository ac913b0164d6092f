//! `/v1/jobs/{id}/tiles`: which tiles of the present phase are done.

use super::{
    App,
    catalogue::Kind,
    extract::{JobInPath, Query},
    problem::{Answer, Failure},
};
use axum::{Json, extract::State};
use kiln_proto::{
    tile::{TileRun, TileRuns},
    wire::message::Phase,
};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// Runs that one query may name: far more than a client tracks, far fewer than cost anything.
const QUERY_RUNS: usize = 1_000;

/// Query of the tiles.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct TilesQuery {
    /// Only tiles in these runs, `FIRST-LAST` or `TILE`, with commas between them.
    #[param(example = "0-99,200")]
    pub runs: Option<String>,
}

/// Tiles that are done.
#[derive(Debug, Serialize, ToSchema)]
pub struct DoneTiles {
    /// The phase that they belong to: the present one, or the last where the job has ended.
    #[schema(value_type = Option<String>)]
    pub phase: Option<Phase>,
    /// How many there are in `runs`.
    pub tiles_done: u64,
    /// Which, as sorted runs of `start` to before `end`.
    #[schema(value_type = Vec<Object>)]
    pub runs: Vec<TileRun>,
}

/// Tiles that are done so far.
#[utoipa::path(get, path = "/v1/jobs/{id}/tiles", operation_id = "doneTiles", tag = "jobs",
    params(("id" = String, Path, description = "The job's id"), TilesQuery),
    responses((status = 200, description = "The tiles", body = DoneTiles)))]
pub(super) async fn get(State(app): State<App>, JobInPath(job): JobInPath, Query(query): Query<TilesQuery>) -> Answer<Json<DoneTiles>> {
    let asked = query.runs.as_deref().map(parse).transpose()?;
    let (phase, done) = app.engine.done_tiles(job).await?;
    let done = match asked {
        Some(asked) => done.minus(&done.minus(&asked)),
        None => done,
    };
    Ok(Json(DoneTiles { phase, tiles_done: done.len(), runs: done.into() }))
}

/// Runs of tiles as a query writes them.
///
/// # Errors
/// Anything else, and too many of them.
pub(super) fn parse(text: &str) -> Answer<TileRuns> {
    let wrong = || Failure::new(Kind::InvalidRequest, "runs: expected FIRST-LAST or TILE with commas between, at most 1000").field("runs");
    let mut runs = TileRuns::new();
    for (n, part) in text.split(',').enumerate() {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (Ok(start), Ok(last)) = (first.parse::<u64>(), last.parse::<u64>()) else {
            return Err(wrong());
        };
        let end = last.checked_add(1).filter(|end| start < *end && n < QUERY_RUNS).ok_or_else(wrong)?;
        runs.insert(TileRun { start, end });
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_read_or_refused() {
        let run = |start, end| TileRun { start, end };
        assert_eq!(parse("3-5,9,6-6").unwrap().runs(), [run(3, 7), run(9, 10)]);
        for bad in ["", "a", "5-3", "1-", "-1", "1,,2", "0-18446744073709551615"] {
            assert!(parse(bad).is_err(), "{bad}");
        }
    }
}
