//! Requests that may be repeated.

use super::*;
use crate::{
    auth::TokenId,
    store::{Claimed, KeptAnswer, NewRequest, REQUEST_KEPT},
};

fn request(key: &str, body: &str) -> NewRequest {
    NewRequest {
        owner: None,
        key: key.into(),
        print: Digest::of(body.as_bytes()),
        subject: Uuid::now_v7(),
        claim: Token::random(),
        deadline: NOW + 100,
    }
}

fn answer() -> KeptAnswer {
    KeptAnswer { status: 201, headers: vec![("location".into(), "/v1/jobs/x".into())], body: "{\"ü\":1}".into() }
}

pub(super) async fn a_key_has_one_request_and_one_answer(store: &dyn Store) {
    let first = request("k", "a");
    assert_eq!(store.claim_request(&first, NOW).await.unwrap(), Claimed::Granted(first.subject));
    assert_eq!(store.claim_request(&request("k", "a"), NOW + 99).await.unwrap(), Claimed::Running);
    assert_eq!(store.claim_request(&request("k", "b"), NOW + 99).await.unwrap(), Claimed::Other);
    assert!(store.renew_request(first.claim, NOW + 200).await.unwrap());
    assert_eq!(store.claim_request(&request("k", "a"), NOW + 199).await.unwrap(), Claimed::Running);
    assert!(store.answer_request(first.claim, &answer()).await.unwrap());
    assert!(!store.answer_request(first.claim, &answer()).await.unwrap() && !store.release_request(first.claim).await.unwrap());
    assert_eq!(store.claim_request(&request("k", "a"), NOW + 999).await.unwrap(), Claimed::Answered(answer()));
    assert_eq!(store.claim_request(&request("k", "b"), NOW + 999).await.unwrap(), Claimed::Other);
    // The same key of others is another one.
    let theirs = NewRequest { owner: Some(TokenId::from_random([1; 8])), ..request("k", "b") };
    assert_eq!(store.claim_request(&theirs, NOW).await.unwrap(), Claimed::Granted(theirs.subject));
}

pub(super) async fn a_claim_that_ends_without_an_answer_is_free_again(store: &dyn Store) {
    let first = request("k", "a");
    store.claim_request(&first, NOW).await.unwrap();
    // Given up, or left behind by a crash: only the same request goes on, and with the same id. It may have been done all the same.
    assert!(store.release_request(first.claim).await.unwrap());
    assert_eq!(store.claim_request(&request("k", "b"), NOW).await.unwrap(), Claimed::Other);
    let second = request("k", "a");
    assert_eq!(store.claim_request(&second, NOW).await.unwrap(), Claimed::Granted(first.subject));
    let third = NewRequest { deadline: NOW + 300, ..request("k", "a") };
    assert_eq!(store.claim_request(&third, NOW + 100).await.unwrap(), Claimed::Granted(first.subject));
    assert!(!store.renew_request(second.claim, NOW + 900).await.unwrap(), "the claim fences");
    assert!(!store.answer_request(second.claim, &answer()).await.unwrap());
    assert!(store.answer_request(third.claim, &answer()).await.unwrap());
}

pub(super) async fn answers_are_forgotten_after_a_day(store: &dyn Store) {
    let first = request("k", "a");
    store.claim_request(&first, NOW).await.unwrap();
    store.answer_request(first.claim, &answer()).await.unwrap();
    assert_eq!(store.claim_request(&request("k", "a"), NOW + REQUEST_KEPT - 1).await.unwrap(), Claimed::Answered(answer()));
    let second = request("k", "b");
    assert_eq!(store.claim_request(&second, NOW + REQUEST_KEPT).await.unwrap(), Claimed::Granted(second.subject));
    store.claim_request(&request("young", "a"), NOW + REQUEST_KEPT + 5).await.unwrap();
    assert_eq!(store.forget_requests(NOW).await.unwrap(), 0, "it began anew");
    assert_eq!(store.forget_requests(NOW + REQUEST_KEPT).await.unwrap(), 1);
    assert!(!store.answer_request(second.claim, &answer()).await.unwrap());
}

/// Of many that ask at once, one gets it.
pub(super) async fn a_claim_is_given_once(store: &dyn Store) {
    let all: Vec<NewRequest> = (0..8).map(|_| request("k", "a")).collect();
    let claimed = futures_util::future::join_all(all.iter().map(|r| store.claim_request(r, NOW))).await;
    let granted: Vec<_> = claimed.iter().filter(|c| matches!(c, Ok(Claimed::Granted(_)))).collect();
    assert_eq!(granted.len(), 1, "{claimed:?}");
    assert!(claimed.iter().all(|c| matches!(c, Ok(Claimed::Granted(_) | Claimed::Running))), "{claimed:?}");
}
