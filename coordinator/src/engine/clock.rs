//! The clock of a farm: the store's, followed by this machine's steady clock.
//!
//! Deadlines are compared with what other coordinators wrote, so that all of them must mean the same clock: the database's. Asking it for
//! every call would cost a round trip each; instead it is asked now and then, and in between time goes on by the steady clock, which nobody
//! sets. A store that only this process uses is asked once: whoever sets the machine's clock ahead by an hour lets no lease expire.

use super::{Clock, EngineError};
use crate::store::Store;
use std::{
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
    time::{Duration, Instant},
};

/// How often a shared store is asked.
const EVERY: Duration = Duration::from_secs(10);

/// A clock that follows the store's. It is asked again for as long as somebody holds the clock.
///
/// # Errors
/// A store that does not answer.
pub(super) async fn following(store: &Arc<dyn Store>) -> Result<Clock, EngineError> {
    let begun = Instant::now();
    let ahead = Arc::new(AtomicI64::new(ask(store, begun).await?));
    if store.is_shared() {
        let (held, store) = (Arc::downgrade(&ahead), Arc::clone(store));
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(EVERY).await;
                let Some(ahead) = held.upgrade() else { return };
                match ask(&store, begun).await {
                    Ok(now) => ahead.store(now, Ordering::Relaxed),
                    Err(error) => tracing::warn!(%error, "the store's clock does not answer; this machine's goes on"),
                }
            }
        });
    }
    Ok(Arc::new(move || millis(begun.elapsed()) + ahead.load(Ordering::Relaxed)))
}

/// How far the store's clock is ahead of the time since `begun`, milliseconds; the answer is taken to be of the middle of the call.
async fn ask(store: &Arc<dyn Store>, begun: Instant) -> Result<i64, EngineError> {
    let before = begun.elapsed();
    let there = store.clock().await?;
    Ok(there - (millis(before) + millis(begun.elapsed())) / 2)
}

fn millis(time: Duration) -> i64 {
    i64::try_from(time.as_millis()).unwrap_or(i64::MAX)
}
