//! Long computations beside the runtime, on threads that nobody waits for when the process leaves.
//!
//! The runtime's own blocking threads hold up its end until they are done: a worker whose tile takes a minute would stay a minute after its
//! drain timeout.

use tokio::sync::oneshot;

/// Why there is no result.
#[derive(Debug, thiserror::Error)]
pub(super) enum Lost {
    #[error("a thread cannot be started")]
    Start(#[source] std::io::Error),
    #[error("the computation panicked")]
    Panicked,
}

/// Runs `work` on a thread of its own.
pub(super) async fn off<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> Result<T, Lost> {
    let (done, result) = oneshot::channel();
    let thread = std::thread::Builder::new().name(name.to_owned());
    // Whoever asked may have left; then the result goes nowhere.
    thread.spawn(move || done.send(work()).is_ok()).map_err(Lost::Start)?;
    result.await.map_err(|_| Lost::Panicked)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn results_and_panics_come_back() {
        assert_eq!(off("test", || 7).await.unwrap(), 7);
        assert!(matches!(off("test", || panic!("on purpose")).await, Err::<(), _>(Lost::Panicked)));
    }
}
