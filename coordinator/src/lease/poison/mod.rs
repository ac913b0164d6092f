//! Which tiles and which workers are to blame when attempts fail.
//!
//! After an expiry or a failure nobody knows which of the tiles left is to blame, or whether it was the machine. So what is left is leased
//! again in halves ([`Ceilings`]), which takes log2 of a lease's length failures to reach single tiles. Only a lease of a single tile is
//! charged ([`Charges`]): its failure can be blamed on that tile or on that worker, and on which of the two, other workers decide. Where
//! they fail as well, [`CHARGES`] in all, the tile is quarantined; where another manages the tile, whoever failed it is refuted
//! ([`Refuted`]), and barred after [`BAR_AFTER`] different tiles.
//!
//! The cost: a tile that kills workers kills log2(lease) + 3 of them before it is set aside. Charging every tile of a failed lease, the
//! alternative, quarantines the neighbours of a bad tile; charging the first one left is wrong as soon as a worker has several threads.

mod ceilings;
mod charges;
mod refuted;

pub use ceilings::Ceilings;
pub use charges::{CHARGES, Charges};
pub use refuted::{BAR_AFTER, Refuted};

use crate::{job::OnPoison, records::Problem};
use kiln_proto::{
    ids::WorkerId,
    tile::{TileIndex, TileRun, TileRuns},
    wire::message::Phase,
};

/// What a job says of a tile that its charges have put into quarantine: where it is, how it failed, and what to do, or what becomes of the
/// job. `place` is its surface and its number among the tiles of that surface, where known.
#[must_use]
pub fn poisoned(charges: &Charges, phase: Phase, tile: TileIndex, place: Option<(&str, u64)>, on_poison: OnPoison) -> Problem {
    let place = place.map_or_else(String::new, |(surface, number)| format!(" (tile {number} of surface `{surface}`)"));
    let next = match on_poison {
        OnPoison::Fail => "mend the cause and retry the job",
        OnPoison::Skip => "the job goes on without it",
    };
    Problem::new(format!("tile {tile} of {phase}{place} {}; {next}", failures(charges, tile)))
}

/// How a tile failed whose charges have put it into quarantine: a predicate without a full stop.
#[must_use]
pub fn failures(charges: &Charges, tile: TileIndex) -> String {
    let (times, workers) = (charges.of(tile), charges.workers(tile).count());
    let workers = if workers == 1 { "the only worker".to_owned() } else { format!("{workers} workers") };
    let error = charges.error(tile).map_or_else(String::new, |error| format!(", the last time with: {error}"));
    format!("failed {times} times on {workers}{error}")
}

/// An attempt that failed, or fell silent, and left tiles behind.
#[derive(Debug, Clone, Copy)]
pub struct Suspicion<'a> {
    /// What was leased to it.
    pub leased: TileRun,
    /// What it still owed.
    pub rest: &'a TileRuns,
    /// Who held it.
    pub worker: WorkerId,
    /// Workers that are connected and could bake the tiles: of the job's bake version, neither barred nor leaving. Where there is one at
    /// most, its word alone is enough.
    pub connected: u64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use uuid::Uuid;

    #[test]
    fn a_poisoned_tile_is_named_with_its_surface_its_error_and_what_to_do() {
        let (tile, mut charges) = (TileIndex(7), Charges::default());
        [1, 2, 1].into_iter().for_each(|n| charges.charge(tile, WorkerId(Uuid::from_u128(n))));
        charges.explain(tile, "out of memory");
        assert_eq!(
            poisoned(&charges, Phase::Bake, tile, Some(("floor", 3)), OnPoison::Fail).message,
            "tile 7 of bake (tile 3 of surface `floor`) failed 3 times on 2 workers, the last time with: out of memory; mend the cause and \
             retry the job"
        );
        assert!(poisoned(&charges, Phase::Bake, tile, None, OnPoison::Skip).message.ends_with("out of memory; the job goes on without it"));
        let mut alone = Charges::default();
        (0..3).for_each(|_| alone.charge(tile, WorkerId(Uuid::from_u128(1))));
        let problem = poisoned(&alone, Phase::Probe, tile, None, OnPoison::Fail);
        assert!(problem.message.starts_with("tile 7 of probe failed 3 times on the only worker;"), "{problem}");
    }
}
