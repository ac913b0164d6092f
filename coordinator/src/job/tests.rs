//! Properties of the job machine.

use super::*;
use crate::records::{JobState, Problem};
use kiln_proto::wire::message::Phase;
use proptest::prelude::*;

fn run(job: Job, events: &[Event]) -> (Job, Vec<Action>) {
    events.iter().fold((job, vec![]), |(job, mut all), event| {
        let (job, actions) = apply(&job, event).unwrap();
        all.extend(actions);
        (job, all)
    })
}

fn problem() -> Problem {
    Problem::new("no")
}

#[test]
fn a_job_runs_through_its_phases_to_the_package() {
    let events = [
        Event::SceneReady,
        Event::Prepared { tiles: 3, surfaces: 2 },
        Event::Accepted { phase: Phase::Probe, tiles: 2 },
        Event::Accepted { phase: Phase::Probe, tiles: 1 },
        Event::Merged { phase: Phase::Probe, tiles: 5 },
        Event::Accepted { phase: Phase::Bake, tiles: 5 },
        Event::SurfaceAssembled,
        Event::SurfaceAssembled,
        Event::Published,
    ];
    let (job, actions) = run(Job::Queued, &events);
    assert_eq!(job, Job::Done);
    assert_eq!(
        actions,
        [
            Action::Enqueue(JobTask::Prepare),
            Action::OpenPhase { phase: Phase::Probe, tiles: 3 },
            Action::Enqueue(JobTask::Merge(Phase::Probe)),
            Action::OpenPhase { phase: Phase::Bake, tiles: 5 },
            Action::Enqueue(JobTask::Assemble(0)),
            Action::Enqueue(JobTask::Assemble(1)),
            Action::Enqueue(JobTask::Publish),
            Action::Retire,
            Action::Announce,
        ]
    );
}

#[test]
fn no_tiles_and_tiles_of_another_phase_or_beyond_what_is_left_are_illegal() {
    let baking = Job::Baking { phase: Phase::Bake, left: 2, surfaces: 1 };
    for event in [
        Event::Accepted { phase: Phase::Probe, tiles: 1 },
        Event::Accepted { phase: Phase::Bake, tiles: 3 },
        Event::Accepted { phase: Phase::Bake, tiles: 0 },
    ] {
        assert_eq!(apply(&baking, &event), Err(Illegal { event: "a delivered tile", state: "baking" }));
    }
    assert!(apply(&Job::Assembling { left: 1, surfaces: 1 }, &Event::Published).is_err());
    assert!(apply(&Job::Preparing, &Event::Prepared { tiles: 0, surfaces: 1 }).is_err());
}

#[test]
fn lost_tiles_are_baked_again_and_what_needs_them_is_recalled() {
    let (probe, bake) = (Phase::Probe, Phase::Bake);
    let lost = |phase| Event::Lost { phase, tiles: 2 };
    let again = |phase, left| Ok((Job::Baking { phase, left, surfaces: 3 }, vec![Action::Recall]));
    let assembling = |left| Job::Assembling { left, surfaces: 3 };
    assert_eq!(apply(&Job::Baking { phase: probe, left: 0, surfaces: 3 }, &lost(probe)), again(probe, 2));
    assert_eq!(apply(&Job::Baking { phase: bake, left: 4, surfaces: 3 }, &lost(bake)), again(bake, 6));
    assert_eq!(apply(&assembling(1), &lost(bake)), again(bake, 2));
    // Merged already, assembled already, or nothing at all.
    assert!(apply(&Job::Baking { phase: bake, left: 4, surfaces: 3 }, &lost(probe)).is_err());
    assert!(apply(&assembling(1), &lost(probe)).is_err() && apply(&assembling(0), &lost(bake)).is_err());
    assert!(apply(&assembling(1), &Event::Lost { phase: bake, tiles: 0 }).is_err());
    // Every surface is assembled again.
    let (job, actions) = run(Job::Baking { phase: bake, left: 2, surfaces: 3 }, &[Event::Accepted { phase: bake, tiles: 2 }]);
    assert_eq!((job, actions.len()), (assembling(3), 3));
}

/// Every state and every event: the state that follows, or `-` where the event does not fit.
#[test]
fn every_state_knows_what_every_event_means() {
    const P: Phase = Phase::Probe;
    const B: Phase = Phase::Bake;
    let baking = |phase, left| Job::Baking { phase, left, surfaces: 2 };
    let paused = |phase, left| Job::Paused { phase, left, surfaces: 2 };
    let assembling = |left| Job::Assembling { left, surfaces: 2 };
    let failed = |retry| Job::Failed { problem: problem(), retry };
    let stopped = failed(Some(Retry { phase: B, left: 2, surfaces: 2 }));
    let quarantined = |phase, on_poison| Event::Quarantined { phase, on_poison, problem: problem() };
    let name = |job: &Job| match job {
        Job::Baking { phase, left, .. } => format!("{}{left}", if *phase == P { "p" } else { "b" }),
        Job::Paused { phase, left, .. } => format!("z{}{left}", if *phase == P { "p" } else { "b" }),
        Job::Assembling { left, .. } => format!("a{left}"),
        Job::Failed { retry, .. } => format!("F{}", retry.map_or_else(String::new, |r| r.left.to_string())),
        other => other.name()[..1].to_uppercase(),
    };
    let events = [
        Event::SceneReady,
        Event::Prepared { tiles: 2, surfaces: 2 },
        Event::Accepted { phase: P, tiles: 1 },
        Event::Accepted { phase: B, tiles: 1 },
        Event::Lost { phase: P, tiles: 1 },
        Event::Lost { phase: B, tiles: 1 },
        Event::Merged { phase: P, tiles: 2 },
        Event::SurfaceAssembled,
        Event::Published,
        quarantined(B, OnPoison::Fail),
        quarantined(P, OnPoison::Skip),
        quarantined(B, OnPoison::Skip),
        Event::Pause,
        Event::Resume,
        Event::Retry,
        Event::Fail(problem()),
        Event::Cancel,
    ];
    // Columns as in the list above; D is done, C cancelled, P preparing, z paused, F failed (with the tiles that a retry has to go).
    #[rustfmt::skip]
    let table = [
        (Job::Queued,    "P -  -  -  -   -   -  -  - -  -   -   -   -  -  F C"),
        (Job::Preparing, "- p2 -  -  -   -   -  -  - -  -   -   -   -  -  F C"),
        (baking(P, 2),   "- -  p1 -  p3  -   -  -  - -  p1  -   zp2 p2 -  F C"),
        (baking(P, 0),   "- -  -  -  p1  -   b2 -  - -  -   -   zp0 p0 -  F C"),
        (baking(B, 2),   "- -  -  b1 -   b3  -  -  - F2 -   b1  zb2 b2 -  F C"),
        (baking(B, 1),   "- -  -  a2 -   b2  -  -  - F1 -   a2  zb1 b1 -  F C"),
        (paused(P, 1),   "- -  zp0 - zp2 -   -  -  - -  zp0 -   zp1 p1 -  F C"),
        (paused(P, 0),   "- -  -  -  zp1 -   -  -  - -  -   -   zp0 p0 -  F C"),
        (paused(B, 1),   "- -  - zb0 -   zb2 -  -  - F1 -   zb0 zb1 b1 -  F C"),
        (paused(B, 0),   "- -  -  -  -   zb1 -  -  - -  -   -   zb0 a2 -  F C"),
        (assembling(2),  "- -  -  -  -   b1  -  a1 - -  -   -   -   -  -  F C"),
        (assembling(1),  "- -  -  -  -   b1  -  a0 - -  -   -   -   -  -  F C"),
        (assembling(0),  "- -  -  -  -   -   -  -  D -  -   -   -   -  -  F C"),
        (Job::Done,      "- -  -  -  -   -   -  -  - -  -   -   -   -  -  - -"),
        (failed(None),   "- -  -  -  -   -   -  -  - -  -   -   -   -  -  - -"),
        (stopped,        "- -  -  -  -   F3  -  -  - -  -   -   -   -  b2 - -"),
        (Job::Cancelled, "- -  -  -  -   -   -  -  - -  -   -   -   -  -  - -"),
    ];
    for (job, row) in table {
        let cells: Vec<&str> = row.split_whitespace().collect();
        assert_eq!(cells.len(), events.len(), "{job:?}");
        for (event, cell) in events.iter().zip(cells) {
            let next = apply(&job, event).map_or_else(|_| "-".to_owned(), |(next, _)| name(&next));
            assert_eq!(next, cell, "{} on {}", event.name(), job.name());
        }
    }
}

#[test]
fn what_follows_from_the_last_tile_waits_while_a_job_is_paused() {
    let bake = Phase::Bake;
    let start = Job::Baking { phase: bake, left: 1, surfaces: 2 };
    let (paused, actions) = run(start, &[Event::Pause, Event::Accepted { phase: bake, tiles: 1 }]);
    assert_eq!((&paused, actions), (&Job::Paused { phase: bake, left: 0, surfaces: 2 }, vec![]));
    let (job, actions) = run(paused, &[Event::Resume]);
    assert_eq!((job.public(), actions.len()), (JobState::Assembling, 2));
    // A barrier that was under way is called off by the pause, and called again.
    let (job, actions) = run(Job::Baking { phase: Phase::Probe, left: 0, surfaces: 2 }, &[Event::Pause, Event::Resume, Event::Resume]);
    assert_eq!(actions, [Action::Recall, Action::Enqueue(JobTask::Merge(Phase::Probe))]);
    assert_eq!(job, Job::Baking { phase: Phase::Probe, left: 0, surfaces: 2 });
}

#[test]
fn a_quarantined_tile_fails_the_job_until_a_retry_or_leaves_a_hole() {
    let bake = Phase::Bake;
    let baking = Job::Baking { phase: bake, left: 2, surfaces: 1 };
    let quarantined = |on_poison| Event::Quarantined { phase: bake, on_poison, problem: problem() };
    let (failed, actions) = run(baking.clone(), &[quarantined(OnPoison::Fail)]);
    assert_eq!((failed.public(), actions), (JobState::Failed, vec![Action::Suspend, Action::Announce]));
    assert_eq!(run(failed.clone(), &[Event::Retry]), (baking.clone(), vec![Action::Reopen { phase: bake }]));
    let text = serde_json::to_string(&failed).unwrap();
    assert_eq!(serde_json::from_str::<Job>(&text).unwrap(), failed);
    let (job, actions) = run(baking, &[quarantined(OnPoison::Skip), quarantined(OnPoison::Skip)]);
    assert_eq!((job, actions), (Job::Assembling { left: 1, surfaces: 1 }, vec![Action::Enqueue(JobTask::Assemble(0))]));
}

/// What a store wrote before jobs could be tried again.
#[test]
fn a_failure_without_a_retry_is_written_as_ever() {
    let failed = Job::Failed { problem: problem(), retry: None };
    let text = r#"{"failed":{"problem":{"message":"no"}}}"#;
    assert_eq!((serde_json::to_string(&failed).unwrap().as_str(), serde_json::from_str::<Job>(text).unwrap()), (text, failed));
}

#[test]
fn every_end_is_announced_and_nothing_else() {
    let bake = Phase::Bake;
    let baking = Job::Baking { phase: bake, left: 2, surfaces: 1 };
    let lost = Event::Quarantined { phase: bake, on_poison: OnPoison::Fail, problem: problem() };
    let states = [Job::Queued, baking, Job::Paused { phase: bake, left: 1, surfaces: 1 }, Job::Assembling { left: 0, surfaces: 1 }];
    for job in states {
        for event in [Event::Published, lost.clone(), Event::Fail(problem()), Event::Cancel, Event::Pause, Event::SceneReady] {
            let Ok((next, actions)) = apply(&job, &event) else { continue };
            assert_eq!(actions.contains(&Action::Announce), next.is_final(), "{} on {}", event.name(), job.name());
        }
    }
    // A failed job that is tried again ends again.
    let stopped = Job::Failed { problem: problem(), retry: Some(Retry { phase: bake, left: 2, surfaces: 1 }) };
    let (_, actions) = run(stopped, &[Event::Lost { phase: bake, tiles: 1 }, Event::Retry, Event::Cancel]);
    assert_eq!(actions, [Action::Reopen { phase: bake }, Action::Withdraw, Action::Retire, Action::Announce]);
}

fn event() -> impl Strategy<Value = Event> {
    let phase = prop_oneof![Just(Phase::Probe), Just(Phase::Bake)];
    prop_oneof![
        Just(Event::SceneReady),
        (0u64..4, 1u32..3).prop_map(|(tiles, surfaces)| Event::Prepared { tiles, surfaces }),
        (phase.clone(), 0u64..4).prop_map(|(phase, tiles)| Event::Accepted { phase, tiles }),
        (phase, 0u64..4).prop_map(|(phase, tiles)| Event::Lost { phase, tiles }),
        (0u64..4).prop_map(|tiles| Event::Merged { phase: Phase::Probe, tiles }),
        Just(Event::SurfaceAssembled),
        Just(Event::Published),
        any::<bool>().prop_map(|skip| {
            let on_poison = if skip { OnPoison::Skip } else { OnPoison::Fail };
            Event::Quarantined { phase: Phase::Bake, on_poison, problem: problem() }
        }),
        Just(Event::Pause),
        Just(Event::Resume),
        Just(Event::Retry),
        Just(Event::Fail(problem())),
        Just(Event::Cancel),
    ]
}

proptest! {
    /// In whatever order events come: final states stay, failing and cancelling is always possible before, states only move forward
    /// unless tiles are lost or the job is tried again, a phase that was merged never comes back, and no task is called for twice without
    /// being recalled.
    #[test]
    fn no_schedule_breaks_the_machine(events in prop::collection::vec(event(), 0..60)) {
        let rank = |job: &Job| match job {
            Job::Queued => 0,
            Job::Preparing => 1,
            Job::Baking { phase: Phase::Probe, .. } | Job::Paused { phase: Phase::Probe, .. } => 2,
            Job::Baking { phase: Phase::Bake, .. } | Job::Paused { phase: Phase::Bake, .. } => 3,
            Job::Assembling { .. } => 4,
            Job::Done | Job::Failed { .. } | Job::Cancelled => 5,
        };
        let (mut job, mut tasks) = (Job::Queued, vec![]);
        for event in events {
            match apply(&job, &event) {
                Ok((next, actions)) => {
                    let may_follow_the_end = matches!(event, Event::Retry | Event::Lost { .. });
                    prop_assert!(!job.is_final() || may_follow_the_end);
                    prop_assert!(rank(&next) <= 5);
                    match event {
                        Event::Lost { .. } if job.is_final() => prop_assert!(next.public() == job.public()),
                        Event::Lost { phase, .. } => prop_assert!(next.phase() == Some(phase) && (rank(&job) < 4 || rank(&next) == 3)),
                        Event::Retry => prop_assert!(rank(&next) == 3 && !next.is_final()),
                        _ => prop_assert!(rank(&next) >= rank(&job)),
                    }
                    for action in actions {
                        match action {
                            Action::Recall | Action::Suspend => tasks.clear(),
                            Action::Enqueue(task) => {
                                prop_assert!(!tasks.contains(&task), "{:?} twice", task);
                                tasks.push(task);
                            }
                            _ => {}
                        }
                    }
                    job = next;
                }
                Err(_) => prop_assert!(job.is_final() || !matches!(event, Event::Fail(_) | Event::Cancel)),
            }
        }
    }
}
