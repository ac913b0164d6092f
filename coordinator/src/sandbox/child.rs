//! The child's side: take the limits, do the work, answer.

use super::orders::{Answer, Orders, Work, receive, send};
use crate::{
    engine::ports::{Kiln, Pipeline},
    records::Problem,
};
use kiln_proto::scene::Scene;
use rustix::process::{Resource, Rlimit, Signal, getrlimit, set_parent_process_death_signal, setrlimit};
use std::io::{self, Read, Write};

/// Seconds between the signal that a limit of processor time sends and the kill.
const LAST_SECONDS: u64 = 2;

/// Reads orders to their end, takes their limits, follows them and answers.
///
/// # Errors
/// Orders that cannot be read, limits that the system refuses, a parent that does not listen. What is wrong with the work itself is part of
/// the answer.
pub fn run(mut orders: impl Read, mut answer: impl Write) -> io::Result<()> {
    let (orders, given): (Orders, Vec<u8>) = receive(&mut orders)?;
    // A parent that is killed does not leave a child behind that works for nobody.
    set_parent_process_death_signal(Some(Signal::KILL))?;
    limit(Resource::As, orders.memory_bytes, 0)?;
    limit(Resource::Cpu, orders.cpu_seconds, LAST_SECONDS)?;
    // What crashes must not leave a file of its memory behind, which is as large as its limit.
    limit(Resource::Core, 0, 0)?;
    let (said, made) = follow(orders.work, &given)?;
    send(&mut answer, &said, &made)
}

fn limit(resource: Resource, most: u64, beyond: u64) -> io::Result<()> {
    // A limit that is there already may be lowered, not raised.
    let bound = |wanted: u64| Some(getrlimit(resource).maximum.map_or(wanted, |there| wanted.min(there)));
    Ok(setrlimit(resource, Rlimit { current: bound(most), maximum: bound(most.saturating_add(beyond)) })?)
}

fn follow(work: Work, given: &[u8]) -> io::Result<(Answer, Vec<u8>)> {
    let too_large = |error: &dyn std::fmt::Display| {
        let message = format!("what was made of the scene is too large: {error}");
        (Answer::Refused(vec![Problem::new(message)]), Vec::new())
    };
    match work {
        Work::Import { files, options, scratch } => match Kiln.import(files, &options, &scratch) {
            Ok(imported) => match imported.scene.to_bytes() {
                Ok(bytes) => {
                    let statistics = Box::new(imported.statistics);
                    Ok((Answer::Imported { statistics, warnings: imported.warnings }, bytes))
                }
                Err(error) => Ok(too_large(&error)),
            },
            Err(problems) => Ok((Answer::Refused(problems), Vec::new())),
        },
        Work::Plan { hash, settings } => {
            let scene = Scene::from_bytes(given).map_err(io::Error::other)?;
            match Kiln.plan(&scene, hash, &settings) {
                Ok((plan, warnings)) => match plan.to_bytes() {
                    Ok(bytes) => Ok((Answer::Planned { warnings }, bytes)),
                    Err(error) => Ok(too_large(&error)),
                },
                Err(problem) => Ok((Answer::Refused(vec![problem]), Vec::new())),
            }
        }
    }
}
