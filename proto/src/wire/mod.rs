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

/// Reads one value that fills `bytes` exactly. Memory is bounded by the length of the input, whatever lengths it claims inside.
///
/// # Errors
/// Input above `max` bytes, bytes that are not such a value, bytes left over.
pub fn decode<T: DeserializeOwned>(bytes: &[u8], max: usize) -> Result<T, DecodeError> {
    if bytes.len() > max {
        return Err(DecodeError::TooLarge { found: bytes.len(), max });
    }
    let (value, used) = bincode::serde::decode_from_slice(bytes, bincode::config::standard())?;
    if used == bytes.len() { Ok(value) } else { Err(DecodeError::Trailing { extra: bytes.len() - used }) }
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
    fn limits_truncation_and_trailing_bytes_are_errors() {
        let bytes = encode(&vec![1u64; 10], 1_000).unwrap();
        assert!(matches!(decode::<Vec<u64>>(&bytes, 4), Err(DecodeError::TooLarge { .. })));
        assert!(decode::<Vec<u64>>(&bytes[..5], 1_000).is_err());
        assert!(matches!(decode::<Vec<u64>>(&[&bytes[..], &[0]].concat(), 1_000), Err(DecodeError::Trailing { extra: 1 })));
        // A length that claims the moon allocates nothing of the kind.
        assert!(decode::<Vec<u64>>(&[0xfd, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x0f], 1_000).is_err());
    }
}
