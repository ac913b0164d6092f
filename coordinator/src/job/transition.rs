//! Which events may happen to a job, and what follows.
//!
//! ```text
//!                         merged: next phase
//!                              ┌──────┐
//!                              │      ▼
//! Queued ─► Preparing ─► Baking{phase, left} ─► Assembling{left} ─► Done
//!   scene      prepared  │  ▲  ▲  last tile of Bake │  last surface, then published
//!                        └──┘  └────────────────────┘
//!                lost: delivered tiles whose bytes are gone are baked again
//!
//!   Baking ◄──pause, resume──► Paused       leases may still deliver; what follows from the last tile waits for the resume
//!   Baking, Paused ──quarantined──► Failed{retry} ──retry──► Baking      or, where holes are allowed, on without the tile
//!
//!   any of these ──fail──► Failed{problem}      any of these ──cancel──► Cancelled
//! ```
//! Pure: events come in, [`Action`]s go out, and the store performs them in the transaction that saves the new state. Time is no input:
//! nothing here happens because time has passed (leases know time, jobs only know what was delivered). The alternative, a job that asks the
//! store whether its tiles are done, needs a transaction per question and cannot be run through random schedules.

use super::state::{Job, JobTask, OnPoison, Retry};
use crate::{lease::rule::Rule, records::Problem};
use kiln_proto::wire::message::Phase;

/// What may happen to a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// Its scene is canonical.
    SceneReady,
    /// The plan is made.
    Prepared {
        /// Tiles of the first phase, Probe.
        tiles: u64,
        /// Surfaces of the scene.
        surfaces: u32,
    },
    /// Tiles of a phase were accepted for the first time.
    Accepted {
        /// The phase.
        phase: Phase,
        /// How many.
        tiles: u64,
    },
    /// Tiles of a phase that had been accepted are lost: the bytes of their segments are gone.
    Lost {
        /// The phase.
        phase: Phase,
        /// How many.
        tiles: u64,
    },
    /// The barrier behind a phase has put its results into the plan.
    Merged {
        /// The phase that ended.
        phase: Phase,
        /// Tiles of the next phase.
        tiles: u64,
    },
    /// One surface's files are written.
    SurfaceAssembled,
    /// The manifest is written: the package is whole.
    Published,
    /// A tile that had not been delivered is quarantined.
    Quarantined {
        /// Its phase.
        phase: Phase,
        /// What becomes of the job.
        on_poison: OnPoison,
        /// Which tile of which surface, and how it failed.
        problem: Problem,
    },
    /// Nothing shall be leased for now.
    Pause,
    /// Leasing may go on.
    Resume,
    /// Quarantined tiles shall be tried again.
    Retry,
    /// It cannot finish.
    Fail(Problem),
    /// Someone cancels it.
    Cancel,
}

/// What follows from a transition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Coordinator work becomes due.
    Enqueue(JobTask),
    /// The tiles 0 .. n of a phase become leasable.
    OpenPhase {
        /// The phase.
        phase: Phase,
        /// n.
        tiles: u64,
    },
    /// Coordinator work that waits or runs is withdrawn; what lacks segments cannot be done, and becomes due again when they are back.
    Recall,
    /// Every attempt is fenced, and what it owed waits again; segments, pending and quarantined tiles stay for a retry.
    Suspend,
    /// Quarantined tiles of a phase wait again, with a fresh start.
    Reopen {
        /// The phase.
        phase: Phase,
    },
    /// Leases, pending tiles and waiting tasks are withdrawn; their holders are told to stop.
    Withdraw,
    /// Segments and leases are no longer needed.
    Retire,
    /// It has ended: whoever asked to be told is told.
    Announce,
}

/// An event that does not fit the state it met.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{event} does not fit a job that is {state}")]
pub struct Illegal {
    /// The event.
    pub event: &'static str,
    /// The state.
    pub state: &'static str,
}

impl Event {
    /// The name of the event for messages.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Event::SceneReady => "a ready scene",
            Event::Prepared { .. } => "a plan",
            Event::Accepted { .. } => "a delivered tile",
            Event::Lost { .. } => "a lost tile",
            Event::Merged { .. } => "a merged phase",
            Event::SurfaceAssembled => "an assembled surface",
            Event::Published => "a published package",
            Event::Quarantined { .. } => "a quarantined tile",
            Event::Pause => "pausing",
            Event::Resume => "resuming",
            Event::Retry => "a retry",
            Event::Fail(_) => "a failure",
            Event::Cancel => "cancelling",
        }
    }
}

/// The state after an event, and what follows.
///
/// # Errors
/// [`Illegal`] where the diagram has no such arrow; the state is unchanged then.
pub fn apply(job: &Job, event: &Event) -> Result<(Job, Vec<Action>), Illegal> {
    let illegal = || Illegal { event: event.name(), state: job.name() };
    match (job, event) {
        (Job::Queued, Event::SceneReady) => Ok((Job::Preparing, vec![Action::Enqueue(JobTask::Prepare)])),
        (Job::Preparing, Event::Prepared { tiles, surfaces }) if *tiles > 0 => {
            let phase = Phase::Probe;
            Ok((Job::Baking { phase, left: *tiles, surfaces: *surfaces }, vec![Action::OpenPhase { phase, tiles: *tiles }]))
        }
        (Job::Baking { phase, left, surfaces }, event) => baking(*phase, *left, *surfaces, event).ok_or_else(illegal),
        (Job::Paused { phase, left, surfaces }, event) => paused(*phase, *left, *surfaces, event).ok_or_else(illegal),
        // Once every surface is assembled, nobody needs segments any more.
        (Job::Assembling { left, surfaces }, Event::Lost { phase: Phase::Bake, tiles }) if *left > 0 && *tiles > 0 => {
            Ok((Job::Baking { phase: Phase::Bake, left: *tiles, surfaces: *surfaces }, vec![Action::Recall]))
        }
        (Job::Assembling { left, surfaces }, Event::SurfaceAssembled) if *left > 0 => {
            let left = left - 1;
            let publish = (left == 0).then_some(Action::Enqueue(JobTask::Publish));
            Ok((Job::Assembling { left, surfaces: *surfaces }, publish.into_iter().collect()))
        }
        (Job::Assembling { left: 0, .. }, Event::Published) => Ok((Job::Done, vec![Action::Retire, Action::Announce])),
        (Job::Failed { retry: Some(Retry { phase, left, surfaces }), .. }, Event::Retry) => {
            let baking = Job::Baking { phase: *phase, left: *left, surfaces: *surfaces };
            Ok((baking, vec![Action::Reopen { phase: *phase }]))
        }
        (Job::Failed { problem, retry: Some(retry) }, Event::Lost { phase, tiles }) if retry.phase == *phase && *tiles > 0 => {
            let retry = Some(Retry { left: retry.left + tiles, ..*retry });
            Ok((Job::Failed { problem: problem.clone(), retry }, vec![]))
        }
        (job, event) if !job.is_final() => ended(event).ok_or_else(illegal),
        _ => Err(illegal()),
    }
}

/// What may happen anywhere before the end, and ends it.
fn ended(event: &Event) -> Option<(Job, Vec<Action>)> {
    let actions = vec![Action::Withdraw, Action::Retire, Action::Announce];
    match event {
        Event::Fail(problem) => Some((Job::Failed { problem: problem.clone(), retry: None }, actions)),
        Event::Cancel => Some((Job::Cancelled, actions)),
        _ => None,
    }
}

/// What may happen while tiles of a phase are leased.
fn baking(phase: Phase, left: u64, surfaces: u32, event: &Event) -> Option<(Job, Vec<Action>)> {
    let on = |left| Job::Baking { phase, left, surfaces };
    match event {
        Event::Accepted { phase: of, tiles } if phase == *of && (1..=left).contains(tiles) => {
            Some(delivered(phase, left - tiles, surfaces))
        }
        Event::Lost { phase: of, tiles } if phase == *of && *tiles > 0 => Some((on(left + tiles), vec![Action::Recall])),
        Event::Merged { phase: Phase::Probe, tiles } if phase == Phase::Probe && left == 0 && *tiles > 0 => {
            let phase = Phase::Bake;
            Some((Job::Baking { phase, left: *tiles, surfaces }, vec![Action::OpenPhase { phase, tiles: *tiles }]))
        }
        Event::Quarantined { phase: of, on_poison, problem } if phase == *of && left > 0 => match on_poison {
            OnPoison::Skip => Some(delivered(phase, without_hole(left), surfaces)),
            OnPoison::Fail => Some(suspended(problem, Retry { phase, left, surfaces })),
        },
        // A barrier that is under way is called again by the resume.
        Event::Pause => Some((Job::Paused { phase, left, surfaces }, if left == 0 { vec![Action::Recall] } else { vec![] })),
        Event::Resume => Some((on(left), vec![])),
        event => ended(event),
    }
}

/// What may happen while nothing is leased: deliveries count, and nothing follows from them.
fn paused(phase: Phase, left: u64, surfaces: u32, event: &Event) -> Option<(Job, Vec<Action>)> {
    let still = |left| Some((Job::Paused { phase, left, surfaces }, vec![]));
    match event {
        Event::Accepted { phase: of, tiles } if phase == *of && (1..=left).contains(tiles) && Rule::PausedCounts.holds() => {
            still(left - tiles)
        }
        Event::Lost { phase: of, tiles } if phase == *of && *tiles > 0 => still(left + tiles),
        Event::Quarantined { phase: of, on_poison, problem } if phase == *of && left > 0 => match on_poison {
            OnPoison::Skip => still(without_hole(left)),
            OnPoison::Fail => Some(suspended(problem, Retry { phase, left, surfaces })),
        },
        Event::Pause => still(left),
        Event::Resume => Some(delivered(phase, left, surfaces)),
        event => ended(event),
    }
}

/// Tiles to go when one of them is given up.
fn without_hole(left: u64) -> u64 {
    if Rule::Holes.holds() { left - 1 } else { left }
}

/// A job that failed for a tile and can be tried again.
fn suspended(problem: &Problem, retry: Retry) -> (Job, Vec<Action>) {
    (Job::Failed { problem: problem.clone(), retry: Some(retry) }, vec![Action::Suspend, Action::Announce])
}

/// A phase with `left` tiles to go: the last one of Probe calls its barrier, the last one of Bake calls assembly.
fn delivered(phase: Phase, left: u64, surfaces: u32) -> (Job, Vec<Action>) {
    match (phase, left) {
        (Phase::Probe, 0) => (Job::Baking { phase, left, surfaces }, vec![Action::Enqueue(JobTask::Merge(phase))]),
        (Phase::Bake, 0) => {
            let tasks = (0..surfaces).map(|s| Action::Enqueue(JobTask::Assemble(s))).collect();
            (Job::Assembling { left: surfaces, surfaces }, tasks)
        }
        _ => (Job::Baking { phase, left, surfaces }, vec![]),
    }
}
