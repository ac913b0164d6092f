//! Tokens, the secret of the service, and owners.

use super::*;
use crate::{
    auth::{Role, Roles, Scope, TokenId, TokenRow},
    store::JobFilter,
};

fn token(n: u8) -> TokenRow {
    TokenRow {
        id: TokenId::from_random([n; 8]),
        name: format!("token {n}"),
        roles: Roles::of(&[Role::Submit, Role::Read]),
        hash: Digest::of(&[n]),
        created_ms: NOW + i64::from(n),
        used_ms: None,
        expires_ms: (n == 1).then_some(NOW + 500),
        revoked_ms: None,
    }
}

pub(super) async fn tokens_are_kept_rotated_and_revoked_once(store: &dyn Store) {
    assert!(!store.has_tokens().await.unwrap());
    let (one, two) = (token(1), token(2));
    store.add_token(&two).await.unwrap();
    store.add_token(&one).await.unwrap();
    assert!(store.add_token(&one).await.is_err(), "no two tokens have the same id");
    assert_eq!(store.tokens().await.unwrap(), [one.clone(), two.clone()]);
    store.touch_token(one.id, NOW + 9).await.unwrap();
    store.touch_token(one.id, NOW + 7).await.unwrap();
    assert!(store.rotate_token(one.id, Digest::of(b"new")).await.unwrap());
    let used = TokenRow { used_ms: Some(NOW + 9), hash: Digest::of(b"new"), ..one.clone() };
    assert_eq!(store.token(one.id).await.unwrap(), Some(used));
    assert!(store.revoke_token(one.id, NOW + 20).await.unwrap());
    assert!(!store.revoke_token(one.id, NOW + 30).await.unwrap());
    assert!(!store.rotate_token(one.id, Digest::of(b"again")).await.unwrap(), "what was revoked stays so");
    assert_eq!(store.token(one.id).await.unwrap().unwrap().revoked_ms, Some(NOW + 20));
    assert!(store.revoke_token(two.id, NOW).await.unwrap());
    assert!(store.has_tokens().await.unwrap(), "revoking the last token opens nothing");
    assert_eq!(store.token(TokenId::from_random([9; 8])).await.unwrap(), None);
}

pub(super) async fn the_secret_of_the_service_is_made_once(store: &dyn Store) {
    assert_eq!(store.service_secret([1; 32]).await.unwrap(), [1; 32]);
    assert_eq!(store.service_secret([2; 32]).await.unwrap(), [1; 32]);
}

pub(super) async fn scenes_and_jobs_have_owners(store: &dyn Store) {
    let (one, two) = (TokenId::from_random([1; 8]), TokenId::from_random([2; 8]));
    let file = StoredFile { name: "a.obj".into(), blob: blob("obj") };
    let mut scenes = Vec::new();
    for owner in [None, Some(one), Some(two)] {
        let id = Uuid::now_v7();
        let row =
            store.add_scene(id, std::slice::from_ref(&file), &kiln_proto::options::ImportOptions::default(), owner, NOW).await.unwrap();
        assert_eq!(row.owner, owner);
        scenes.push(id);
        // The same canonical scene for all: its hash leads each to the own upload only.
        let result =
            TaskResult::Imported { scene: SceneHash::of(b"s"), canonical: blob("canonical"), statistics: statistics(), warnings: vec![] };
        perform(store, Task::Import(id), &result).await;
    }
    for (scope, expected) in
        [(Scope::All, Some(scenes[0])), (Scope::Own(one), Some(scenes[1])), (Scope::Own(two), Some(scenes[2])), (Scope::Nothing, None)]
    {
        let found = store.scene_by_hash(SceneHash::of(b"s"), scope).await.unwrap();
        assert_eq!(found.map(|row| row.record.id), expected, "{scope:?}");
    }
    let mut jobs = Vec::new();
    for owner in [None, Some(one), Some(two), Some(one)] {
        let job = store.add_job(&JobSpec { owner, ..spec(scenes[1], 0) }, NOW).await.unwrap();
        assert_eq!((job.spec.owner, store.job_owner(job.spec.id).await.unwrap()), (owner, Some(owner)));
        jobs.push(job.spec.id);
    }
    assert_eq!(store.job_owner(JobId::random()).await.unwrap(), None);
    let listed = async |scope: Scope| {
        let mut ids: Vec<JobId> =
            store.jobs(&JobFilter { scope, ..JobFilter::default() }).await.unwrap().iter().map(|j| j.spec.id).collect();
        ids.sort_by_key(|id| jobs.iter().position(|other| other == id));
        ids
    };
    assert_eq!(listed(Scope::All).await, jobs);
    assert_eq!(listed(Scope::Own(one)).await, [jobs[1], jobs[3]]);
    assert_eq!(listed(Scope::Own(two)).await, [jobs[2]]);
    assert_eq!(listed(Scope::Nothing).await, []);
}
