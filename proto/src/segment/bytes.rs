//! A cursor over the bytes of a segment: every read names the field it is for, and none reaches beyond the end.

use super::SegmentError;

pub(super) struct Reader<'a> {
    left: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { left: bytes }
    }

    pub(super) fn take(&mut self, field: &'static str, count: usize) -> Result<&'a [u8], SegmentError> {
        let (taken, left) =
            self.left.split_at_checked(count).ok_or(SegmentError::Truncated { field, needed: count, left: self.left.len() })?;
        self.left = left;
        Ok(taken)
    }

    pub(super) fn array<const N: usize>(&mut self, field: &'static str) -> Result<[u8; N], SegmentError> {
        let (taken, left) =
            self.left.split_first_chunk::<N>().ok_or(SegmentError::Truncated { field, needed: N, left: self.left.len() })?;
        self.left = left;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self, field: &'static str) -> Result<u8, SegmentError> {
        self.array::<1>(field).map(|[b]| b)
    }

    pub(super) fn u16(&mut self, field: &'static str) -> Result<u16, SegmentError> {
        self.array(field).map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self, field: &'static str) -> Result<u32, SegmentError> {
        self.array(field).map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self, field: &'static str) -> Result<u64, SegmentError> {
        self.array(field).map(u64::from_le_bytes)
    }

    /// Everything that is left.
    pub(super) fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.left)
    }

    /// Nothing may be left.
    pub(super) fn finish(self) -> Result<(), SegmentError> {
        if self.left.is_empty() { Ok(()) } else { Err(SegmentError::Trailing { extra: self.left.len() }) }
    }
}
