//! The worker protocol's rim: frames, refusals, statuses.

use super::*;
use crate::http::worker_protocol::FRAME;
use kiln_proto::{
    BAKE_VERSION,
    ids::{Token, WorkerId},
    wire::{
        frame::{Message, from_frame, to_frame},
        message::{Finish, Heartbeat, HeartbeatReply, Hello, LeaseRequest, Refusal, Welcome},
    },
};

fn hello(bake_version: u32) -> Hello {
    Hello { bake_version, name: "test".into(), threads: 2, features: vec![] }
}

impl Bench {
    async fn frame(&self, path: &str, bytes: Vec<u8>) -> Reply {
        self.send(Request::post(path).header(header::CONTENT_TYPE, FRAME).body(bytes.into()).unwrap()).await
    }

    async fn message(&self, path: &str, message: &impl Message) -> Reply {
        self.frame(path, to_frame(message).unwrap()).await
    }
}

fn refusal(reply: &Reply) -> (u16, Refusal) {
    assert_eq!(reply.headers[header::CONTENT_TYPE], FRAME);
    (reply.status.as_u16(), from_frame(&reply.body).unwrap())
}

#[tokio::test]
async fn damaged_frames_are_refused_and_counted() {
    let bench = Bench::new().await;
    let good = to_frame(&hello(BAKE_VERSION)).unwrap();
    let mut flipped = good.clone();
    *flipped.last_mut().unwrap() ^= 1;
    let other_kind = to_frame(&Heartbeat { texels_done: 0, rays: 0 }).unwrap();
    for bad in [vec![], b"GET / HTTP/1.1".to_vec(), good[..good.len() - 1].to_vec(), flipped, other_kind] {
        let (status, refusal) = refusal(&bench.frame("/v1/worker/hello", bad).await);
        assert!(status == 400 && matches!(refusal, Refusal::Invalid { .. }), "{refusal}");
    }
    let mut later = good;
    later[4] = 9;
    let reply = bench.frame("/v1/worker/hello", later).await;
    assert!(matches!(refusal(&reply), (426, Refusal::Incompatible { .. })));
    let (status, _) = refusal(&bench.frame("/v1/worker/hello", vec![0; 3 << 20]).await);
    assert_eq!(status, 413);
    let text = String::from_utf8(bench.get("/metrics").await.body.to_vec()).unwrap();
    assert!(text.contains("kiln_frames_refused_total 6"), "{text}");
}

#[tokio::test]
async fn a_worker_is_welcomed_waits_and_is_listed() {
    let bench = Bench::new().await;
    let reply = bench.message("/v1/worker/hello", &hello(BAKE_VERSION)).await;
    assert_eq!(reply.status, StatusCode::OK);
    let welcome: Welcome = from_frame(&reply.body).unwrap();
    let reply = bench.message("/v1/worker/leases", &LeaseRequest { worker: welcome.worker, wait_ms: 0 }).await;
    assert_eq!((reply.status, reply.body.len()), (StatusCode::NO_CONTENT, 0));
    let workers = bench.get("/v1/workers").await.json();
    assert_eq!(workers["workers"][0]["id"], welcome.worker.to_string());
    assert_eq!(workers["workers"][0]["threads"], 2);
}

#[tokio::test]
async fn strangers_are_refused_with_the_status_that_fits() {
    let bench = Bench::new().await;
    let reply = bench.message("/v1/worker/hello", &hello(BAKE_VERSION + 1)).await;
    assert!(matches!(refusal(&reply), (426, Refusal::Incompatible { bake_version: BAKE_VERSION, .. })));
    let reply = bench.message("/v1/worker/leases", &LeaseRequest { worker: WorkerId::random(), wait_ms: 0 }).await;
    assert_eq!(refusal(&reply), (404, Refusal::UnknownWorker));
    let attempt = format!("/v1/worker/attempts/{}", Token::random());
    let finish = Finish { core_seconds: 0.0, rays: 0, peak_rss_bytes: 0, failure: None };
    for end in ["complete", "release"] {
        let reply = bench.message(&format!("{attempt}/{end}"), &finish).await;
        assert!(matches!(refusal(&reply), (410, Refusal::Gone { .. })), "{end}");
    }
    let reply = bench.message(&format!("{attempt}/heartbeat"), &Heartbeat { texels_done: 0, rays: 0 }).await;
    assert_eq!(from_frame::<HeartbeatReply>(&reply.body).unwrap(), HeartbeatReply::Cancel);
    assert_eq!(bench.message("/v1/worker/attempts/nonsense/release", &finish).await.status, StatusCode::GONE);
    let scene = bench.get(&format!("/v1/worker/scenes/{}", "0".repeat(64))).await;
    assert_eq!((scene.status, bench.get("/v1/worker/plans/xyz").await.status), (StatusCode::NOT_FOUND, StatusCode::NOT_FOUND));
}

#[tokio::test]
async fn chunks_of_unknown_attempts_leave_nothing_behind() {
    let bench = Bench::new().await;
    let before = bench.files();
    let put = |body: Body| Request::put(format!("/v1/worker/attempts/{}/chunks/0", Token::random())).body(body).unwrap();
    let reply = bench.send(put(Body::from(vec![7; 1_000]))).await;
    assert!(matches!(refusal(&reply).0, 410 | 422));
    let cut = futures_util::stream::iter([Ok(Bytes::from_static(b"half")), Err(std::io::Error::other("reset"))]);
    assert_eq!(refusal(&bench.send(put(Body::from_stream(cut))).await).0, 400);
    assert_eq!(bench.files(), before);
}
