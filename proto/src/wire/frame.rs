//! A frame: one message of the worker protocol on its way.
//!
//! ```text
//! offset  size
//!      0     4  magic "KLNF"
//!      4     2  protocol version
//!      6     2  kind
//!      8     4  length of the payload, compressed
//!     12     4  length of the payload, decompressed
//!     16     4  CRC32C of the compressed payload
//!     20        payload: zstd of the bincode of the message
//! ```
//! Everything is little-endian. Every field is checked before anything is allocated on its word. Changing this layout is a new
//! [`PROTOCOL_VERSION`], never an edit of this one.

use super::{DecodeError, decode, encode};
use crate::limits;
use serde::{Serialize, de::DeserializeOwned};

/// Version 1: the first.
pub const PROTOCOL_VERSION: u16 = 1;
/// Bytes of a frame before its payload.
pub const HEADER_BYTES: usize = 20;
const MAGIC: [u8; 4] = *b"KLNF";

/// What a frame may carry; each kind is one type of [`message`](super::message).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u16)]
#[allow(missing_docs)] // Named after the messages.
pub enum Kind {
    Hello = 1,
    Welcome = 2,
    LeaseRequest = 3,
    LeaseGrant = 4,
    Heartbeat = 5,
    HeartbeatReply = 6,
    ChunkVerdict = 7,
    Finish = 8,
    Refusal = 9,
    ChunkTrailer = 10,
}

/// A message that knows the kind of its frame.
pub trait Message: Serialize + DeserializeOwned {
    /// The kind.
    const KIND: Kind;
}

/// Why bytes are not the expected frame.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// Shorter than a header, or than the header says, or longer.
    #[error("the frame has {found} bytes; its header promises {expected}")]
    Length {
        /// Bytes found.
        found: usize,
        /// Bytes promised.
        expected: usize,
    },
    /// Not a frame at all.
    #[error("the frame begins with {found:02x?}, not with \"KLNF\"")]
    Magic {
        /// The first four bytes.
        found: [u8; 4],
    },
    /// Written by another version.
    #[error("the frame has protocol version {found}; this program speaks {PROTOCOL_VERSION}")]
    Version {
        /// The version found.
        found: u16,
    },
    /// Another message than expected.
    #[error("the frame has kind {found}; expected {expected:?}")]
    Kind {
        /// The kind found.
        found: u16,
        /// The kind expected.
        expected: Kind,
    },
    /// More than the limit.
    #[error("the frame's payload has {found} bytes; at most {max} are allowed")]
    TooLarge {
        /// Bytes claimed.
        found: usize,
        /// Bytes allowed.
        max: usize,
    },
    /// Damaged on the way.
    #[error("the frame's checksum is {found:08x}; its payload gives {expected:08x}")]
    Checksum {
        /// The checksum in the header.
        found: u32,
        /// The checksum of the payload.
        expected: u32,
    },
    /// The payload does not decompress to the promised length.
    #[error("the frame's payload cannot be decompressed")]
    Decompress(#[source] std::io::Error),
    /// The payload is not the message.
    #[error("the frame's message cannot be read")]
    Message(#[from] DecodeError),
}

/// Bytes that a payload of `packed` bytes may decompress to. Long messages are lists of ids and digests, which hardly compress; a short
/// frame that promises 64 MiB is no message, and refused before they are allocated.
fn most_plain(packed: usize) -> usize {
    packed.saturating_mul(4).saturating_add(1 << 20).min(limits::FRAME_BYTES)
}

/// A message as the bytes of one frame.
///
/// # Errors
/// Messages above [`limits::FRAME_BYTES`], and those above 1 MiB that compress to less than a quarter.
pub fn to_frame<M: Message>(message: &M) -> Result<Vec<u8>, FrameError> {
    let plain = encode(message, limits::FRAME_BYTES)?;
    let payload = zstd::bulk::compress(&plain, 1).map_err(FrameError::Decompress)?;
    let max = most_plain(payload.len());
    if plain.len() > max {
        return Err(FrameError::TooLarge { found: plain.len(), max });
    }
    let mut out = Vec::with_capacity(HEADER_BYTES + payload.len());
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&PROTOCOL_VERSION.to_le_bytes());
    out.extend_from_slice(&(M::KIND as u16).to_le_bytes());
    out.extend_from_slice(&(payload.len() as u32).to_le_bytes());
    out.extend_from_slice(&(plain.len() as u32).to_le_bytes());
    out.extend_from_slice(&crc32c::crc32c(&payload).to_le_bytes());
    out.extend_from_slice(&payload);
    Ok(out)
}

/// The message in the bytes of one frame.
///
/// # Errors
/// Anything but exactly one intact frame of this version and kind.
pub fn from_frame<M: Message>(bytes: &[u8]) -> Result<M, FrameError> {
    let Some((header, payload)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
        return Err(FrameError::Length { found: bytes.len(), expected: HEADER_BYTES });
    };
    let u16_at = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
    let u32_at = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    if header[..4] != MAGIC {
        return Err(FrameError::Magic { found: [header[0], header[1], header[2], header[3]] });
    }
    if u16_at(4) != PROTOCOL_VERSION {
        return Err(FrameError::Version { found: u16_at(4) });
    }
    if u16_at(6) != M::KIND as u16 {
        return Err(FrameError::Kind { found: u16_at(6), expected: M::KIND });
    }
    let (packed, plain) = (u32_at(8) as usize, u32_at(12) as usize);
    if packed > limits::FRAME_BYTES {
        return Err(FrameError::TooLarge { found: packed, max: limits::FRAME_BYTES });
    }
    if payload.len() != packed {
        return Err(FrameError::Length { found: bytes.len(), expected: HEADER_BYTES + packed });
    }
    if plain > most_plain(packed) {
        return Err(FrameError::TooLarge { found: plain, max: most_plain(packed) });
    }
    let expected = crc32c::crc32c(payload);
    if u32_at(16) != expected {
        return Err(FrameError::Checksum { found: u32_at(16), expected });
    }
    let message = zstd::bulk::decompress(payload, plain).map_err(FrameError::Decompress)?;
    if message.len() != plain {
        return Err(FrameError::Length { found: message.len(), expected: plain });
    }
    Ok(decode(&message, limits::FRAME_BYTES)?)
}

#[cfg(test)]
mod tests {
    use super::super::message::{Finish, Heartbeat, HeartbeatReply};
    use super::*;

    fn frame() -> Vec<u8> {
        to_frame(&Heartbeat { texels_done: 300, rays: 5 }).unwrap()
    }

    #[test]
    fn the_bytes_of_version_1_never_change() {
        assert_eq!(&frame()[..16], b"KLNF\x01\0\x05\0\x0d\0\0\0\x04\0\0\0");
    }

    #[test]
    fn a_frame_comes_back_whole() {
        assert_eq!(from_frame::<Heartbeat>(&frame()).unwrap(), Heartbeat { texels_done: 300, rays: 5 });
    }

    #[test]
    fn every_truncation_and_every_flipped_bit_is_refused() {
        let good = frame();
        for n in 0..good.len() {
            assert!(from_frame::<Heartbeat>(&good[..n]).is_err(), "{n} bytes");
        }
        for bit in 0..good.len() * 8 {
            let mut bad = good.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(from_frame::<Heartbeat>(&bad).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn a_short_frame_that_promises_much_is_refused_before_it_is_unpacked() {
        let mut bomb = frame();
        bomb[12..16].copy_from_slice(&(limits::FRAME_BYTES as u32).to_le_bytes());
        assert!(matches!(from_frame::<Heartbeat>(&bomb), Err(FrameError::TooLarge { .. })));
        let long = |bytes: usize| Finish { core_seconds: 1.0, rays: 2, peak_rss_bytes: 3, failure: Some("a".repeat(bytes)) };
        assert!(matches!(to_frame(&long(3 << 20)), Err(FrameError::TooLarge { .. })));
        assert_eq!(from_frame::<Finish>(&to_frame(&long(1 << 19)).unwrap()).unwrap(), long(1 << 19));
    }

    #[test]
    fn another_kind_is_refused_by_name() {
        let error = from_frame::<HeartbeatReply>(&frame()).unwrap_err().to_string();
        assert!(error.contains("kind 5") && error.contains("HeartbeatReply"), "{error}");
    }
}
