//! Which tiles are baked twice, and who lied.
//!
//! With `--verify F` a share F of the tiles is baked again by another worker and the bytes are compared. Which tiles follows from a hash of
//! job, phase, tile and a secret of the farm: every coordinator agrees, nothing is stored, and a worker cannot work out where it may lie. A
//! checked tile counts for its job only when two workers agree on it. Where two differ a third decides: whoever disagrees with two others
//! that agree has lied (or computes wrongly, which is the same to a package), is barred, and everything it delivered to the phase is baked
//! again. Where [`OPINIONS`] workers agree in no pair, nobody is to blame: the tile itself is not deterministic.
//!
//! Checks cost their share of the work and no more. Comparing statistics of radiance instead of bytes, the alternative, lets a careful liar
//! through, and bytes do agree between honest workers (see the design of determinism in light transport).

use super::{
    rule::Rule,
    text::{BadText, number, parts},
};
use kiln_proto::{
    ids::{Digest, JobId, WorkerId},
    tile::{TileIndex, TileRuns},
    wire::message::Phase,
};
use std::{collections::BTreeMap, fmt, str::FromStr};

/// Opinions without two alike after which a tile counts as it is.
const OPINIONS: usize = 5;

/// Whether a tile is baked twice where a `share` in [0, 1] of them is. The secret is the same on every coordinator for as long as the job
/// lives, and never told to workers.
#[must_use]
pub fn is_checked(secret: &str, job: JobId, phase: Phase, tile: TileIndex, share: f64) -> bool {
    let Digest(hash) = Digest::of(format!("{secret}/{job}/{phase}/{tile}").as_bytes());
    let [a, b, c, d, ..] = hash;
    f64::from(u32::from_be_bytes([a, b, c, d])) < share * 4_294_967_296.0
}

/// What the bytes of one more worker decide.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing yet: another worker is asked.
    Open,
    /// The segment that was accepted first is right and counts. These workers lied, if any.
    Right(Vec<WorkerId>),
    /// The segment that was accepted first is wrong: its tile goes back. These workers lied, among them the one that delivered it.
    Wrong(Vec<WorkerId>),
    /// No two of many agree: the bytes depend on something that they must not. The first segment counts.
    Unsettled,
}

/// The tiles of a shard that are done and not yet believed. As text: `17:WORKER=DIGEST+WORKER=DIGEST>WORKER!WORKER`, where the worker
/// behind `>` is the one that bakes the tile just now to check it, and those behind `!` could not.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Checks(BTreeMap<TileIndex, Check>);

#[derive(Debug, Clone, PartialEq, Eq)]
struct Check {
    /// The first one is of the accepted segment.
    opinions: Vec<(WorkerId, Digest)>,
    /// Who is asked.
    asked: Option<WorkerId>,
    /// Who was asked and could not say. Nobody is asked twice.
    failed: Vec<WorkerId>,
}

impl Checks {
    /// Tiles that are not yet believed.
    #[must_use]
    pub fn tiles(&self) -> TileRuns {
        self.0.keys().copied().collect()
    }

    /// Tiles of which workers have different bytes.
    #[must_use]
    pub fn disputed(&self) -> TileRuns {
        let differ = |check: &Check| check.opinions.windows(2).any(|pair| pair[0].1 != pair[1].1);
        self.0.iter().filter(|(_, check)| differ(check)).map(|(tile, _)| *tile).collect()
    }

    /// How many of them nobody is asked about.
    #[must_use]
    pub fn unasked(&self) -> u64 {
        self.0.values().filter(|check| check.asked.is_none()).count() as u64
    }

    /// The digest of the accepted segment of a tile that is not yet believed.
    #[must_use]
    pub fn accepted(&self, tile: TileIndex) -> Option<Digest> {
        self.0.get(&tile)?.opinions.first().map(|(_, digest)| *digest)
    }

    /// Whether a tile is not yet believed.
    #[must_use]
    pub fn is_open(&self, tile: TileIndex) -> bool {
        self.0.contains_key(&tile)
    }

    /// A tile that is to be checked was accepted.
    pub fn open(&mut self, tile: TileIndex, worker: WorkerId, digest: Digest) {
        self.0.insert(tile, Check { opinions: vec![(worker, digest)], asked: None, failed: vec![] });
    }

    /// A tile for this worker to check: one that it has not baked.
    pub fn take(&mut self, worker: WorkerId) -> Option<TileIndex> {
        let (tile, check) = self.0.iter_mut().find(|(_, check)| check.asked.is_none() && check.is_open_to(worker))?;
        check.asked = Some(worker);
        Some(*tile)
    }

    /// The one that was asked ended without an answer: another worker is asked.
    pub fn give_back(&mut self, tile: TileIndex) {
        if let Some(check) = self.0.get_mut(&tile) {
            check.asked = None;
        }
    }

    /// The one that was asked could not bake the tile, or fell silent over it: another worker is asked. Without this a worker that is the
    /// only one left to ask would be asked for ever.
    pub fn fail(&mut self, tile: TileIndex, worker: WorkerId) {
        if let Some(check) = self.0.get_mut(&tile) {
            check.asked = None;
            if check.is_open_to(worker) {
                check.failed.push(worker);
            }
        }
    }

    /// Nobody is asked any more: whoever was ended without an answer.
    pub fn give_all_back(&mut self) {
        self.0.values_mut().for_each(|check| check.asked = None);
    }

    /// The bytes of another worker. A late answer is as good as one in time; a second one of the same worker says nothing.
    pub fn hear(&mut self, tile: TileIndex, worker: WorkerId, digest: Digest) -> Verdict {
        let Some(check) = self.0.get_mut(&tile).filter(|check| check.is_open_to(worker)) else { return Verdict::Open };
        check.opinions.push((worker, digest));
        if check.asked == Some(worker) {
            check.asked = None;
        }
        let verdict = check.verdict();
        if verdict != Verdict::Open {
            self.0.remove(&tile);
        }
        verdict
    }

    /// Lets tiles count that none of the connected workers can check, because each has baked them: with one worker there is no second
    /// opinion. Ask only when nothing else of the phase is left to do. While nobody is connected somebody may come. The tiles, none of
    /// which was confirmed.
    pub fn waive(&mut self, connected: &[WorkerId]) -> TileRuns {
        if connected.is_empty() {
            return TileRuns::new();
        }
        let hopeless = |check: &Check| check.asked.is_none() && !connected.iter().any(|worker| check.is_open_to(*worker));
        let waived: TileRuns = self.0.iter().filter(|(_, check)| hopeless(check)).map(|(tile, _)| *tile).collect();
        self.0.retain(|tile, _| !waived.contains(*tile));
        waived
    }

    /// Takes no word of a worker any more. The tiles whose accepted segment is its own: they are not checked, but baked again.
    pub fn distrust(&mut self, worker: WorkerId) -> TileRuns {
        let own = |check: &Check| check.opinions.first().is_some_and(|(by, _)| *by == worker);
        let again: TileRuns = self.0.iter().filter(|(_, check)| own(check)).map(|(tile, _)| *tile).collect();
        self.forget(&again);
        for check in self.0.values_mut() {
            check.opinions.retain(|(by, _)| *by != worker);
        }
        again
    }

    /// Tiles whose accepted segment is lost are checked when there is another.
    pub fn forget(&mut self, tiles: &TileRuns) {
        self.0.retain(|tile, _| !tiles.contains(*tile));
    }
}

impl Check {
    fn is_open_to(&self, worker: WorkerId) -> bool {
        let is_new = !Rule::OtherJudge.holds() || self.opinions.iter().all(|(by, _)| *by != worker);
        is_new && !self.failed.contains(&worker)
    }

    fn verdict(&self) -> Verdict {
        let agree = |digest: &Digest| self.opinions.iter().filter(|(_, d)| d == digest).count() >= 2;
        let Some((_, truth)) = self.opinions.iter().find(|(_, digest)| agree(digest)) else {
            return if self.opinions.len() < OPINIONS { Verdict::Open } else { Verdict::Unsettled };
        };
        let liars = self.opinions.iter().filter(|(_, digest)| digest != truth).map(|(by, _)| *by).collect();
        let is_first = self.opinions.first().is_some_and(|(_, digest)| digest == truth);
        if is_first { Verdict::Right(liars) } else { Verdict::Wrong(liars) }
    }
}

impl fmt::Display for Checks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, (tile, check)) in self.0.iter().enumerate() {
            write!(f, "{}{tile}:", if n == 0 { "" } else { "," })?;
            for (k, (worker, digest)) in check.opinions.iter().enumerate() {
                write!(f, "{}{worker}={digest}", if k == 0 { "" } else { "+" })?;
            }
            check.asked.iter().try_for_each(|worker| write!(f, ">{worker}"))?;
            check.failed.iter().try_for_each(|worker| write!(f, "!{worker}"))?;
        }
        Ok(())
    }
}

impl FromStr for Checks {
    type Err = BadText;

    fn from_str(text: &str) -> Result<Self, BadText> {
        let bad = || BadText::new("tiles with the digests of workers, like `17:WORKER=DIGEST>WORKER`", text);
        let checks: Option<_> = parts(text, ',').map(parse).collect();
        let checks = Self(checks.ok_or_else(bad)?);
        if checks.to_string() == text { Ok(checks) } else { Err(bad()) }
    }
}

fn parse(part: &str) -> Option<(TileIndex, Check)> {
    let (tile, rest) = part.split_once(':')?;
    let mut rest = rest.split('!');
    let (rest, failed) = (rest.next()?, rest.map(|worker| worker.parse().ok()).collect::<Option<Vec<WorkerId>>>()?);
    let (opinions, asked) = rest.split_once('>').map_or((rest, None), |(opinions, asked)| (opinions, Some(asked)));
    let one = |text: &str| {
        let (worker, digest) = text.split_once('=')?;
        Some((worker.parse().ok()?, digest.parse().ok()?))
    };
    let opinions: Option<Vec<(WorkerId, Digest)>> = opinions.split('+').map(one).collect();
    let asked = asked.map(|worker| worker.parse().ok()).map_or(Some(None), |worker| worker.map(Some))?;
    Some((TileIndex(number(tile)?), Check { opinions: opinions?, asked, failed }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use uuid::Uuid;

    fn worker(n: u128) -> WorkerId {
        WorkerId(Uuid::from_u128(n))
    }

    fn bytes(n: u8) -> Digest {
        Digest([n; 32])
    }

    /// What is decided when worker 0 delivered the first of these bytes, worker 1 says the second, and so on.
    fn decided(says: &[u8]) -> Verdict {
        let (tile, mut checks) = (TileIndex(5), Checks::default());
        checks.open(tile, worker(0), bytes(says[0]));
        let mut verdict = Verdict::Open;
        for (n, say) in says.iter().enumerate().skip(1) {
            assert_eq!(verdict, Verdict::Open, "decided already");
            assert_eq!(checks.take(worker(n as u128)), Some(tile));
            verdict = checks.hear(tile, worker(n as u128), bytes(*say));
        }
        assert_eq!(checks.0.is_empty(), verdict != Verdict::Open);
        verdict
    }

    #[test]
    fn whoever_disagrees_with_two_others_that_agree_lied() {
        assert_eq!(decided(&[1]), Verdict::Open);
        assert_eq!(decided(&[1, 1]), Verdict::Right(vec![]));
        assert_eq!(decided(&[1, 2]), Verdict::Open);
        assert_eq!(decided(&[1, 2, 1]), Verdict::Right(vec![worker(1)]));
        assert_eq!(decided(&[2, 1, 1]), Verdict::Wrong(vec![worker(0)]));
        assert_eq!(decided(&[1, 2, 3, 1]), Verdict::Right(vec![worker(1), worker(2)]));
        assert_eq!(decided(&[1, 2, 3, 4]), Verdict::Open);
        assert_eq!(decided(&[1, 2, 3, 4, 5]), Verdict::Unsettled);
    }

    #[test]
    fn nobody_checks_what_it_baked_and_one_at_a_time_checks_a_tile() {
        let (tile, mut checks) = (TileIndex(5), Checks::default());
        checks.open(tile, worker(0), bytes(1));
        assert_eq!(checks.take(worker(0)), None);
        assert_eq!((checks.take(worker(1)), checks.take(worker(2))), (Some(tile), None));
        checks.give_back(tile);
        assert_eq!(checks.take(worker(2)), Some(tile));
        checks.fail(tile, worker(2));
        assert_eq!((checks.take(worker(2)), checks.unasked()), (None, 1), "it has shown that it cannot");
        assert!(checks.clone().waive(&[worker(0), worker(2)]).contains(tile), "nobody is left to ask");
        assert_eq!(checks.hear(tile, worker(0), bytes(1)), Verdict::Open, "its own word is no second one");
        assert_eq!(checks.hear(tile, worker(1), bytes(1)), Verdict::Right(vec![]), "late, and as good");
        assert_eq!(checks.hear(tile, worker(2), bytes(1)), Verdict::Open, "nobody asks any more");
    }

    #[test]
    fn what_no_connected_worker_can_check_counts_as_it_is() {
        let mut checks = Checks::default();
        checks.open(TileIndex(1), worker(0), bytes(1));
        checks.open(TileIndex(2), worker(1), bytes(1));
        assert!(checks.waive(&[worker(0), worker(1)]).is_empty());
        assert_eq!(checks.waive(&[worker(0)]), [TileIndex(1)].into_iter().collect());
        assert_eq!(checks.tiles(), [TileIndex(2)].into_iter().collect());
    }

    #[test]
    fn the_word_of_a_liar_counts_nowhere() {
        let mut checks = Checks::default();
        checks.open(TileIndex(1), worker(0), bytes(1));
        checks.open(TileIndex(2), worker(1), bytes(1));
        assert_eq!(checks.hear(TileIndex(1), worker(1), bytes(9)), Verdict::Open);
        assert_eq!(checks.distrust(worker(1)), [TileIndex(2)].into_iter().collect());
        assert_eq!(checks.hear(TileIndex(1), worker(2), bytes(9)), Verdict::Open, "it does not stand beside the liar");
        assert_eq!(checks.hear(TileIndex(1), worker(3), bytes(1)), Verdict::Right(vec![worker(2)]));
    }

    #[test]
    fn the_share_is_kept_and_the_same_everywhere() {
        let job = JobId(Uuid::from_u128(7));
        let is_checked = |secret, phase, t, share| is_checked(secret, job, phase, TileIndex(t), share);
        let count = |share| (0..20_000).filter(|t| is_checked("a", Phase::Bake, *t, share)).count();
        assert_eq!((count(0.0), count(1.0)), (0, 20_000));
        // Five standard deviations of a binomial.
        assert!((130..=270).contains(&count(0.01)), "{}", count(0.01));
        // Phases and farms are checked apart.
        for (secret, phase) in [("a", Phase::Probe), ("b", Phase::Bake)] {
            let apart = (0..20_000).filter(|t| is_checked("a", Phase::Bake, *t, 0.5) != is_checked(secret, phase, *t, 0.5)).count();
            assert!((9_600..=10_400).contains(&apart), "{apart}");
        }
    }

    #[test]
    fn the_text_never_changes() {
        let mut checks = Checks::default();
        checks.open(TileIndex(17), worker(1), bytes(0xab));
        checks.take(worker(2));
        let (one, two, digest) = (worker(1), worker(2), "ab".repeat(32));
        assert_eq!(checks.to_string(), format!("17:{one}={digest}>{two}"));
        checks.fail(TileIndex(17), two);
        assert_eq!(checks.to_string(), format!("17:{one}={digest}!{two}"));
        for bad in ["17", "17:", &format!("17:{one}={digest}>"), &format!("017:{one}={digest}"), &format!("17:{one}={digest},")] {
            assert!(bad.parse::<Checks>().is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn checks_survive_their_text(list in prop::collection::vec((0u64..6, 0u128..4, 0u8..9, 0u8..4), 0..20)) {
            let mut checks = Checks::default();
            for (tile, by, say, what) in list {
                match what {
                    0 => checks.open(TileIndex(tile), worker(by), bytes(say)),
                    1 => drop(checks.take(worker(by))),
                    2 => checks.fail(TileIndex(tile), worker(by)),
                    _ => drop(checks.hear(TileIndex(tile), worker(by), bytes(say))),
                }
            }
            prop_assert_eq!(checks.to_string().parse::<Checks>().unwrap(), checks);
        }
    }
}
