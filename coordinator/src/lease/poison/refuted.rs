//! Whose failures were its own: tiles that a worker failed and another managed.

use super::super::text::{BadText, number, parts};
use kiln_proto::{ids::JobId, tile::TileIndex, wire::message::Phase};
use std::{collections::BTreeSet, fmt, str::FromStr};

/// Different tiles that a worker may fail and others manage before it is barred.
pub const BAR_AFTER: usize = 3;

/// The failures of one worker that others have refuted. As text: `JOB/bake/17,JOB/probe/3`.
///
/// It never grows beyond [`BAR_AFTER`] entries, because a barred worker gets no leases.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Refuted(BTreeSet<(JobId, Phase, TileIndex)>);

impl Refuted {
    /// Another worker managed a tile that this one had failed.
    pub fn note(&mut self, job: JobId, phase: Phase, tile: TileIndex) {
        if !self.bars() {
            self.0.insert((job, phase, tile));
        }
    }

    /// Whether the worker is to be barred.
    #[must_use]
    pub fn bars(&self) -> bool {
        self.0.len() >= BAR_AFTER
    }
}

impl fmt::Display for Refuted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, (job, phase, tile)) in self.0.iter().enumerate() {
            write!(f, "{}{job}/{phase}/{tile}", if n == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl FromStr for Refuted {
    type Err = BadText;

    fn from_str(text: &str) -> Result<Self, BadText> {
        let bad = || BadText::new("tiles that others managed, like `JOB/bake/17`", text);
        let one = |part: &str| {
            let (job, rest) = part.split_once('/')?;
            let (phase, tile) = rest.split_once('/')?;
            let phase = [Phase::Probe, Phase::Bake].into_iter().find(|p| p.to_string() == phase)?;
            Some((job.parse().ok()?, phase, TileIndex(number(tile)?)))
        };
        let all: Option<BTreeSet<_>> = parts(text, ',').map(one).collect();
        let refuted = Self(all.ok_or_else(bad)?);
        if refuted.to_string() == text { Ok(refuted) } else { Err(bad()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use uuid::Uuid;

    fn job(n: u128) -> JobId {
        JobId(Uuid::from_u128(n))
    }

    #[test]
    fn three_different_tiles_bar_a_worker() {
        let mut refuted = Refuted::default();
        for _ in 0..5 {
            refuted.note(job(1), Phase::Bake, TileIndex(7));
            refuted.note(job(2), Phase::Bake, TileIndex(7));
        }
        assert!(!refuted.bars());
        refuted.note(job(1), Phase::Probe, TileIndex(7));
        assert!(refuted.bars());
        assert_eq!(refuted.to_string(), format!("{0}/probe/7,{0}/bake/7,{1}/bake/7", job(1), job(2)));
        for bad in ["x", "/bake/1", &format!("{}/walk/1", job(1)), &format!("{}/bake/x", job(1)), &format!("{}/bake/1,", job(1))] {
            assert!(bad.parse::<Refuted>().is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn refuted_failures_survive_their_text(list in prop::collection::vec((0u128..3, any::<bool>(), 0u64..9), 0..6)) {
            let mut refuted = Refuted::default();
            for (n, probe, tile) in list {
                refuted.note(job(n), if probe { Phase::Probe } else { Phase::Bake }, TileIndex(tile));
            }
            prop_assert_eq!(refuted.to_string().parse::<Refuted>().unwrap(), refuted);
        }
    }
}
