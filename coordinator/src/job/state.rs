//! What a job is at any moment, with the data that this moment needs and no other.

use crate::records::{JobState, Problem};
use kiln_proto::wire::message::Phase;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A job.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Job {
    /// Waiting for its scene.
    Queued,
    /// A task lays its surfaces out and cuts them into tiles.
    Preparing,
    /// Tiles of a phase are leased.
    Baking {
        /// The phase.
        phase: Phase,
        /// Tiles of the phase that nobody has delivered. At 0 the barrier's task runs.
        left: u64,
        /// Surfaces, each of which becomes a task of assembly.
        surfaces: u32,
    },
    /// Nothing is leased until someone resumes it. What is leased may still be delivered, and counts.
    Paused {
        /// The phase.
        phase: Phase,
        /// Tiles of the phase that nobody has delivered.
        left: u64,
        /// Surfaces.
        surfaces: u32,
    },
    /// Surfaces are assembled, each by a task; at 0 the package is published.
    Assembling {
        /// Surfaces that are not assembled yet.
        left: u32,
        /// Surfaces of the scene.
        surfaces: u32,
    },
    /// Its package is published.
    Done,
    /// It cannot finish.
    Failed {
        /// Why.
        problem: Problem,
        /// Where a retry goes on: only where quarantined tiles were the reason. Segments and pending tiles are kept for it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        retry: Option<Retry>,
    },
    /// Someone cancelled it.
    Cancelled,
}

/// Where a job that failed goes on when it is tried again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Retry {
    /// The phase.
    pub phase: Phase,
    /// Tiles of the phase that nobody has delivered, those in quarantine among them.
    pub left: u64,
    /// Surfaces.
    pub surfaces: u32,
}

/// What becomes of a job when one of its tiles is quarantined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnPoison {
    /// It fails, and can be tried again.
    #[default]
    Fail,
    /// It ends without the tile: a hole, which the package lists.
    Skip,
}

impl OnPoison {
    /// Its name, as stored and as the API has it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            OnPoison::Fail => "fail",
            OnPoison::Skip => "skip",
        }
    }
}

/// Coordinator work for a job, leased like tiles so that another coordinator can take over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobTask {
    /// Lays surfaces out and cuts tiles.
    Prepare,
    /// Merges the results of a phase into the plan.
    Merge(Phase),
    /// Assembles one surface's files.
    Assemble(u32),
    /// Writes the manifest and publishes the package.
    Publish,
}

impl Job {
    /// The state as clients know it.
    #[must_use]
    pub fn public(&self) -> JobState {
        match self {
            Job::Queued => JobState::Queued,
            Job::Preparing => JobState::Preparing,
            Job::Baking { .. } => JobState::Baking,
            Job::Paused { .. } => JobState::Paused,
            Job::Assembling { .. } => JobState::Assembling,
            Job::Done => JobState::Done,
            Job::Failed { .. } => JobState::Failed,
            Job::Cancelled => JobState::Cancelled,
        }
    }

    /// The phase whose tiles are leased, or may still be delivered.
    #[must_use]
    pub fn phase(&self) -> Option<Phase> {
        match self {
            Job::Baking { phase, .. } | Job::Paused { phase, .. } => Some(*phase),
            _ => None,
        }
    }

    /// The name of the state for messages.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Job::Queued => "queued",
            Job::Preparing => "preparing",
            Job::Baking { .. } => "baking",
            Job::Paused { .. } => "paused",
            Job::Assembling { .. } => "assembling",
            Job::Done => "done",
            Job::Failed { .. } => "failed",
            Job::Cancelled => "cancelled",
        }
    }

    /// Whether nothing will change any more unless someone asks for it: a job that failed may be tried again.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.public().is_final()
    }
}
