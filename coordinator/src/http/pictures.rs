//! Rendered pictures: how many are made at a time, how many wait, and the last ones in memory.
//!
//! A picture costs every core for a second, and pages ask for the same few. So two are made at a time, a few more wait, and the rest are told
//! to come back: a service whose renderer has a long queue answers nobody in time. The cache is small, in memory and lost with the
//! process; on disk it would need a place in the store's bookkeeping for what can be made again at any time.

use super::{
    catalogue::Kind,
    problem::{Answer, Failure},
};
use bytes::Bytes;
use std::{
    collections::VecDeque,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Pictures that are made at the same time.
const MAKING: usize = 2;
/// Pictures that are made or wait to be.
const ADMITTED: usize = MAKING + 6;
/// Bytes of pictures that are kept.
const KEPT: usize = 32 << 20;
/// Seconds after which a picture that was not admitted may be asked for again.
const RETRY: u64 = 2;

/// What is known of pictures.
pub(super) struct Pictures {
    admitted: Arc<Semaphore>,
    making: Arc<Semaphore>,
    kept: Mutex<Kept>,
}

/// Leave to make one picture; dropping it lets the next begin.
pub(super) struct Leave {
    _permits: [OwnedSemaphorePermit; 2],
}

impl Default for Pictures {
    fn default() -> Self {
        let slots = |n| Arc::new(Semaphore::new(n));
        Self { admitted: slots(ADMITTED), making: slots(MAKING), kept: Mutex::new(Kept::new(KEPT)) }
    }
}

impl Pictures {
    /// Waits for leave to make a picture.
    ///
    /// # Errors
    /// [`Kind::Busy`] where too many wait already.
    pub(super) async fn leave(&self) -> Answer<Leave> {
        let busy = || Failure::new(Kind::Busy, "too many pictures are being rendered").retry_after(RETRY);
        let admitted = Arc::clone(&self.admitted).try_acquire_owned().map_err(|_| busy())?;
        let making = Arc::clone(&self.making).acquire_owned().await.map_err(Failure::internal)?;
        Ok(Leave { _permits: [admitted, making] })
    }

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

    #[tokio::test]
    async fn two_are_made_some_wait_and_more_are_told_to_come_back() {
        let pictures = Arc::new(Pictures::default());
        let first = pictures.leave().await.unwrap();
        let _second = pictures.leave().await.unwrap();
        let mut waiting: Vec<_> = (2..ADMITTED)
            .map(|_| {
                let pictures = Arc::clone(&pictures);
                Box::pin(async move { pictures.leave().await })
            })
            .collect();
        for one in &mut waiting {
            assert!(futures_util::poll!(one.as_mut()).is_pending());
        }
        let refused = pictures.leave().await.err().unwrap();
        assert_eq!(refused.kind(), Kind::Busy);
        drop(first);
        let third = futures_util::poll!(waiting[0].as_mut());
        assert!(third.is_ready() && futures_util::poll!(waiting[1].as_mut()).is_pending());
        drop(third);
        assert!(futures_util::poll!(waiting[1].as_mut()).is_ready());
    }
}
