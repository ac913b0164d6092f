//! Leave to do what is costly: so many at a time, a few that wait for a while, and the rest are told to come back.
//!
//! A service with a long queue of such work answers nobody in time. Leave lasts for as long as what it was given for: of a picture, until
//! it is made; of an answer that lies in memory, until the client has taken it. A client that takes nothing loses its connection, so that a
//! few of them do not hold everything for ever.

use super::{
    body::PATIENCE,
    catalogue::Kind,
    problem::{Answer, Failure},
};
use axum::body::Body;
use bytes::Bytes;
use std::{io, sync::Arc, time::Duration};
use tokio::{
    sync::{OwnedSemaphorePermit, Semaphore, mpsc},
    time::timeout,
};
use tokio_stream::wrappers::ReceiverStream;

/// How long one may wait for its turn.
const WAIT: Duration = Duration::from_secs(10);
/// Seconds after which what was not admitted may be asked for again.
const RETRY: u64 = 2;
/// Bytes of a block on its way to the client.
const BLOCK: usize = 64 << 10;

/// One kind of costly work.
pub(super) struct Admission {
    /// What there is too much of, as in "too many ... at the same time".
    what: &'static str,
    /// Under way or waiting.
    admitted: Arc<Semaphore>,
    active: Arc<Semaphore>,
    wait: Duration,
}

/// Leave for one; dropping it lets the next begin.
pub(super) struct Leave {
    _permits: [OwnedSemaphorePermit; 2],
}

impl Admission {
    /// At most `active` at a time, and `waiting` that wait for their turn.
    pub(super) fn new(what: &'static str, active: usize, waiting: usize) -> Self {
        let slots = |n| Arc::new(Semaphore::new(n));
        Self { what, admitted: slots(active + waiting), active: slots(active), wait: WAIT }
    }

    /// Waits for leave.
    ///
    /// # Errors
    /// [`Kind::Busy`] where too many wait already, or the turn does not come in time.
    pub(super) async fn leave(&self) -> Answer<Leave> {
        let busy = || Failure::new(Kind::Busy, format!("too many {} at the same time", self.what)).retry_after(RETRY);
        let admitted = Arc::clone(&self.admitted).try_acquire_owned().map_err(|_| busy())?;
        let active = timeout(self.wait, Arc::clone(&self.active).acquire_owned()).await.map_err(|_| busy())?;
        Ok(Leave { _permits: [admitted, active.map_err(Failure::internal)?] })
    }
}

impl Leave {
    /// A body of `bytes`, which go when the leave does: when the client has taken them, has gone, or has taken none of them for a minute.
    /// In the last case the body ends early, and with it the connection, because an answer with it announces a Content-Length.
    pub(super) fn body(self, bytes: Vec<u8>) -> Body {
        let (sender, receiver) = mpsc::channel::<io::Result<Bytes>>(1);
        tokio::spawn(async move {
            let _leave = self;
            for block in bytes.chunks(BLOCK) {
                // Copied: a block that waits in the connection must not hold all the others.
                if !matches!(timeout(PATIENCE, sender.send(Ok(Bytes::copy_from_slice(block)))).await, Ok(Ok(()))) {
                    return;
                }
            }
        });
        Body::from_stream(ReceiverStream::new(receiver))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn some_are_active_some_wait_and_more_are_told_to_come_back() {
        let admission = Admission::new("tests", 2, 2);
        let first = admission.leave().await.unwrap();
        let _second = admission.leave().await.unwrap();
        let mut waiting: Vec<_> = (0..2).map(|_| Box::pin(admission.leave())).collect();
        for one in &mut waiting {
            assert!(futures_util::poll!(one.as_mut()).is_pending());
        }
        let refused = admission.leave().await.err().unwrap();
        assert_eq!((refused.kind(), refused.detail()), (Kind::Busy, "too many tests at the same time"));
        drop(first);
        let third = futures_util::poll!(waiting[0].as_mut());
        assert!(third.is_ready() && futures_util::poll!(waiting[1].as_mut()).is_pending());
        drop(third);
        assert!(futures_util::poll!(waiting[1].as_mut()).is_ready());
    }

    #[tokio::test]
    async fn a_turn_that_does_not_come_in_time_is_given_up() {
        let admission = Admission { wait: Duration::ZERO, ..Admission::new("tests", 1, 1) };
        let first = admission.leave().await.unwrap();
        assert_eq!(admission.leave().await.err().unwrap().kind(), Kind::Busy);
        drop(first);
        assert!(admission.leave().await.is_ok(), "who gave up waits no more");
    }

    #[tokio::test]
    async fn leave_lasts_until_the_body_is_taken_or_left() {
        let admission = Admission::new("tests", 1, 1);
        let bytes: Vec<u8> = (0..3 * BLOCK + 5).map(|k| k as u8).collect();
        let unread = admission.leave().await.unwrap().body(bytes.clone());
        let mut next = Box::pin(admission.leave());
        for _ in 0..100 {
            tokio::task::yield_now().await;
            assert!(futures_util::poll!(next.as_mut()).is_pending(), "nobody has taken the bytes");
        }
        drop(unread);
        let body = next.await.unwrap().body(bytes.clone());
        assert_eq!(axum::body::to_bytes(body, usize::MAX).await.unwrap(), bytes);
        assert!(admission.leave().await.is_ok());
    }
}
