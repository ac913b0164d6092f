//! What workers were told, in order: the trace of a schedule, and the promises that no answer may break.

use kiln_proto::{
    ids::Digest,
    wire::{
        frame::{Message, from_frame},
        message::{ChunkTrailer, ChunkVerdict, HeartbeatReply, LeaseGrant, Phase, Verdict},
    },
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// A tile of a phase.
pub(super) type Tile = (Phase, u64);

/// Everything that was seen.
#[derive(Default)]
pub(super) struct Witness(Mutex<Seen>);

#[derive(Default)]
pub(super) struct Seen {
    /// One line for each thing that happened.
    pub(super) trace: Vec<String>,
    /// The lines of faults alone.
    pub(super) faults: Vec<String>,
    /// What schedules that say anything must come across.
    pub(super) met: BTreeSet<&'static str>,
    /// The digests of tiles that workers know to be accepted, and the chunk that each came in.
    pub(super) accepted: BTreeMap<Tile, (String, Digest)>,
    /// When each host was told last that there is work, or none.
    pub(super) polled: BTreeMap<String, Duration>,
    /// When the job ended, and how.
    pub(super) ended: Option<(Duration, String)>,
    /// The first promise that was broken.
    pub(super) broken: Option<String>,
    /// Chunks to which no answer came.
    unheard: BTreeSet<String>,
    /// Numbers and phases of attempts, by their tokens in paths.
    attempts: BTreeMap<String, (usize, Phase)>,
}

fn now() -> Duration {
    turmoil::sim_elapsed().unwrap_or_default()
}

fn stamped(at: Duration, line: &str) -> String {
    format!("{:>7} {line}", at.as_millis())
}

impl Witness {
    pub(super) fn seen(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Something began or ended to go wrong.
    pub(super) fn fault(&self, at: Duration, line: &str) {
        let mut seen = self.seen();
        let line = stamped(at, line);
        seen.faults.push(line.clone());
        seen.trace.push(line);
    }

    pub(super) fn meet(&self, what: &'static str) {
        self.seen().met.insert(what);
    }

    /// The job has ended.
    pub(super) fn end(&self, state: &str) {
        let mut seen = self.seen();
        seen.note(&format!("the job is {state}"));
        seen.ended = Some((now(), state.to_owned()));
    }

    /// A call to which no answer came.
    pub(super) fn unanswered(&self, host: &str, path: &str) {
        let mut seen = self.seen();
        let line = format!("{host} heard nothing of {}", seen.named(path));
        seen.note(&line);
        seen.unheard.insert(path.to_owned());
        seen.met.insert("a call without an answer");
    }

    /// An answer that arrived.
    pub(super) fn answered(&self, host: &str, path: &str, sent: &[u8], status: u16, body: &[u8]) {
        let mut seen = self.seen();
        if path == "/v1/worker/leases" && matches!(status, 200 | 204) {
            seen.polled.insert(host.to_owned(), now());
            seen.leased(host, from_frame(body).ok());
        } else if path.contains("/chunks/") && status == 200 {
            seen.delivered(host, path, sent, body);
        } else if path.starts_with("/v1/worker/") {
            let line = format!("{host} {} {status}", seen.named(path));
            seen.note(&line);
            if path.ends_with("/heartbeat") && from_frame(body).ok() == Some(HeartbeatReply::Cancel) {
                seen.met.insert("an attempt that ran out");
            }
        }
        // Away for a moment, an unknown worker, and an attempt that is over are all that may go wrong with honest workers.
        if !matches!(status, 200..=204 | 404 | 410 | 503) {
            seen.fail(format!("{host} was answered {status} to {path}: {}", String::from_utf8_lossy(body)));
        }
    }
}

impl Seen {
    fn note(&mut self, line: &str) {
        self.trace.push(stamped(now(), line));
    }

    fn fail(&mut self, promise: String) {
        self.broken.get_or_insert(promise);
    }

    /// A path with tokens, which are random, by their numbers.
    fn named(&self, path: &str) -> String {
        let name = |part: &str| self.attempts.get(part).map_or_else(|| part.to_owned(), |(number, _)| format!("#{number}"));
        let parts: Vec<String> = path.split('/').skip(3).map(|part| if part.len() > 60 { "…".to_owned() } else { name(part) }).collect();
        parts.join("/")
    }

    fn leased(&mut self, host: &str, grant: Option<LeaseGrant>) {
        let Some(grant) = grant else { return };
        let number = self.attempts.len();
        self.attempts.insert(grant.token.to_string(), (number, grant.phase));
        self.note(&format!("{host} leases {:?} {}..{} as #{number}", grant.phase, grant.tiles.start, grant.tiles.end));
    }

    fn delivered(&mut self, host: &str, path: &str, sent: &[u8], body: &[u8]) {
        let (chunk, verdict) = (self.named(path), read::<ChunkVerdict>(body));
        let token = path.split('/').nth(4).unwrap_or_default();
        // A worker that was started anew delivers what it was granted in an earlier life, of which the witness knows as well.
        let Some((_, phase)) = self.attempts.get(token).copied() else { return self.fail(format!("{host} delivers for nothing: {path}")) };
        if self.unheard.contains(path) {
            self.met.insert("a chunk sent twice");
        }
        for (entry, (tile, verdict)) in trailer(sent).entries.iter().zip(&verdict.tiles) {
            assert_eq!(entry.tile, *tile, "a verdict for each segment, in order");
            self.note(&format!("{host} {chunk} {phase:?} {} {verdict:?}", tile.0));
            self.judge(&chunk, (phase, tile.0), entry.digest, *verdict);
        }
    }

    fn judge(&mut self, chunk: &str, tile: Tile, digest: Digest, verdict: Verdict) {
        let before = self.accepted.get(&tile).cloned();
        match (verdict, before) {
            (Verdict::Accepted, None) => {
                self.accepted.insert(tile, (chunk.to_owned(), digest));
            }
            (Verdict::Accepted, Some((other, _))) if other != chunk => {
                self.fail(format!("{tile:?} was accepted twice, in {other} and in {chunk}"));
            }
            (Verdict::Accepted, Some(_)) => {}
            (Verdict::Duplicate, Some((_, known))) if known != digest => self.fail(format!("{tile:?} is known with other bytes")),
            (Verdict::Conflict, Some((_, known))) if known == digest => self.fail(format!("{tile:?} is a conflict with its own bytes")),
            (Verdict::Duplicate, _) => drop(self.met.insert("a tile baked twice")),
            (Verdict::Conflict, _) => drop(self.met.insert("a lie found")),
        }
    }
}

fn read<M: Message>(bytes: &[u8]) -> M {
    from_frame(bytes).expect("a whole frame: the network loses bytes, but changes none")
}

fn trailer(chunk: &[u8]) -> ChunkTrailer {
    let (rest, length) = chunk.split_last_chunk::<4>().expect("a chunk");
    read(&rest[rest.len() - u32::from_le_bytes(*length) as usize..])
}
