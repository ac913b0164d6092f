//! Who is it that calls? Tokens and sessions against the store, remembered for two seconds.
//!
//! A worker farm asks ten thousand times a second; a look into the store for each would cost more than the call. Two seconds is how long a
//! revoked token may still be believed. Only tokens that exist are remembered, so that made-up ids fill nothing.

use super::{
    Keys, Principal, Roles, Session, TokenId, TokenRow,
    token::{Invalid, Presented},
};
use crate::{
    engine::Clock,
    records::UnixMillis,
    store::{StoreError, TokenStore},
};
use kiln_proto::ids::Digest;
use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicI64, Ordering},
    },
};
use tokio::sync::OnceCell;

/// How long what the store said is believed, milliseconds.
const FRESH_MS: i64 = 2_000;
/// How exactly the last use of a token is kept, milliseconds.
const USE_MS: i64 = 60_000;

/// A token that was found good.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Known {
    /// Which.
    pub id: TokenId,
    /// What a person calls it.
    pub name: String,
    /// What it is for.
    pub roles: Roles,
    /// From when it is worth nothing.
    pub expires_ms: Option<UnixMillis>,
    hash: Digest,
}

impl Known {
    /// As a caller.
    #[must_use]
    pub fn principal(&self) -> Principal {
        Principal::Token { id: self.id, roles: self.roles }
    }
}

/// Asks a store who it is that calls.
pub struct Verifier {
    store: Arc<dyn TokenStore>,
    clock: Clock,
    keys: OnceCell<Keys>,
    rows: Mutex<HashMap<TokenId, (TokenRow, UnixMillis)>>,
    /// Tokens exist. Never false again once it is true.
    closed: AtomicBool,
    /// When that was last asked.
    asked: AtomicI64,
}

impl Verifier {
    /// Over a store.
    #[must_use]
    pub fn new(store: Arc<dyn TokenStore>, clock: Clock) -> Self {
        let asked = AtomicI64::new(i64::MIN);
        Self { store, clock, keys: OnceCell::new(), rows: Mutex::default(), closed: AtomicBool::new(false), asked }
    }

    /// The time by the store's clock.
    #[must_use]
    pub fn now(&self) -> UnixMillis {
        (self.clock)()
    }

    /// Whether any token was ever made, so that every call needs one.
    ///
    /// # Errors
    /// A failing store.
    pub async fn is_closed(&self) -> Result<bool, StoreError> {
        let now = self.now();
        if !self.closed.load(Ordering::Relaxed) && !fresh(self.asked.load(Ordering::Relaxed), now) {
            self.closed.store(self.store.has_tokens().await?, Ordering::Relaxed);
            self.asked.store(now, Ordering::Relaxed);
        }
        Ok(self.closed.load(Ordering::Relaxed))
    }

    /// Whether this token was found good a moment ago: no store needs to be asked.
    #[must_use]
    pub fn remembers(&self, presented: &Presented) -> bool {
        let now = self.now();
        self.remembered(presented.id, now).is_some_and(|row| row.accept(presented, now).is_ok())
    }

    /// The holder of a token.
    ///
    /// # Errors
    /// The outer error is a failing store, the inner one says why the token gives no access.
    pub async fn token(&self, presented: &Presented) -> Result<Result<Known, Invalid>, StoreError> {
        let now = self.now();
        let Some(row) = self.row(presented.id, now).await? else { return Ok(Err(Invalid::Unknown)) };
        match row.accept(presented, now) {
            Ok(()) => Ok(Ok(self.used(row, now).await?)),
            Err(why) => Ok(Err(why)),
        }
    }

    /// The holder of a session.
    ///
    /// # Errors
    /// As [`Verifier::token`].
    pub async fn session(&self, session: &Session) -> Result<Result<Known, Invalid>, StoreError> {
        let now = self.now();
        let Some(row) = self.row(session.token, now).await? else { return Ok(Err(Invalid::Unknown)) };
        if !self.keys().await?.is_open(session, row.hash, now / 1_000) {
            return Ok(Err(Invalid::Expired));
        }
        match row.check(now) {
            Ok(()) => Ok(Ok(self.used(row, now).await?)),
            Err(why) => Ok(Err(why)),
        }
    }

    /// Whether a token that was found good still is, for what goes on for long after it was presented.
    ///
    /// # Errors
    /// A failing store.
    pub async fn is_live(&self, id: TokenId) -> Result<bool, StoreError> {
        let now = self.now();
        Ok(self.row(id, now).await?.is_some_and(|row| row.check(now).is_ok()))
    }

    /// Opens a session for the holder of a token, `length_s` seconds long, but not longer than the token lives.
    ///
    /// # Errors
    /// A failing store.
    pub async fn open_session(&self, known: &Known, length_s: i64) -> Result<Session, StoreError> {
        let end = self.now() / 1_000 + length_s;
        let end = known.expires_ms.map_or(end, |at| end.min(at / 1_000));
        Ok(self.keys().await?.open_session(known.id, known.hash, end))
    }

    /// The keys of the service.
    ///
    /// # Errors
    /// A failing store.
    pub async fn keys(&self) -> Result<&Keys, StoreError> {
        let make = async || {
            let fresh = super::random().map_err(|e| StoreError::Row { expected: "random bytes for the secret", found: e.to_string() })?;
            Ok(Keys::of(&self.store.service_secret(fresh).await?))
        };
        self.keys.get_or_try_init(make).await
    }

    async fn row(&self, id: TokenId, now: UnixMillis) -> Result<Option<TokenRow>, StoreError> {
        if let Some(row) = self.remembered(id, now) {
            return Ok(Some(row));
        }
        let found = self.store.token(id).await?;
        if let Some(row) = &found {
            self.rows().insert(id, (row.clone(), now));
        }
        Ok(found)
    }

    fn remembered(&self, id: TokenId, now: UnixMillis) -> Option<TokenRow> {
        self.rows().get(&id).filter(|(_, at)| fresh(*at, now)).map(|(row, _)| row.clone())
    }

    fn rows(&self) -> MutexGuard<'_, HashMap<TokenId, (TokenRow, UnixMillis)>> {
        // Nothing behind the lock can be left half done by a panic.
        self.rows.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes the use of a good token, at most once a minute.
    async fn used(&self, mut row: TokenRow, now: UnixMillis) -> Result<Known, StoreError> {
        if row.used_ms.is_none_or(|at| now - at >= USE_MS) {
            row.used_ms = Some(now);
            // Remembered first: others that use the same token meanwhile need not write the same.
            self.rows().insert(row.id, (row.clone(), now));
            if let Err(error) = self.store.touch_token(row.id, now).await {
                tracing::warn!(%error, token = %row.id, "the use of a token could not be noted"); // No reason to refuse it.
            }
        }
        Ok(Known { id: row.id, name: row.name, roles: row.roles, expires_ms: row.expires_ms, hash: row.hash })
    }
}

/// Whether what was heard at `at` is still believed. A clock that was set back makes nothing fresh for ever.
fn fresh(at: UnixMillis, now: UnixMillis) -> bool {
    at <= now && now.saturating_sub(at) < FRESH_MS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{auth::Desk, auth::Role, store::SqlStore};
    use tempfile::TempDir;

    struct Rig {
        _dir: TempDir,
        time: Arc<AtomicI64>,
        store: Arc<SqlStore>,
        desk: Desk,
        verifier: Verifier,
    }

    async fn rig() -> Rig {
        let dir = TempDir::new().unwrap();
        let store = Arc::new(SqlStore::sqlite(&dir.path().join("kiln.db")).await.unwrap());
        let time = Arc::new(AtomicI64::new(1_000_000));
        let clock: Clock = Arc::new({
            let time = Arc::clone(&time);
            move || time.load(Ordering::Relaxed)
        });
        let verifier = Verifier::new(store.clone(), clock);
        Rig { _dir: dir, time, desk: Desk::new(store.clone()), store, verifier }
    }

    impl Rig {
        fn pass(&self, ms: i64) {
            self.time.fetch_add(ms, Ordering::Relaxed);
        }
    }

    #[tokio::test]
    async fn a_revoked_token_is_believed_for_two_seconds_at_most() {
        let rig = rig().await;
        let made = rig.desk.create("x", Roles::of(&[Role::Read]), Some(1_100_000), 0).await.unwrap();
        let presented = Presented::parse(made.text.expose()).unwrap();
        let known = rig.verifier.token(&presented).await.unwrap().unwrap();
        assert_eq!(known.principal(), Principal::Token { id: made.row.id, roles: Roles::of(&[Role::Read]) });
        assert!(rig.verifier.remembers(&presented));
        rig.desk.revoke(made.row.id, 0).await.unwrap();
        rig.pass(FRESH_MS);
        assert!(!rig.verifier.remembers(&presented));
        assert_eq!(rig.verifier.token(&presented).await.unwrap(), Err(Invalid::Revoked));
    }

    #[tokio::test]
    async fn another_secret_and_another_id_are_unknown_and_time_runs_out() {
        let rig = rig().await;
        let made = rig.desk.create("x", Roles::ALL, Some(1_100_000), 0).await.unwrap();
        let presented = Presented::parse(made.text.expose()).unwrap();
        let wrong = Presented { hash: Digest::of(b"guess"), ..presented };
        let nobody = Presented { id: TokenId::from_random([3; 8]), ..presented };
        for bad in [wrong, nobody] {
            assert_eq!(rig.verifier.token(&bad).await.unwrap(), Err(Invalid::Unknown));
        }
        assert!(rig.verifier.token(&presented).await.unwrap().is_ok());
        rig.pass(100_000);
        assert_eq!(rig.verifier.token(&presented).await.unwrap(), Err(Invalid::Expired));
    }

    #[tokio::test]
    async fn the_last_use_is_noted_once_a_minute() {
        let rig = rig().await;
        let made = rig.desk.create("x", Roles::ALL, None, 0).await.unwrap();
        let presented = Presented::parse(made.text.expose()).unwrap();
        let mut noted = Vec::new();
        for _ in 0..5 {
            rig.verifier.token(&presented).await.unwrap().unwrap();
            noted.push(rig.store.token(made.row.id).await.unwrap().unwrap().used_ms.unwrap());
            rig.pass(30_000);
        }
        assert_eq!(noted, [1_000_000, 1_000_000, 1_060_000, 1_060_000, 1_120_000]);
    }

    #[tokio::test]
    async fn the_first_token_closes_the_service_and_nothing_opens_it_again() {
        let rig = rig().await;
        assert!(!rig.verifier.is_closed().await.unwrap());
        let made = rig.desk.create("x", Roles::ALL, None, 0).await.unwrap();
        rig.pass(FRESH_MS);
        assert!(rig.verifier.is_closed().await.unwrap());
        rig.desk.revoke(made.row.id, 0).await.unwrap();
        rig.pass(FRESH_MS);
        assert!(rig.verifier.is_closed().await.unwrap());
    }

    #[tokio::test]
    async fn a_session_lives_as_long_as_its_token_and_its_time() {
        let rig = rig().await;
        let made = rig.desk.create("x", Roles::ALL, Some(1_050_000), 0).await.unwrap();
        let known = rig.verifier.token(&Presented::parse(made.text.expose()).unwrap()).await.unwrap().unwrap();
        let session = rig.verifier.open_session(&known, 3_600).await.unwrap();
        assert_eq!(session.expires_s, 1_050, "not longer than the token");
        let short = rig.verifier.open_session(&known, 10).await.unwrap();
        assert_eq!(rig.verifier.session(&short).await.unwrap(), Ok(known));
        rig.pass(10_000);
        assert_eq!(rig.verifier.session(&short).await.unwrap(), Err(Invalid::Expired));
        assert!(rig.verifier.session(&session).await.unwrap().is_ok());
        rig.desk.rotate(made.row.id).await.unwrap();
        rig.pass(FRESH_MS);
        assert_eq!(rig.verifier.session(&session).await.unwrap(), Err(Invalid::Expired), "another secret, another session");
        // Another coordinator on the same store signs with the same keys.
        let other = Verifier::new(rig.store.clone(), Arc::new(|| 1_000_000));
        let again = other.keys().await.unwrap().open_session(made.row.id, Digest::of(b"x"), 2_000);
        assert!(rig.verifier.keys().await.unwrap().is_open(&again, Digest::of(b"x"), 1_000));
    }
}
