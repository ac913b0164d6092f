//! What coordinators on one store tell each other: which jobs changed. Hints may be lost; everybody looks once a second too.

use super::core::Core;
use futures_util::StreamExt;
use std::{sync::Arc, time::Duration};

/// Changes are told together, this often at most.
const EVERY: Duration = Duration::from_millis(100);

/// Tells the others.
pub(super) async fn tell(core: Arc<Core>) {
    while !core.signals.is_stopping() {
        tokio::time::sleep(EVERY).await;
        let changed = core.signals.take_changed();
        if changed.is_empty() {
            continue;
        }
        if let Err(error) = core.store.hint(&changed).await {
            tracing::debug!(%error, "a hint was not told");
        }
    }
}

/// Hears the others.
pub(super) async fn hear(core: Arc<Core>) {
    while !core.signals.is_stopping() {
        match core.store.hints().await {
            Ok(mut hints) => {
                while let Some(jobs) = hints.next().await {
                    core.signals.others_changed(&jobs);
                }
            }
            Err(error) => tracing::warn!(%error, "hints cannot be heard"),
        }
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}
