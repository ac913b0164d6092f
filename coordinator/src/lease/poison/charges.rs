//! How often single tiles have failed, and with whom.

use super::super::{
    rule::Rule,
    text::{BadText, number, parts},
};
use kiln_proto::{
    ids::WorkerId,
    tile::{TileIndex, TileRuns},
};
use std::{collections::BTreeMap, fmt, str::FromStr};

/// Charges that quarantine a tile.
pub const CHARGES: u64 = 3;

/// Workers that must have failed a tile before it is blamed, where as many are connected.
const WORKERS: usize = 2;

/// Characters of an error that are kept: a shard is written whole with every change.
const ERROR_CHARS: usize = 300;

/// Failures of single-tile leases: by tile, by worker; and where a tile was quarantined for them, what it failed with last. As text:
/// `17:WORKER*2+WORKER*1!ERROR,18:WORKER*1`, with `%25` and `%2C` for the percent signs and commas of an error.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Charges {
    by: BTreeMap<TileIndex, BTreeMap<WorkerId, u64>>,
    errors: BTreeMap<TileIndex, String>,
}

impl Charges {
    /// Charges a tile with a failure of a worker.
    pub fn charge(&mut self, tile: TileIndex, worker: WorkerId) {
        *self.by.entry(tile).or_default().entry(worker).or_default() += 1;
    }

    /// Notes what a charged tile failed with last, in one line and not without end.
    pub fn explain(&mut self, tile: TileIndex, error: &str) {
        let line = error.chars().take(ERROR_CHARS).map(|c| if c.is_control() { ' ' } else { c });
        if self.by.contains_key(&tile) {
            self.errors.insert(tile, line.collect());
        }
    }

    /// What a tile failed with last, where that was noted.
    #[must_use]
    pub fn error(&self, tile: TileIndex) -> Option<&str> {
        self.errors.get(&tile).map(String::as_str)
    }

    /// The charges of a tile.
    #[must_use]
    pub fn of(&self, tile: TileIndex) -> u64 {
        self.by.get(&tile).map_or(0, |by| by.values().sum())
    }

    /// The workers that failed a tile.
    pub fn workers(&self, tile: TileIndex) -> impl Iterator<Item = WorkerId> + '_ {
        self.by.get(&tile).into_iter().flat_map(|by| by.keys().copied())
    }

    /// Whether a tile is to be quarantined: enough charges by enough of the `connected` workers.
    #[must_use]
    pub fn is_poison(&self, tile: TileIndex, connected: u64) -> bool {
        let enough = self.workers(tile).count() >= WORKERS || connected < WORKERS as u64 || !Rule::TwoWorkers.holds();
        enough && self.of(tile) >= CHARGES
    }

    /// Tiles that a worker should not get now: it has failed them, and no other of the connected workers has tried. Without this the worker
    /// that has just failed a tile is the first to ask again, and burns through its failures while the others are at work.
    #[must_use]
    pub fn avoided(&self, worker: WorkerId, connected: u64) -> TileRuns {
        let alone = |by: &BTreeMap<WorkerId, u64>| by.len() < WORKERS && by.contains_key(&worker);
        self.by.iter().filter(|(_, by)| connected >= WORKERS as u64 && alone(by)).map(|(tile, _)| *tile).collect()
    }

    /// Forgets the charges of a tile that is done, or gets a fresh start.
    pub fn forget(&mut self, tile: TileIndex) {
        self.by.remove(&tile);
        self.errors.remove(&tile);
    }
}

impl fmt::Display for Charges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, (tile, by)) in self.by.iter().enumerate() {
            write!(f, "{}{tile}:", if n == 0 { "" } else { "," })?;
            for (k, (worker, times)) in by.iter().enumerate() {
                write!(f, "{}{worker}*{times}", if k == 0 { "" } else { "+" })?;
            }
            if let Some(error) = self.error(*tile) {
                write!(f, "!{}", error.replace('%', "%25").replace(',', "%2C"))?;
            }
        }
        Ok(())
    }
}

impl FromStr for Charges {
    type Err = BadText;

    fn from_str(text: &str) -> Result<Self, BadText> {
        let bad = || BadText::new("tiles with the workers that failed each, like `17:WORKER*2+WORKER*1`", text);
        let mut charges = Self::default();
        for part in parts(text, ',') {
            let (part, error) = part.split_once('!').map_or((part, None), |(part, error)| (part, Some(error)));
            let (tile, by) = part.split_once(':').ok_or_else(bad)?;
            let tile = TileIndex(number(tile).ok_or_else(bad)?);
            charges.errors.extend(error.map(|error| (tile, error.replace("%2C", ",").replace("%25", "%"))));
            for one in by.split('+') {
                let (worker, times) = one.split_once('*').ok_or_else(bad)?;
                let worker: WorkerId = worker.parse().map_err(|_| bad())?;
                let times = number(times).filter(|n| *n > 0).ok_or_else(bad)?;
                charges.by.entry(tile).or_default().insert(worker, times);
            }
        }
        // Out of order or twice: not something this program wrote.
        if charges.to_string() == text { Ok(charges) } else { Err(bad()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use uuid::Uuid;

    fn worker(n: u128) -> WorkerId {
        WorkerId(Uuid::from_u128(n))
    }

    #[test]
    fn three_charges_on_two_workers_are_poison_and_on_one_where_there_is_no_other() {
        let (tile, mut charges) = (TileIndex(7), Charges::default());
        (0..5).for_each(|_| charges.charge(tile, worker(1)));
        assert!(!charges.is_poison(tile, 2) && charges.is_poison(tile, 1) && charges.is_poison(tile, 0));
        charges.charge(tile, worker(2));
        assert!(charges.is_poison(tile, 2) && charges.is_poison(tile, 100));
        let mut two = Charges::default();
        (1..=2).for_each(|w| two.charge(tile, worker(w)));
        assert!(!two.is_poison(tile, 2) && !two.is_poison(TileIndex(8), 1));
    }

    #[test]
    fn a_worker_waits_with_a_tile_until_another_has_tried_it() {
        let (tile, mut charges) = (TileIndex(7), Charges::default());
        charges.charge(tile, worker(1));
        assert!(charges.avoided(worker(1), 2).contains(tile) && charges.avoided(worker(1), 1).is_empty());
        assert!(charges.avoided(worker(2), 2).is_empty());
        charges.charge(tile, worker(2));
        assert!(charges.avoided(worker(1), 2).is_empty() && charges.avoided(worker(2), 2).is_empty());
    }

    #[test]
    fn the_text_never_changes() {
        let mut charges = Charges::default();
        [(17, 2), (17, 1), (17, 2), (18, 1)].into_iter().for_each(|(t, w)| charges.charge(TileIndex(t), worker(w)));
        let [one, two] = [worker(1), worker(2)];
        assert_eq!(charges.to_string(), format!("17:{one}*1+{two}*2,18:{one}*1"));
        charges.explain(TileIndex(17), "50 %, or 60 %2C!\n(at least)");
        charges.explain(TileIndex(99), "it was never charged");
        assert_eq!(charges.to_string(), format!("17:{one}*1+{two}*2!50 %25%2C or 60 %252C! (at least),18:{one}*1"));
        let bad = [
            "17",
            "17:",
            "17:x*1",
            &format!("17:{one}"),
            &format!("17:{one}*0"),
            &format!("18:{one}*1,17:{one}*1"),
            &format!("17:{one}*1!50 %"),
        ];
        for bad in bad {
            assert!(bad.parse::<Charges>().is_err(), "{bad}");
        }
    }

    #[test]
    fn what_is_kept_of_an_error_is_bounded_and_forgotten_with_its_tile() {
        let mut charges = Charges::default();
        charges.charge(TileIndex(7), worker(1));
        charges.explain(TileIndex(7), &"x".repeat(10_000));
        assert_eq!(charges.error(TileIndex(7)).map(str::len), Some(ERROR_CHARS));
        charges.forget(TileIndex(7));
        assert_eq!(charges, Charges::default());
    }

    proptest! {
        #[test]
        fn charges_survive_their_text(list in prop::collection::vec((0u64..9, 0u128..4, "[%,!:25C+* ]{0,6}"), 0..30)) {
            let mut charges = Charges::default();
            for (t, w, error) in list {
                charges.charge(TileIndex(t), worker(w));
                if t % 2 == 0 {
                    charges.explain(TileIndex(t), &error);
                }
            }
            prop_assert_eq!(charges.to_string().parse::<Charges>().unwrap(), charges);
        }
    }
}
