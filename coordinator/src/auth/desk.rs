//! Where tokens are made, listed, rotated and taken back.
//!
//! It works on a store, whether a service runs on it or not: `kiln token` opens the database beside a running coordinator, which asks its
//! store again every few seconds. No call of the API makes tokens: whoever may write to the data folder is the one who decides.

use super::{
    NoRandomness, Principal, Roles, TokenId, TokenRow,
    audit::{self, Action},
    token::{mint, random},
};
use crate::{
    config::Config,
    records::UnixMillis,
    store::{SqlStore, StoreError, TokenStore},
};
use kiln_proto::{ids::Digest, limits, secret::Secret};
use std::sync::Arc;

/// Why a token was not made or found.
#[derive(Debug, thiserror::Error)]
pub enum DeskError {
    /// The folder cannot be created.
    #[error("the data folder {} cannot be created", path.display())]
    Folder {
        /// The folder.
        path: std::path::PathBuf,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// There is no such token, or it was revoked before.
    #[error("there is no token {0} that could still be used; `kiln token list` shows them")]
    NoSuchToken(TokenId),
    /// A token that could do nothing.
    #[error("a token needs at least one role: submit, read, worker or admin")]
    NoRoles,
    /// Names are for lists.
    #[error("the name of a token has 1 to {} bytes and no control characters", limits::NAME_BYTES)]
    BadName,
    /// A token that is over before it begins.
    #[error("the token would have expired already")]
    NoTime,
    /// No secret can be made.
    #[error("no secret can be made")]
    Random(#[from] NoRandomness),
    /// The store failed.
    #[error("the store of tokens failed")]
    Store(#[from] StoreError),
}

/// A token that was just made: the only moment at which its text is known.
pub struct Minted {
    /// What is stored.
    pub row: TokenRow,
    /// What its holder presents.
    pub text: Secret,
}

/// Makes tokens and takes them back.
pub struct Desk {
    store: Arc<dyn TokenStore>,
}

impl Desk {
    /// Over a store.
    #[must_use]
    pub fn new(store: Arc<dyn TokenStore>) -> Self {
        Self { store }
    }

    /// Over the store that a configuration names: a database, or a data folder, which is created where it is missing.
    ///
    /// # Errors
    /// A folder or a database that cannot be used.
    pub async fn open(config: &Config) -> Result<Self, DeskError> {
        let data = &config.data_dir;
        if config.store.is_none() {
            crate::engine::private_folder(data).map_err(|source| DeskError::Folder { path: data.clone(), source })?;
        }
        Ok(Self::new(Arc::new(SqlStore::open(config.store.as_deref(), data).await?)))
    }

    /// Makes a token.
    ///
    /// # Errors
    /// No role, a name that is none, an end in the past, a failing store.
    pub async fn create(&self, name: &str, roles: Roles, expires_ms: Option<UnixMillis>, now: UnixMillis) -> Result<Minted, DeskError> {
        if roles.is_empty() {
            return Err(DeskError::NoRoles);
        }
        if name.is_empty() || name.len() > limits::NAME_BYTES || name.chars().any(char::is_control) {
            return Err(DeskError::BadName);
        }
        if expires_ms.is_some_and(|at| at <= now) {
            return Err(DeskError::NoTime);
        }
        let id = TokenId::from_random(random()?);
        let text = mint(id, random()?);
        let hash = Digest::of(text.expose().as_bytes());
        let row = TokenRow { id, name: name.to_owned(), roles, hash, created_ms: now, used_ms: None, expires_ms, revoked_ms: None };
        self.store.add_token(&row).await?;
        audit::note(Action::TokenCreated, &Principal::Local, None, &format_args!("{id} ({roles})"));
        Ok(Minted { row, text })
    }

    /// Every token that was ever made, oldest first.
    ///
    /// # Errors
    /// A failing store.
    pub async fn list(&self) -> Result<Vec<TokenRow>, DeskError> {
        Ok(self.store.tokens().await?)
    }

    /// Gives a token a new secret; the old one is worth nothing from then on. What it owns stays its own.
    ///
    /// # Errors
    /// No such token, a failing store.
    pub async fn rotate(&self, id: TokenId) -> Result<Minted, DeskError> {
        let text = mint(id, random()?);
        if !self.store.rotate_token(id, Digest::of(text.expose().as_bytes())).await? {
            return Err(DeskError::NoSuchToken(id));
        }
        audit::note(Action::TokenRotated, &Principal::Local, None, &id);
        let row = self.store.token(id).await?.ok_or(DeskError::NoSuchToken(id))?;
        Ok(Minted { row, text })
    }

    /// Takes a token back, for ever.
    ///
    /// # Errors
    /// No such token, a failing store.
    pub async fn revoke(&self, id: TokenId, now: UnixMillis) -> Result<(), DeskError> {
        if !self.store.revoke_token(id, now).await? {
            return Err(DeskError::NoSuchToken(id));
        }
        audit::note(Action::TokenRevoked, &Principal::Local, None, &id);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auth::{Presented, Role};

    #[tokio::test]
    async fn a_folder_s_tokens_are_made_rotated_and_revoked() {
        let dir = tempfile::tempdir().unwrap();
        let data = dir.path().join("data");
        let config = Config { data_dir: data.clone(), ..Config::default() };
        let desk = Desk::open(&config).await.unwrap();
        let made = desk.create("ci", Roles::of(&[Role::Submit]), Some(900), 5).await.unwrap();
        let old = Presented::parse(made.text.expose()).unwrap();
        assert_eq!(made.row.accept(&old, 6), Ok(()));
        let database = std::fs::read(data.join("kiln.db-wal")).unwrap();
        assert!(!database.windows(20).any(|w| w == &made.text.expose().as_bytes()[16..36]), "only the hash is stored");
        // Another process, as it were.
        let desk = Desk::open(&config).await.unwrap();
        let rotated = desk.rotate(made.row.id).await.unwrap();
        assert!(rotated.row.accept(&old, 6).is_err());
        assert_eq!(rotated.row.accept(&Presented::parse(rotated.text.expose()).unwrap(), 6), Ok(()));
        desk.revoke(made.row.id, 7).await.unwrap();
        assert!(matches!(desk.revoke(made.row.id, 8).await, Err(DeskError::NoSuchToken(_))));
        assert!(matches!(desk.rotate(made.row.id).await, Err(DeskError::NoSuchToken(_))));
        assert_eq!(desk.list().await.unwrap()[0].revoked_ms, Some(7));
    }

    #[tokio::test]
    async fn useless_tokens_are_not_made() {
        let dir = tempfile::tempdir().unwrap();
        let desk = Desk::open(&Config { data_dir: dir.path().to_owned(), ..Config::default() }).await.unwrap();
        let read = Roles::of(&[Role::Read]);
        assert!(matches!(desk.create("x", Roles::NONE, None, 5).await, Err(DeskError::NoRoles)));
        assert!(matches!(desk.create("x", read, Some(5), 5).await, Err(DeskError::NoTime)));
        for name in ["", "a\nb", &"x".repeat(limits::NAME_BYTES + 1)] {
            assert!(matches!(desk.create(name, read, None, 5).await, Err(DeskError::BadName)));
        }
        assert_eq!(desk.list().await.unwrap(), []);
    }
}
