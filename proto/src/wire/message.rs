//! The messages of the worker protocol (farm: worker protocol). Each travels in a [`frame`](super::frame) of its own kind.
//!
//! Every effect carries its fence: a lease's [`Token`] is in the path of each call that concerns it.

use super::frame::{Kind, Message};
use crate::{
    ids::{Digest, JobId, SceneHash, Token, WorkerId},
    tile::{TileIndex, TileRun},
};
use serde::{Deserialize, Serialize};
use std::fmt;

macro_rules! message {
    ($name:ident) => {
        impl Message for $name {
            const KIND: Kind = Kind::$name;
        }
    };
}

/// The ordered phases of a job, each with its own range of tiles and a barrier behind it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// A few thousand fixed texels at low quality: exposure, walks, cost and noise estimates.
    Probe,
    /// Every tile at the quality asked for.
    Bake,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Phase::Probe => "probe",
            Phase::Bake => "bake",
        })
    }
}

/// A worker introduces itself: `POST /v1/worker/hello`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The worker's [`BAKE_VERSION`](crate::BAKE_VERSION).
    pub bake_version: u32,
    /// What a person calls it: host name and process id unless configured.
    pub name: String,
    /// Threads that it traces with.
    pub threads: u32,
    /// CPU features in use, such as `avx2`; for the record, never for results.
    pub features: Vec<String>,
}
message!(Hello);

/// The answer to [`Hello`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Welcome {
    /// The name of this worker from now on.
    pub worker: WorkerId,
    /// Milliseconds between heartbeats of a lease.
    pub heartbeat_ms: u64,
    /// A chunk is closed at this many bytes.
    pub chunk_bytes: u64,
    /// A chunk is closed when its first segment is this old, milliseconds.
    pub chunk_ms: u64,
}
message!(Welcome);

/// Asks for work: `POST /v1/worker/leases`. The coordinator answers when there is work or `wait_ms` has passed (204).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseRequest {
    /// Who asks.
    pub worker: WorkerId,
    /// How long the worker is willing to wait, milliseconds.
    pub wait_ms: u64,
}
message!(LeaseRequest);

/// The right of one worker to bake a run of tiles until a deadline.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeaseGrant {
    /// The fence of this attempt.
    pub token: Token,
    /// Whose tiles.
    pub job: JobId,
    /// Which phase's tiles.
    pub phase: Phase,
    /// Which tiles, in the order they should be baked.
    pub tiles: TileRun,
    /// The scene, from `GET /v1/worker/scenes/{hash}`.
    pub scene: SceneHash,
    /// The plan with the results of earlier phases in it, from `GET /v1/worker/plans/{digest}`.
    pub plan: Digest,
    /// The attempt expires unless a heartbeat comes within this time, milliseconds.
    pub ttl_ms: u64,
}
message!(LeaseGrant);

/// A sign of life: `POST /v1/worker/attempts/{token}/heartbeat`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Heartbeat {
    /// Texels finished in this attempt, for the record.
    pub texels_done: u64,
    /// Rays traced in this attempt, for the record.
    pub rays: u64,
}
message!(Heartbeat);

/// The answer to [`Heartbeat`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum HeartbeatReply {
    /// Go on.
    Continue,
    /// The job is gone or the attempt is no longer held: stop, send nothing more.
    Cancel,
}
message!(HeartbeatReply);

/// What became of each tile of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// The first valid segment of its tile: it is part of the package.
    Accepted,
    /// The tile was done already, with the same bytes.
    Duplicate,
    /// The tile was done already, with other bytes: recorded as a determinism fault.
    Conflict,
}

/// The answer to a chunk: a verdict per tile, in the chunk's order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkVerdict {
    /// Tile and verdict.
    pub tiles: Vec<(TileIndex, Verdict)>,
}
message!(ChunkVerdict);

/// The end of an attempt: `POST …/complete` or `POST …/release`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finish {
    /// Seconds of processor time that the attempt took over all threads.
    pub core_seconds: f64,
    /// Rays traced.
    pub rays: u64,
    /// Largest resident memory of the worker process so far, bytes.
    pub peak_rss_bytes: u64,
    /// Why the worker gives the rest back; `None` where it is only draining.
    pub failure: Option<String>,
}
message!(Finish);

/// Why a call was refused; travels with the HTTP status that fits.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
pub enum Refusal {
    /// 426: another generation of Kiln.
    #[error("protocol {protocol} and bake version {bake_version} are spoken here")]
    Incompatible {
        /// The coordinator's protocol version.
        protocol: u16,
        /// The coordinator's bake version.
        bake_version: u32,
    },
    /// 404: no such worker; say hello again.
    #[error("this worker is not known here; it should say hello again")]
    UnknownWorker,
    /// 410: the token names no attempt that may do this.
    #[error("the attempt is {state}")]
    Gone {
        /// What became of it.
        state: String,
    },
    /// 422: the bytes are not acceptable.
    #[error("{reason}")]
    Invalid {
        /// What is wrong with them.
        reason: String,
    },
    /// 429 or 503: later.
    #[error("busy; try again in {retry_after_ms} ms")]
    Busy {
        /// When to try again, milliseconds.
        retry_after_ms: u64,
    },
}
message!(Refusal);

/// One segment in a chunk.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkEntry {
    /// Its tile.
    pub tile: TileIndex,
    /// Where its zstd-compressed bytes begin in the chunk.
    pub offset: u64,
    /// How many compressed bytes there are.
    pub length: u64,
    /// Length before compression.
    pub plain_length: u64,
    /// Digest of the bytes before compression.
    pub digest: Digest,
}

/// The table at the end of a chunk (`PUT …/chunks/{n}`): compressed segments one after another, this message's frame, and the frame's
/// length as u32. Written last, so that segments stream while later ones are still being baked.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkTrailer {
    /// The segments in order of offset, without gaps.
    pub entries: Vec<ChunkEntry>,
}
message!(ChunkTrailer);

#[cfg(test)]
mod tests {
    use super::super::{decode, encode};
    use super::*;
    use uuid::Uuid;

    fn pinned<M: Message + PartialEq + fmt::Debug>(message: &M, bytes: &[u8]) {
        assert_eq!(encode(message, 1_000).unwrap(), bytes, "{message:?}");
        assert_eq!(&decode::<M>(bytes, 1_000).unwrap(), message);
    }

    /// A field that moves, or changes its type, changes the protocol: then `PROTOCOL_VERSION` goes up and these arrays are written anew.
    #[test]
    fn the_bytes_of_every_message_never_change() {
        let id = Uuid::from_bytes([7; 16]);
        let uuid = |tail: &[u8]| [&[16][..], &[7; 16], tail].concat();
        let (worker, token, job) = (WorkerId(id), Token(id), JobId(id));
        let hello = Hello { bake_version: 1, name: "a".into(), threads: 2, features: vec!["b".into()] };
        pinned(&hello, &[1, 1, b'a', 2, 1, 1, b'b']);
        pinned(&Welcome { worker, heartbeat_ms: 1, chunk_bytes: 2, chunk_ms: 3 }, &uuid(&[1, 2, 3]));
        pinned(&LeaseRequest { worker, wait_ms: 4 }, &uuid(&[4]));
        let tiles = TileRun { start: 5, end: 6 };
        let (scene, plan) = (SceneHash([8; 32]), Digest([9; 32]));
        let grant = LeaseGrant { token, job, phase: Phase::Bake, tiles, scene, plan, ttl_ms: 10 };
        pinned(&grant, &[uuid(&[]), uuid(&[1, 5, 6]), vec![8; 32], vec![9; 32], vec![10]].concat());
        pinned(&Heartbeat { texels_done: 1, rays: 2 }, &[1, 2]);
        pinned(&HeartbeatReply::Continue, &[0]);
        pinned(&HeartbeatReply::Cancel, &[1]);
        let verdicts = [Verdict::Accepted, Verdict::Duplicate, Verdict::Conflict].map(|v| (TileIndex(3), v));
        pinned(&ChunkVerdict { tiles: verdicts.to_vec() }, &[3, 3, 0, 3, 1, 3, 2]);
        let finish = Finish { core_seconds: 1.0, rays: 2, peak_rss_bytes: 3, failure: Some("c".into()) };
        pinned(&finish, &[0, 0, 0, 0, 0, 0, 0xf0, 0x3f, 2, 3, 1, 1, b'c']);
        pinned(&Refusal::Incompatible { protocol: 1, bake_version: 2 }, &[0, 1, 2]);
        pinned(&Refusal::UnknownWorker, &[1]);
        pinned(&Refusal::Gone { state: "d".into() }, &[2, 1, b'd']);
        pinned(&Refusal::Invalid { reason: "e".into() }, &[3, 1, b'e']);
        pinned(&Refusal::Busy { retry_after_ms: 6 }, &[4, 6]);
        let entry = ChunkEntry { tile: TileIndex(1), offset: 2, length: 3, plain_length: 4, digest: Digest([5; 32]) };
        pinned(&ChunkTrailer { entries: vec![entry] }, &[vec![1, 1, 2, 3, 4], vec![5; 32]].concat());
    }
}
