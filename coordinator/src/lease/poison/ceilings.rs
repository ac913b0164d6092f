//! How many tiles a lease may hold where leases have failed.

use super::super::text::{BadText, number, parse_run, parts, run_text};
use kiln_proto::tile::{TileIndex, TileRun, TileRuns};
use std::{fmt, str::FromStr};

/// Runs of tiles with the largest lease that may be cut from them: sorted, disjoint, neighbours with the same bound joined. Tiles in no run
/// are free of suspicion. As text: `0-7:4,9:1`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Ceilings(Vec<(TileRun, u64)>);

impl Ceilings {
    /// Whether no lease is bounded.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The most tiles that a lease with this tile may hold; `None` where nothing bounds it.
    #[must_use]
    pub fn of(&self, tile: TileIndex) -> Option<u64> {
        self.0.iter().find(|(run, _)| run.start <= tile.0 && tile.0 < run.end).map(|(_, most)| *most)
    }

    /// Where a lease that begins with this tile must end: it stays among tiles of one bound, so that suspects do not take others along.
    #[must_use]
    pub fn end(&self, tile: TileIndex) -> u64 {
        match self.0.iter().find(|(run, _)| tile.0 < run.end) {
            Some((run, most)) if run.start <= tile.0 => run.end.min(tile.0.saturating_add(*most)),
            Some((run, _)) => run.start,
            None => u64::MAX,
        }
    }

    /// Bounds leases of these tiles, but for those that are bounded more tightly.
    pub fn lower(&mut self, tiles: &TileRuns, most: u64) {
        let most = most.max(1);
        let mut all: Vec<(TileRun, u64)> = vec![];
        for (run, bound) in &self.0 {
            let run = TileRuns::from_run(*run);
            all.extend(run.minus(tiles).runs().iter().map(|r| (*r, *bound)));
            all.extend(run.intersection(tiles).runs().iter().map(|r| (*r, most.min(*bound))));
        }
        let bounded: TileRuns = self.0.iter().fold(TileRuns::new(), |set, (run, _)| set.union(&TileRuns::from_run(*run)));
        all.extend(tiles.minus(&bounded).runs().iter().map(|r| (*r, most)));
        self.0 = joined(all);
    }

    /// Lifts the bound of tiles that are done, or get a fresh start.
    pub fn lift(&mut self, tiles: &TileRuns) {
        if self.0.is_empty() {
            return;
        }
        let cut = |(run, most): &(TileRun, u64)| {
            let (rest, most) = (TileRuns::from_run(*run).minus(tiles), *most);
            rest.runs().iter().map(|r| (*r, most)).collect::<Vec<_>>()
        };
        self.0 = self.0.iter().flat_map(cut).collect();
    }
}

/// Disjoint runs in canonical form.
fn joined(mut all: Vec<(TileRun, u64)>) -> Vec<(TileRun, u64)> {
    all.sort_unstable();
    let mut out: Vec<(TileRun, u64)> = vec![];
    for (run, most) in all {
        match out.last_mut() {
            Some((last, bound)) if last.end == run.start && *bound == most => last.end = run.end,
            _ => out.push((run, most)),
        }
    }
    out
}

impl fmt::Display for Ceilings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, (run, most)) in self.0.iter().enumerate() {
            write!(f, "{}{}:{most}", if n == 0 { "" } else { "," }, run_text(*run))?;
        }
        Ok(())
    }
}

impl FromStr for Ceilings {
    type Err = BadText;

    fn from_str(text: &str) -> Result<Self, BadText> {
        let bad = || BadText::new("runs of tiles with the largest lease of each, like `0-7:4,9:1`", text);
        let one = |part: &str| {
            let (run, most) = part.split_once(':')?;
            Some((parse_run(run)?, number(most).filter(|most| *most > 0)?))
        };
        let all: Option<Vec<(TileRun, u64)>> = parts(text, ',').map(one).collect();
        let all = all.ok_or_else(bad)?;
        let apart = all.windows(2).all(|w| w[0].0.end <= w[1].0.start);
        if apart && joined(all.clone()) == all { Ok(Self(all)) } else { Err(bad()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    #[test]
    fn the_text_never_changes() {
        let mut ceilings = Ceilings::default();
        assert_eq!((ceilings.to_string().as_str(), ceilings.end(TileIndex(5))), ("", u64::MAX));
        ceilings.lower(&TileRuns::all(8), 4);
        ceilings.lower(&TileRuns::from_run(TileRun { start: 9, end: 10 }), 1);
        assert_eq!(ceilings.to_string(), "0-7:4,9:1");
        assert_eq!([2, 6, 8, 9].map(|t| ceilings.end(TileIndex(t))), [6, 8, 9, 10]);
        for bad in ["0-7", "0-7:0", "0-7:04", "0-7:4,5:1", "0-3:2,4-7:2", "4:1,0:1", "0:1,", "x:1", ":1"] {
            assert!(bad.parse::<Ceilings>().is_err(), "{bad}");
        }
    }

    proptest! {
        /// Any history agrees with a plain map and survives its text.
        #[test]
        fn ceilings_agree_with_a_map(ops in prop::collection::vec((0u64..40, 1u64..10, 0u64..6), 0..30)) {
            let (mut ceilings, mut map) = (Ceilings::default(), BTreeMap::<u64, u64>::new());
            for (start, length, most) in ops {
                let tiles = TileRuns::from_run(TileRun { start, end: start + length });
                // 0 stands for a lift.
                if most == 0 { ceilings.lift(&tiles); } else { ceilings.lower(&tiles, most); }
                for tile in start..start + length {
                    if most == 0 { map.remove(&tile); } else { map.entry(tile).and_modify(|m| *m = most.min(*m)).or_insert(most); }
                }
                prop_assert!((0..60).all(|t| ceilings.of(TileIndex(t)) == map.get(&t).copied()));
                for tile in 0..60 {
                    let end = ceilings.end(TileIndex(tile)).min(60);
                    prop_assert!(end > tile && (tile..end).all(|t| map.get(&t) == map.get(&tile)));
                    prop_assert!(map.get(&tile).is_none_or(|most| end - tile <= *most));
                }
            }
            prop_assert_eq!(ceilings.to_string().parse::<Ceilings>().unwrap(), ceilings);
        }
    }
}
