//! Properties of the job machine.

use super::*;
use crate::records::Problem;
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
    Problem { message: "no".into(), file: None, line: None }
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
        Just(Event::Fail(problem())),
        Just(Event::Cancel),
    ]
}

proptest! {
    /// In whatever order events come: final states stay, failing and cancelling is always possible before, states only move forward
    /// unless tiles are lost, a phase that was merged never comes back, and no task is called for twice without being recalled.
    #[test]
    fn no_schedule_breaks_the_machine(events in prop::collection::vec(event(), 0..60)) {
        let rank = |job: &Job| match job {
            Job::Queued => 0,
            Job::Preparing => 1,
            Job::Baking { phase: Phase::Probe, .. } => 2,
            Job::Baking { phase: Phase::Bake, .. } => 3,
            Job::Assembling { .. } => 4,
            Job::Done | Job::Failed { .. } | Job::Cancelled => 5,
        };
        let (mut job, mut tasks) = (Job::Queued, vec![]);
        for event in events {
            match apply(&job, &event) {
                Ok((next, actions)) => {
                    prop_assert!(!job.is_final());
                    prop_assert!(rank(&next) <= 5);
                    match event {
                        Event::Lost { phase, .. } => prop_assert!(next.phase() == Some(phase) && (rank(&job) < 4 || rank(&next) == 3)),
                        _ => prop_assert!(rank(&next) >= rank(&job)),
                    }
                    for action in actions {
                        match action {
                            Action::Recall => tasks.clear(),
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
