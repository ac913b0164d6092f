//! A job as clients see it: the stored row, plus what is known of the present moment.

use super::{core::Core, space};
use crate::{
    job::Job,
    records::{JobRecord, JobState, Progress},
    store::JobRow,
};

/// The record of a job.
pub(super) fn record(core: &Core, row: JobRow) -> JobRecord {
    let rates = core.meter().rates(row.spec.id, core.now());
    let waiting = waiting(core, &row);
    let baking = matches!(row.state, Job::Baking { .. });
    let (cost, cost_done) = row.cost;
    let fraction = match row.state {
        Job::Queued | Job::Preparing => 0.0,
        Job::Assembling { .. } | Job::Done => 1.0,
        _ if cost == 0 => 0.0,
        _ => (cost_done as f64 / cost as f64).min(1.0),
    };
    let left = cost.saturating_sub(cost_done) as f64;
    let problem = match &row.state {
        Job::Failed { problem, .. } => Some(problem.clone()),
        _ => None,
    };
    let entered = |wanted: JobState| row.marks.iter().find(|(state, ..)| *state == wanted).map(|(.., at)| *at);
    // Whatever was not delivered when the last tile was, nobody will deliver.
    let holes = match row.state {
        Job::Assembling { .. } | Job::Done => row.tiles.0.saturating_sub(row.tiles.1),
        _ => 0,
    };
    JobRecord {
        id: row.spec.id,
        scene: row.scene_hash,
        state: row.state.public(),
        phase: row.state.phase(),
        priority: row.spec.priority,
        progress: Progress {
            tiles: row.tiles.0,
            tiles_done: row.tiles.1,
            texels: row.texels,
            fraction,
            rays: row.rays,
            rays_per_second: if baking { rates.rays } else { 0.0 },
            workers: row.workers,
            eta_seconds: (baking && rates.cost > 0.0).then(|| left / rates.cost),
        },
        problem,
        waiting,
        created_ms: row.created_ms,
        started_ms: entered(JobState::Baking),
        finished_ms: row.marks.last().filter(|(state, ..)| state.is_final()).map(|(.., at)| *at),
        settings: row.spec.settings,
        labels: row.spec.labels,
        on_poison: row.spec.on_poison,
        holes,
        owner: row.spec.owner,
    }
}

/// Why nothing happens, where nothing happens.
fn waiting(core: &Core, row: &JobRow) -> Option<String> {
    match row.state {
        // A task of it waits for storage: nothing else would help.
        _ if row.put_off.is_some() => row.put_off.clone(),
        Job::Queued => Some("its scene is being imported".into()),
        Job::Paused { .. } => Some("it is paused; `kiln resume` lets it go on".into()),
        Job::Failed { retry: Some(_), .. } => Some("tiles of it were given up; mend the cause, and `kiln retry` bakes them again".into()),
        Job::Baking { left: 0, .. } => None,
        Job::Baking { .. } if full(core) => {
            Some(format!("the disk of {} is full; workers are put off until there is room", core.config.data_dir.display()))
        }
        Job::Baking { .. } if row.workers == 0 => Some(match core.present_workers() {
            0 => "no worker is connected; start one with `kiln work --join URL`".into(),
            1 => "one worker is connected, it has not taken a tile of it yet".into(),
            n => format!("{n} workers are connected, none has taken a tile of it yet"),
        }),
        _ => None,
    }
}

fn full(core: &Core) -> bool {
    space::free(&core.config.data_dir).is_ok_and(|free| free < core.config.reserve_bytes)
}
