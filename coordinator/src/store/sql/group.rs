//! Group commit: calls that arrive while a transaction runs share the next one.
//!
//! A transaction costs a flush of the disk whatever is in it, and a job's row is locked until it is done, so that a thousand workers whose
//! chunks each came in a transaction of their own would queue for seconds. Nobody waits for company: a lone call runs at once, and the
//! busier the database, the larger the groups. The work runs in a task of its own, so that a client that goes away in the middle of it takes
//! nobody's answer along.

use super::super::StoreError;
use std::sync::Arc;
use tokio::sync::{mpsc, oneshot};

/// Calls in one transaction, at most: a large one keeps its rows locked for long.
const MOST: usize = 256;
/// Calls that wait for their turn before callers are held up.
const QUEUE: usize = 4_096;

/// What is done with a group of calls.
#[async_trait::async_trait]
pub(super) trait Together: Send + Sync + 'static {
    /// A call.
    type Ask: Clone + Send + Sync + 'static;
    /// Its answer.
    type Answer: Send + 'static;

    /// Does all of them in one transaction; an answer for each, in order.
    async fn together(&self, asks: &[Self::Ask]) -> Result<Vec<Self::Answer>, StoreError>;
}

type Waiting<T> = (<T as Together>::Ask, oneshot::Sender<Result<<T as Together>::Answer, StoreError>>);

/// The door to one kind of call.
pub(super) struct Group<T: Together> {
    door: mpsc::Sender<Waiting<T>>,
}

impl<T: Together> Group<T> {
    /// Starts the task that works; it ends when the group is dropped.
    pub(super) fn new(work: Arc<T>) -> Self {
        let (door, mut calls) = mpsc::channel::<Waiting<T>>(QUEUE);
        tokio::spawn(async move {
            let mut batch = Vec::with_capacity(MOST);
            while calls.recv_many(&mut batch, MOST).await > 0 {
                serve(&*work, std::mem::take(&mut batch)).await;
            }
        });
        Self { door }
    }

    /// Makes a call.
    pub(super) async fn call(&self, ask: T::Ask) -> Result<T::Answer, StoreError> {
        let (answer, waiting) = oneshot::channel();
        self.door.send((ask, answer)).await.map_err(|_| StoreError::Closed)?;
        waiting.await.map_err(|_| StoreError::Closed)?
    }
}

async fn serve<T: Together>(work: &T, batch: Vec<Waiting<T>>) {
    let (asks, waiting): (Vec<_>, Vec<_>) = batch.into_iter().unzip();
    match work.together(&asks).await {
        Ok(answers) => {
            for (waiting, answer) in waiting.into_iter().zip(answers) {
                let _ = waiting.send(Ok(answer)); // Whoever asked may have gone.
            }
        }
        Err(error) if asks.len() > 1 => {
            // One call that cannot be done must not fail its neighbours.
            tracing::debug!(%error, calls = asks.len(), "a group failed; its calls are made one by one");
            for (ask, waiting) in asks.iter().zip(waiting) {
                let alone = work.together(std::slice::from_ref(ask)).await;
                let _ = waiting.send(alone.and_then(|answers| answers.into_iter().next().ok_or(StoreError::Closed)));
            }
        }
        Err(error) => {
            if let Some(waiting) = waiting.into_iter().next() {
                let _ = waiting.send(Err(error));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use tokio::sync::Semaphore;

    /// Doubles numbers, one group per permit; a group with a 13 in it fails.
    struct Double {
        gate: Semaphore,
        groups: Mutex<Vec<usize>>,
    }

    #[async_trait::async_trait]
    impl Together for Double {
        type Ask = u32;
        type Answer = u32;
        async fn together(&self, asks: &[u32]) -> Result<Vec<u32>, StoreError> {
            self.gate.acquire().await.unwrap().forget();
            self.groups.lock().unwrap().push(asks.len());
            if asks.contains(&13) { Err(StoreError::Full) } else { Ok(asks.iter().map(|a| 2 * a).collect()) }
        }
    }

    fn group() -> (Arc<Double>, Arc<Group<Double>>) {
        let work = Arc::new(Double { gate: Semaphore::new(0), groups: Mutex::default() });
        (Arc::clone(&work), Arc::new(Group::new(work)))
    }

    async fn ask(group: &Arc<Group<Double>>, numbers: &[u32]) -> Vec<Option<u32>> {
        futures_util::future::join_all(numbers.iter().map(|n| group.call(*n))).await.into_iter().map(Result::ok).collect()
    }

    #[tokio::test]
    async fn calls_that_arrive_meanwhile_share_a_transaction() {
        let (work, group) = group();
        let numbers: Vec<u32> = (20..30).collect();
        let waiting = tokio::spawn({
            let group = Arc::clone(&group);
            async move { ask(&group, &numbers).await }
        });
        // The test's own thread runs all tasks: after some turns the calls are in the queue, and at most the first of them is under way.
        for _ in 0..20 {
            tokio::task::yield_now().await;
        }
        work.gate.add_permits(100);
        assert_eq!(waiting.await.unwrap(), (20..30).map(|n| Some(2 * n)).collect::<Vec<_>>());
        let groups = work.groups.lock().unwrap().clone();
        assert_eq!(groups.iter().sum::<usize>(), 10);
        assert!(groups.len() <= 2, "{groups:?}");
    }

    #[tokio::test]
    async fn a_call_that_fails_fails_alone() {
        let (work, group) = group();
        work.gate.add_permits(100);
        assert_eq!(ask(&group, &[1, 13, 2]).await, [Some(2), None, Some(4)]);
    }
}
