//! Streams that are open when their token is taken back.

use super::*;
use futures_util::StreamExt;

#[tokio::test]
async fn a_stream_tells_nothing_more_once_its_token_is_revoked() {
    let time = Arc::new(AtomicI64::new(1_000_000));
    let bench = Bench::timed(AccessConfig::default(), Arc::clone(&time)).await;
    let (one, two, admin) = (bench.holder(&[Role::Submit]).await, bench.holder(&[Role::Read]).await, bench.holder(&[Role::Admin]).await);
    let (job, ..) = bench.job_of(&one).await;
    let open = async |who: &Holder| {
        let request = who.request("GET", &format!("/v1/jobs/{job}/events"), Body::empty());
        let mut body = bench.router.clone().oneshot(request).await.unwrap().into_body().into_data_stream();
        let first = body.next().await.unwrap().unwrap();
        assert!(String::from_utf8_lossy(&first).contains("event: state"), "{first:?}");
        body
    };
    let (mut revoked, mut good) = (open(&one).await, open(&two).await);
    Desk::new(bench.engine.tokens()).revoke(one.id, bench.engine.now()).await.unwrap();
    time.fetch_add(5_000, Ordering::Relaxed);
    assert_eq!(bench.by(&admin, "POST", &format!("/v1/jobs/{job}/cancel")).await.status, StatusCode::OK);
    let rest = async |body: &mut axum::body::BodyDataStream| {
        let mut text = String::new();
        while let Some(piece) = body.next().await {
            text += &String::from_utf8_lossy(&piece.unwrap());
        }
        text
    };
    assert!(rest(&mut good).await.contains("cancelled"));
    assert!(!rest(&mut revoked).await.contains("cancelled"));
}
