//! How a worker leaves: three orders, each of which includes those before it.
//!
//! `drain`: begin nothing new. `give_up`: do not wait for the tile in hand any longer. `cut`: leave. The second comes when four fifths of the
//! drain timeout have passed, so that a tile that takes too long does not keep what is finished from being delivered, nor the lease from
//! being handed back.

use std::time::Duration;
use tokio_util::{sync::CancellationToken, task::AbortOnDropHandle};

/// The share of the drain timeout that the tile in hand may take.
const FOR_THE_TILE: f64 = 0.8;

/// The three orders.
#[derive(Debug, Clone)]
pub(super) struct Leave {
    pub(super) drain: CancellationToken,
    pub(super) give_up: CancellationToken,
    pub(super) cut: CancellationToken,
}

impl Leave {
    pub(super) fn new() -> Self {
        let cut = CancellationToken::new();
        let give_up = cut.child_token();
        Self { drain: give_up.child_token(), give_up, cut }
    }

    /// Gives the orders in their time once `stop` is.
    pub(super) fn follow(&self, stop: CancellationToken, within: Duration) -> AbortOnDropHandle<()> {
        let Self { drain, give_up, cut } = self.clone();
        let tile = within.mul_f64(FOR_THE_TILE);
        AbortOnDropHandle::new(tokio::spawn(async move {
            stop.cancelled().await;
            drain.cancel();
            tokio::time::sleep(tile).await;
            give_up.cancel();
            tokio::time::sleep(within.saturating_sub(tile)).await;
            cut.cancel();
        }))
    }
}
