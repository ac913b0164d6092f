//! PostgreSQL against the suite, and what only several coordinators can do wrong.

use super::SqlStore;
use crate::store::{Store, StoreError, conformance};
use futures_util::StreamExt;
use kiln_proto::ids::JobId;
use kiln_test_servers::Postgres;
use std::sync::Arc;

#[tokio::test(flavor = "multi_thread")]
async fn it_conforms() {
    let server = Postgres::start();
    conformance::all(|| {
        let url = server.database();
        async move { Arc::new(SqlStore::postgres(&url).await.unwrap()) as Arc<dyn Store> }
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_coordinators_share_what_one_database_holds() {
    let server = Postgres::start();
    let url = server.database();
    // Both bring the schema up to date at once.
    let (one, other) = tokio::join!(SqlStore::postgres(&url), SqlStore::postgres(&url));
    let (one, other) = (Arc::new(one.unwrap()), Arc::new(other.unwrap()));
    conformance::concurrent(Arc::clone(&one) as Arc<dyn Store>, Arc::clone(&other) as Arc<dyn Store>).await;
    let mut hints = other.hints().await.unwrap();
    let job = JobId::random();
    one.hint(&[job]).await.unwrap();
    assert_eq!(hints.next().await.unwrap(), [job]);
    let (here, there) = (one.clock().await.unwrap(), other.clock().await.unwrap());
    assert!((there - here).abs() < 60_000 && here > 1_700_000_000_000, "{here} {there}");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_committed_survives_an_immediate_stop() {
    let mut server = Postgres::start();
    let store = SqlStore::postgres(&server.database()).await.unwrap();
    for _ in 0..3 {
        let scene = conformance::ready_scene(&store).await;
        let job = conformance::probing(&store, scene, 3, 0).await;
        server.stop_immediately();
        assert!(store.job(job).await.is_err(), "nobody answers");
        server.run();
        let mut found = store.job(job).await;
        // Connections of the pool that died with the server are found out one by one.
        for _ in 0..20 {
            if found.is_ok() {
                break;
            }
            found = store.job(job).await;
        }
        assert_eq!(found.unwrap().unwrap().tiles, (3, 0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_not_there_is_named_without_its_password() {
    let port = kiln_test_servers::free_port();
    let error = SqlStore::postgres(&format!("postgres://kiln:secret@127.0.0.1:{port}/kiln")).await.err().unwrap();
    let text = error.to_string();
    assert!(matches!(error, StoreError::Open { .. }) && text.contains(&port.to_string()) && !text.contains("secret"), "{text}");
}
