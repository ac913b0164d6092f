//! Outbox, spool, courier and session against a coordinator that misbehaves.

use super::{
    attempt::{Attempt, Heart},
    courier::Courier,
    ledger::Ledger,
    outbox::{Closed, Outbox},
    session::{CallError, Session},
    spool::{Spool, Spooled},
    testing::{Fake, Upload},
};
use bytes::Bytes;
use kiln_proto::{
    ids::Token,
    wire::message::{Finish, Refusal},
};
use std::{path::Path, sync::Arc, time::SystemTime};
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

const PLENTY: u64 = 1 << 20;

/// A worker without light.
struct Worker {
    session: Arc<Session>,
    outbox: Outbox,
    ledger: Ledger,
    courier: JoinHandle<Result<(), CallError>>,
    stop: CancellationToken,
    inherited: Vec<Spooled>,
}

impl Worker {
    async fn start(fake: &Fake, root: &Path, limit: u64) -> Self {
        let stop = CancellationToken::new();
        let session = fake.session(&stop).await;
        let (spool, inherited) = Spool::open(root, "farm", limit, SystemTime::now()).unwrap();
        let (courier, outbox, ledger) = Courier::new(session.clone(), Some(spool), inherited.clone());
        Self { session, outbox, ledger, courier: tokio::spawn(courier.run()), stop, inherited }
    }

    fn attempt(&self) -> (Arc<Attempt>, Heart) {
        let attempt = Arc::new(Attempt::new(Token::random()));
        self.ledger.open(attempt.token());
        (attempt.clone(), Heart::start(self.session.clone(), attempt, self.ledger.clone()))
    }

    async fn chunk(&self, owner: &Arc<Attempt>, number: u32) -> Result<(), Closed> {
        self.outbox.chunk(owner, number, bytes(number)).await
    }

    fn end(&self, attempt: &Arc<Attempt>, heart: Heart) {
        self.outbox.end(attempt.clone(), finish(), true, heart).unwrap();
    }

    /// Hands in nothing more; how delivery ended.
    async fn leave(self) -> Result<(), CallError> {
        drop(self.outbox);
        self.courier.await.unwrap()
    }
}

fn finish() -> Finish {
    Finish { core_seconds: 0.0, rays: 0, peak_rss_bytes: 0, failure: None }
}

fn bytes(number: u32) -> Bytes {
    Bytes::from(vec![number as u8; 1000])
}

/// Chunks on disk.
fn spooled(root: &Path) -> usize {
    let mut folders = vec![root.to_owned()];
    let mut chunks = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            chunks += usize::from(path.extension().is_some_and(|e| e == "chunk"));
            folders.extend(Some(path).filter(|p| p.is_dir()));
        }
    }
    chunks
}

/// Until something is so; the test's own limit is that of the test runner.
async fn until(mut is: impl FnMut() -> bool) {
    while !is() {
        tokio::time::sleep(std::time::Duration::from_millis(2)).await;
    }
}

#[tokio::test]
async fn finished_work_waits_for_a_coordinator_that_is_away_and_arrives_in_order() {
    let (root, mut fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    fake.go();
    let (attempt, heart) = worker.attempt();
    for number in 0..3 {
        worker.chunk(&attempt, number).await.unwrap();
    }
    worker.end(&attempt, heart);
    assert_eq!(spooled(root.path()), 3, "handing in waits for the disk, not for the network");
    fake.come();
    worker.leave().await.unwrap();
    let token = attempt.token();
    fake.seen(|seen| {
        assert_eq!(seen.taken, [(token, 0), (token, 1), (token, 2)]);
        assert!((0..3).all(|n| seen.bytes[&(token, n)] == bytes(n)));
        assert_eq!(seen.ended, [(token, "complete".to_owned())]);
    });
    assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0, "nothing is left behind");
}

#[tokio::test]
async fn a_chunk_is_sent_until_its_verdict_is_heard() {
    let (root, fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    let script = [
        Upload::Status(503, Some("0")),
        Upload::Status(429, None),
        Upload::Status(502, None),
        Upload::Refuse(503, Refusal::Busy { retry_after_ms: 1 }),
        Upload::CutBefore,
        Upload::CutAfter,
        Upload::CutAfter,
    ];
    fake.seen(|seen| seen.script.extend(script));
    let (attempt, heart) = worker.attempt();
    worker.chunk(&attempt, 0).await.unwrap();
    worker.end(&attempt, heart);
    worker.leave().await.unwrap();
    fake.seen(|seen| {
        assert_eq!(seen.uploads, 8);
        assert_eq!(seen.taken, [(attempt.token(), 0)]);
        assert_eq!(seen.ended.len(), 1);
    });
}

#[tokio::test]
async fn what_no_waiting_will_change_is_dropped_with_the_rest_of_its_attempt() {
    let (root, fake) = (TempDir::new().unwrap(), Fake::start());
    for refusal in
        [Upload::Refuse(410, Refusal::Gone { state: "fenced".into() }), Upload::Refuse(422, Refusal::Invalid { reason: "no".into() })]
    {
        let worker = Worker::start(&fake, root.path(), PLENTY).await;
        fake.seen(|seen| (seen.uploads, seen.script) = (0, [refusal].into()));
        let (attempt, heart) = worker.attempt();
        worker.chunk(&attempt, 0).await.unwrap();
        until(|| attempt.is_refused()).await;
        worker.chunk(&attempt, 1).await.unwrap();
        worker.end(&attempt, heart);
        let ledger = worker.ledger.clone();
        worker.leave().await.unwrap();
        ledger.may_lease().await;
        fake.seen(|seen| assert_eq!((seen.uploads, seen.ended.len()), (1, 0)));
        assert_eq!(spooled(root.path()), 0);
    }
}

#[tokio::test]
async fn an_attempt_that_expired_delivers_all_the_same_before_anything_is_leased() {
    let (root, mut fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    let (attempt, heart) = worker.attempt();
    fake.seen(|seen| seen.expired.insert(attempt.token()));
    until(|| attempt.is_over()).await;
    fake.go();
    worker.chunk(&attempt, 0).await.unwrap();
    worker.end(&attempt, heart);
    let ledger = worker.ledger.clone();
    let leasing = tokio::spawn(async move { ledger.may_lease().await });
    tokio::task::yield_now().await;
    assert!(!leasing.is_finished(), "its tiles would be leased again");
    fake.come();
    leasing.await.unwrap();
    worker.leave().await.unwrap();
    fake.seen(|seen| {
        assert_eq!(seen.taken, [(attempt.token(), 0)]);
        assert!(seen.ended.is_empty(), "an attempt that is over has no end to tell");
    });
}

#[tokio::test]
async fn a_heartbeat_that_fails_does_not_stop_the_attempt() {
    let (root, mut fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    let (attempt, heart) = worker.attempt();
    fake.go();
    let waits = || {
        let mut context = std::task::Context::from_waker(std::task::Waker::noop());
        std::pin::pin!(worker.ledger.may_lease()).as_mut().poll(&mut context).is_pending()
    };
    until(waits).await;
    assert!(!attempt.is_over());
    fake.come();
    until(|| !waits()).await;
    worker.end(&attempt, heart);
    worker.leave().await.unwrap();
    fake.seen(|seen| assert_eq!(seen.ended.len(), 1));
}

#[tokio::test]
async fn a_spool_without_room_makes_its_owner_wait_for_delivery() {
    let (root, mut fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Arc::new(Worker::start(&fake, root.path(), 2500).await);
    fake.go();
    let (attempt, heart) = worker.attempt();
    worker.chunk(&attempt, 0).await.unwrap();
    worker.chunk(&attempt, 1).await.unwrap();
    let (hand, owner) = (worker.clone(), attempt.clone());
    let third = tokio::spawn(async move { hand.chunk(&owner, 2).await });
    for _ in 0..50 {
        tokio::task::yield_now().await;
    }
    assert!(!third.is_finished() && spooled(root.path()) == 2);
    fake.come();
    third.await.unwrap().unwrap();
    worker.chunk(&attempt, 3).await.unwrap();
    worker.end(&attempt, heart);
    Arc::into_inner(worker).unwrap().leave().await.unwrap();
    fake.seen(|seen| assert_eq!(seen.taken.iter().map(|(_, n)| *n).collect::<Vec<_>>(), [0, 1, 2, 3]));
}

#[tokio::test]
async fn a_disk_that_fails_makes_its_owner_wait_for_delivery() {
    let (root, fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    std::fs::remove_dir_all(root.path().join("farm")).unwrap();
    let (attempt, heart) = worker.attempt();
    worker.chunk(&attempt, 0).await.unwrap();
    fake.seen(|seen| assert_eq!(seen.taken.len(), 1, "it was delivered before it was handed in"));
    worker.end(&attempt, heart);
    worker.leave().await.unwrap();
}

#[tokio::test]
async fn a_worker_told_to_leave_leaves_its_chunks_to_the_next() {
    let (root, mut fake) = (TempDir::new().unwrap(), Fake::start());
    let worker = Worker::start(&fake, root.path(), PLENTY).await;
    fake.go();
    let (attempt, heart) = worker.attempt();
    worker.chunk(&attempt, 0).await.unwrap();
    worker.end(&attempt, heart);
    worker.stop.cancel();
    assert!(matches!(worker.leave().await, Err(CallError::Stopped)));
    assert_eq!(spooled(root.path()), 1);
    fake.come();
    let heir = Worker::start(&fake, root.path(), PLENTY).await;
    assert_eq!(heir.inherited.len(), 1);
    heir.ledger.may_lease().await;
    fake.seen(|seen| assert_eq!(seen.taken, [(attempt.token(), 0)], "before the first lease"));
    heir.leave().await.unwrap();
    assert_eq!(spooled(root.path()), 0);
}

#[tokio::test]
async fn a_worker_that_is_not_let_in_any_more_ends_and_keeps_its_chunks() {
    let (root, fake) = (TempDir::new().unwrap(), Fake::start());
    for (status, words) in [(401, "token"), (403, "role"), (413, "limits the size"), (404, "check the address")] {
        let worker = Worker::start(&fake, root.path(), PLENTY).await;
        fake.seen(|seen| seen.script = [Upload::Status(status, None)].into());
        let (attempt, heart) = worker.attempt();
        worker.chunk(&attempt, 0).await.unwrap();
        worker.end(&attempt, heart);
        let error = worker.leave().await.unwrap_err();
        assert!(error.advice().contains(words), "{error}: {}", error.advice());
        assert_eq!(spooled(root.path()), 1, "good work waits for a better day");
        Worker::start(&fake, root.path(), PLENTY).await.leave().await.unwrap();
        assert_eq!(spooled(root.path()), 0);
    }
}

#[tokio::test]
async fn a_door_that_stays_shut_is_told_and_one_that_opens_is_waited_for() {
    let fake = Fake::start();
    let stop = CancellationToken::new();
    let other = Refusal::Incompatible { protocol: 9, bake_version: 8 };
    for (door, words) in [
        (Upload::Refuse(426, other), "same release"),
        (Upload::Status(401, None), "token"),
        (Upload::Status(403, None), "role"),
        (Upload::Status(404, None), "check the address"),
        (Upload::Status(301, None), "http against https"),
    ] {
        fake.seen(|seen| seen.door = Some(door));
        let error = fake.try_session(&stop).await.err().unwrap();
        assert!(error.advice().contains(words), "{error}: {}", error.advice());
    }
    fake.seen(|seen| seen.door = Some(Upload::Status(503, Some("0"))));
    let opened = fake.try_session(&stop);
    let opens = async {
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        fake.seen(|seen| seen.door = None);
    };
    let (session, ()) = tokio::join!(opened, opens);
    assert!(session.is_ok());
}
