//! The worker protocol: frames, messages, and the one place that knows bincode.
//!
//! `encode` and `decode` wrap bincode 2.0.1 (standard configuration: little-endian, variable-length integers) with a size limit and exact
//! length: bytes left over are an error. Golden bytes in the tests pin the encoding, so that another crate that writes the same bytes can
//! replace it by a change to this module alone.

pub mod frame;
pub mod message;

use serde::{Serialize, de::DeserializeOwned};

/// Why bytes could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Larger than the limit of its kind.
    #[error("{found} bytes; at most {max} are allowed")]
    TooLarge {
        /// Bytes found.
        found: usize,
        /// Bytes allowed.
        max: usize,
    },
    /// The value ended before the bytes did.
    #[error("{extra} bytes are left over after the value")]
    Trailing {
        /// How many.
        extra: usize,
    },
    /// The bytes are not such a value.
    #[error("the bytes are not what they should be")]
    Read(#[from] bincode::error::DecodeError),
    /// The value cannot be written.
    #[error("the value cannot be encoded")]
    Write(#[from] bincode::error::EncodeError),
}

/// Serialises `value`.
///
/// # Errors
/// Results above `max` bytes.
pub fn encode<T: Serialize>(value: &T, max: usize) -> Result<Vec<u8>, DecodeError> {
    let bytes = bincode::serde::encode_to_vec(value, bincode::config::standard())?;
    if bytes.len() > max { Err(DecodeError::TooLarge { found: bytes.len(), max }) } else { Ok(bytes) }
}

/// Reads one value that fills `bytes` exactly. What lengths inside the input may claim is bounded in proportion to the input (at most 32
/// bytes of memory for each of its bytes, as every byte of a valid encoding stands for at most 16), so that a few bytes cannot ask for the
/// moon.
///
/// # Errors
/// Input above `max` bytes, bytes that are not such a value, bytes left over.
pub fn decode<T: DeserializeOwned>(bytes: &[u8], max: usize) -> Result<T, DecodeError> {
    if bytes.len() > max {
        return Err(DecodeError::TooLarge { found: bytes.len(), max });
    }
    let (value, used) = decode_bounded(bytes)?;
    if used == bytes.len() { Ok(value) } else { Err(DecodeError::Trailing { extra: bytes.len() - used }) }
}

/// bincode takes its limit as a constant; this picks the power of two that fits the input.
fn decode_bounded<T: DeserializeOwned>(bytes: &[u8]) -> Result<(T, usize), bincode::error::DecodeError> {
    macro_rules! pick {
        ($bits:expr; $($tier:literal)*) => {
            match $bits {
                $(0..=$tier => bincode::serde::decode_from_slice(bytes, bincode::config::standard().with_limit::<{ 1 << $tier }>()),)*
                _ => Err(bincode::error::DecodeError::LimitExceeded),
            }
        };
    }
    let claim = (bytes.len() * 16).max(256);
    pick!(usize::BITS - (claim - 1).leading_zeros(); 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_encoding_never_changes() {
        let value = (7u8, 300u32, -1i64, Some("ab".to_owned()), vec![1.0f32]);
        let bytes = encode(&value, 100).unwrap();
        assert_eq!(bytes, [7, 0xfb, 0x2c, 0x01, 1, 1, 2, b'a', b'b', 1, 0, 0, 0x80, 0x3f]);
        assert_eq!(decode::<(u8, u32, i64, Option<String>, Vec<f32>)>(&bytes, 100).unwrap(), value);
    }

    #[test]
    fn every_valid_value_is_within_the_bound() {
        // One byte each on the wire, eight in memory: the most that a bincode byte stands for.
        let dense = vec![1u64; 10_000];
        assert_eq!(decode::<Vec<u64>>(&encode(&dense, 1 << 20).unwrap(), 1 << 20).unwrap(), dense);
        let nested = vec![vec![Some(1u64); 3]; 1_000];
        assert_eq!(decode::<Vec<Vec<Option<u64>>>>(&encode(&nested, 1 << 20).unwrap(), 1 << 20).unwrap(), nested);
    }

    #[test]
    fn limits_truncation_and_trailing_bytes_are_errors() {
        let bytes = encode(&vec![1u64; 10], 1_000).unwrap();
        assert!(matches!(decode::<Vec<u64>>(&bytes, 4), Err(DecodeError::TooLarge { .. })));
        assert!(decode::<Vec<u64>>(&bytes[..5], 1_000).is_err());
        assert!(matches!(decode::<Vec<u64>>(&[&bytes[..], &[0]].concat(), 1_000), Err(DecodeError::Trailing { extra: 1 })));
        // Lengths that claim the moon allocate nothing of the kind, whatever they are lengths of.
        for claim in [1u64 << 40, 1 << 62] {
            let bytes = encode(&claim, 100).unwrap();
            assert!(decode::<String>(&bytes, 100).is_err());
            assert!(decode::<Vec<String>>(&[&[1], &bytes[..]].concat(), 100).is_err());
            assert!(decode::<Option<String>>(&[&[1], &bytes[..]].concat(), 100).is_err());
            assert!(decode::<Vec<u64>>(&bytes, 100).is_err());
        }
        assert!(decode::<Vec<u64>>(&[0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x0f], 1_000).is_err());
    }
}
