//! How values become columns and back. Everything is text or a number that a person can read in the database's own shell.

use super::StoreError;
use crate::{
    job::{Job, OnPoison},
    records::{JobState, SceneState},
};
use kiln_proto::{
    tile::{TileRun, TileRuns},
    wire::message::Phase,
};
use serde::{Serialize, de::DeserializeOwned};
use std::str::FromStr;

/// A column that this program never wrote.
pub(super) fn strange(expected: &'static str, found: impl Into<String>) -> StoreError {
    StoreError::Row { expected, found: found.into().chars().take(200).collect() }
}

/// The databases' integers are signed; nothing that is counted here comes near the bound.
pub(super) fn int(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

pub(super) fn count(value: i64) -> u64 {
    u64::try_from(value).unwrap_or(0)
}

pub(super) fn parse<T: FromStr>(expected: &'static str, text: &str) -> Result<T, StoreError> {
    text.parse().map_err(|_| strange(expected, text))
}

pub(super) fn json<T: Serialize>(value: &T) -> Result<String, StoreError> {
    serde_json::to_string(value).map_err(|e| strange("a value that JSON can hold", e.to_string()))
}

pub(super) fn from_json<T: DeserializeOwned>(expected: &'static str, text: &str) -> Result<T, StoreError> {
    serde_json::from_str(text).map_err(|_| strange(expected, text))
}

pub(super) fn phase(text: &str) -> Result<Phase, StoreError> {
    match text {
        "probe" => Ok(Phase::Probe),
        "bake" => Ok(Phase::Bake),
        other => Err(strange("a phase", other)),
    }
}

/// The name of a job's public state, which is also how the API writes it.
pub(super) fn public(state: JobState) -> &'static str {
    match state {
        JobState::Queued => "queued",
        JobState::Preparing => "preparing",
        JobState::Baking => "baking",
        JobState::Paused => "paused",
        JobState::Assembling => "assembling",
        JobState::Done => "done",
        JobState::Failed => "failed",
        JobState::Cancelled => "cancelled",
    }
}

pub(super) fn job_state(text: &str) -> Result<Job, StoreError> {
    from_json("a job's state", text)
}

pub(super) fn on_poison(text: &str) -> Result<OnPoison, StoreError> {
    from_json("what becomes of a poisoned job", &format!("\"{text}\""))
}

pub(super) fn scene_state(text: &str) -> Result<SceneState, StoreError> {
    from_json("a scene's state", &format!("\"{text}\""))
}

pub(super) fn scene_state_name(state: SceneState) -> &'static str {
    match state {
        SceneState::Uploaded => "uploaded",
        SceneState::Importing => "importing",
        SceneState::Ready => "ready",
        SceneState::Rejected => "rejected",
    }
}

/// Tile sets as text: `0-12,14`, bounds included.
pub(super) fn runs_text(runs: &TileRuns) -> String {
    let one = |r: &TileRun| if r.len() == 1 { r.start.to_string() } else { format!("{}-{}", r.start, r.end - 1) };
    runs.runs().iter().map(one).collect::<Vec<_>>().join(",")
}

/// The inverse of [`runs_text`].
pub(super) fn runs(text: &str) -> Result<TileRuns, StoreError> {
    let bad = || strange("a set of tiles", text);
    let number = |t: &str| t.parse::<u64>().map_err(|_| bad());
    let one = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Ok(TileRun { start: number(first)?, end: number(last)?.checked_add(1).ok_or_else(bad)? })
    };
    let all: Result<Vec<TileRun>, StoreError> = text.split(',').filter(|p| !p.is_empty()).map(one).collect();
    TileRuns::try_from(all?).map_err(|_| bad())
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::tile::TileIndex;
    use proptest::prelude::*;

    #[test]
    fn the_text_of_tile_sets_never_changes() {
        let set: TileRuns = [0, 1, 2, 4, 9, 10].into_iter().map(TileIndex).collect();
        assert_eq!(runs_text(&set), "0-2,4,9-10");
        assert_eq!(runs_text(&TileRuns::new()), "");
        for bad in ["x", "3-", "5-2", "1,1", "4,2", "-1", "0-18446744073709551615"] {
            assert!(runs(bad).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn tile_sets_survive_their_text(set in prop::collection::btree_set(0u64..200, 0..80)) {
            let set: TileRuns = set.into_iter().map(TileIndex).collect();
            prop_assert_eq!(runs(&runs_text(&set)).unwrap(), set);
        }
    }
}
