//! Rendered pictures: leave to make them, and the last ones in memory.
//!
//! A picture costs every core for a second, and pages ask for the same few. So two are made at a time, and the last ones are kept. The
//! cache is small, in memory and lost with the process; on disk it would need a place in the store's bookkeeping for what can be made again
//! at any time.

use super::admission::Admission;
use bytes::Bytes;
use std::{
    collections::VecDeque,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// Pictures that are made at the same time.
const MAKING: usize = 2;
/// Pictures that wait to be made.
const WAITING: usize = 6;
/// Bytes of pictures that are kept.
const KEPT: usize = 32 << 20;

/// What is known of pictures.
pub(super) struct Pictures {
    /// Who may make one.
    pub(super) admission: Admission,
    kept: Mutex<Kept>,
}

impl Default for Pictures {
    fn default() -> Self {
        Self { admission: Admission::new("pictures are wanted", MAKING, WAITING), kept: Mutex::new(Kept::new(KEPT)) }
    }
}

impl Pictures {
    /// The picture with this entity tag, where it is kept.
    pub(super) fn find(&self, etag: &str) -> Option<Bytes> {
        self.kept().find(etag)
    }

    /// Keeps a picture for as long as there is room.
    pub(super) fn keep(&self, etag: String, png: Bytes) {
        self.kept().keep(etag, png);
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        // A panic cannot leave it half done: at worst a picture is made again.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Pictures in the order of their last use, the oldest first. A few hundred small ones at most: looking through them costs nothing beside
/// making one.
struct Kept {
    most: usize,
    bytes: usize,
    pictures: VecDeque<(String, Bytes)>,
}

impl Kept {
    fn new(most: usize) -> Self {
        Self { most, bytes: 0, pictures: VecDeque::new() }
    }

    fn find(&mut self, etag: &str) -> Option<Bytes> {
        let at = self.pictures.iter().position(|(tag, _)| tag == etag)?;
        let found = self.pictures.remove(at)?;
        let png = found.1.clone();
        self.pictures.push_back(found);
        Some(png)
    }

    fn keep(&mut self, etag: String, png: Bytes) {
        if png.len() > self.most || self.find(&etag).is_some() {
            return;
        }
        self.bytes += png.len();
        self.pictures.push_back((etag, png));
        while self.bytes > self.most {
            self.bytes -= self.pictures.pop_front().map_or(self.bytes, |(_, png)| png.len());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_last_is_kept_within_the_bound() {
        let mut kept = Kept::new(10);
        let png = |n: usize| Bytes::from(vec![0; n]);
        for (tag, n) in [("a", 4), ("b", 4), ("b", 4)] {
            kept.keep(tag.into(), png(n));
        }
        assert!(kept.find("a").is_some());
        kept.keep("c".into(), png(4));
        assert_eq!((kept.find("b"), kept.find("a").map(|p| p.len()), kept.bytes), (None, Some(4), 8));
        kept.keep("huge".into(), png(11));
        assert_eq!((kept.find("huge"), kept.bytes), (None, 8));
        kept.keep("all".into(), png(10));
        assert_eq!((kept.pictures.len(), kept.bytes), (1, 10));
    }
}
