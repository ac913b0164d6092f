//! What a job is at any moment, with the data that this moment needs and no other.

use crate::records::{JobState, Problem};
use kiln_proto::wire::message::Phase;
use serde::{Deserialize, Serialize};

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
    },
    /// Someone cancelled it.
    Cancelled,
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
            Job::Assembling { .. } => JobState::Assembling,
            Job::Done => JobState::Done,
            Job::Failed { .. } => JobState::Failed,
            Job::Cancelled => JobState::Cancelled,
        }
    }

    /// The phase whose tiles are leased.
    #[must_use]
    pub fn phase(&self) -> Option<Phase> {
        match self {
            Job::Baking { phase, .. } => Some(*phase),
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
            Job::Assembling { .. } => "assembling",
            Job::Done => "done",
            Job::Failed { .. } => "failed",
            Job::Cancelled => "cancelled",
        }
    }

    /// Whether nothing will change any more.
    #[must_use]
    pub fn is_final(&self) -> bool {
        self.public().is_final()
    }
}
