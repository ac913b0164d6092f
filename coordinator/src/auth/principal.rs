//! Who calls, and whose things that caller may touch.

use super::{Role, Roles, TokenId};
use std::fmt;

/// Who calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Principal {
    /// Nobody that is known.
    Anonymous,
    /// Whoever reaches a service that asks for no tokens: the person at this machine, with full rights.
    Local,
    /// A holder of a token, or of a session that was opened with it.
    Token {
        /// Which token.
        id: TokenId,
        /// What it is for.
        roles: Roles,
    },
    /// A worker that the service started itself.
    OwnWorker,
    /// Someone with a signed link to this one file.
    Link,
}

/// Whose scenes and jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scope {
    /// Everybody's.
    #[default]
    All,
    /// Those that a token brought.
    Own(TokenId),
    /// Nobody's.
    Nothing,
}

impl Scope {
    /// Whether something of this owner is within it. What nobody owns was brought while the service asked for no tokens.
    #[must_use]
    pub fn covers(self, owner: Option<TokenId>) -> bool {
        match self {
            Scope::All => true,
            Scope::Own(id) => owner == Some(id),
            Scope::Nothing => false,
        }
    }
}

impl Principal {
    /// What it may be used for.
    #[must_use]
    pub fn roles(&self) -> Roles {
        match self {
            Principal::Anonymous | Principal::Link => Roles::NONE,
            Principal::Local => Roles::ALL,
            Principal::Token { roles, .. } => *roles,
            Principal::OwnWorker => Roles::of(&[Role::Worker]),
        }
    }

    /// Whose the scenes and jobs are that it brings.
    #[must_use]
    pub fn owner(&self) -> Option<TokenId> {
        match self {
            Principal::Token { id, .. } => Some(*id),
            _ => None,
        }
    }

    /// What it may look at.
    #[must_use]
    pub fn sees(&self) -> Scope {
        self.scope(Roles::of(&[Role::Read, Role::Admin]))
    }

    /// What it may change.
    #[must_use]
    pub fn changes(&self) -> Scope {
        self.scope(Roles::of(&[Role::Admin]))
    }

    /// Everything for the roles in `all`, its own for a token that submits.
    fn scope(&self, all: Roles) -> Scope {
        match self {
            _ if self.roles().meets(all) => Scope::All,
            Principal::Token { id, roles } if roles.has(Role::Submit) => Scope::Own(*id),
            _ => Scope::Nothing,
        }
    }
}

/// As logs name it.
impl fmt::Display for Principal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Principal::Anonymous => f.write_str("anonymous"),
            Principal::Local => f.write_str("local"),
            Principal::Token { id, .. } => write!(f, "token:{id}"),
            Principal::OwnWorker => f.write_str("own-worker"),
            Principal::Link => f.write_str("link"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn token(roles: &[Role]) -> Principal {
        Principal::Token { id: TokenId::from_random([1; 8]), roles: Roles::of(roles) }
    }

    #[test]
    fn submitters_have_their_own_readers_see_all_admins_change_all() {
        let own = Scope::Own(TokenId::from_random([1; 8]));
        for (principal, sees, changes) in [
            (Principal::Local, Scope::All, Scope::All),
            (token(&[Role::Admin]), Scope::All, Scope::All),
            (token(&[Role::Read]), Scope::All, Scope::Nothing),
            (token(&[Role::Submit]), own, own),
            (token(&[Role::Submit, Role::Read]), Scope::All, own),
            (token(&[Role::Worker]), Scope::Nothing, Scope::Nothing),
            (Principal::OwnWorker, Scope::Nothing, Scope::Nothing),
            (Principal::Link, Scope::Nothing, Scope::Nothing),
            (Principal::Anonymous, Scope::Nothing, Scope::Nothing),
        ] {
            assert_eq!((principal.sees(), principal.changes()), (sees, changes), "{principal}");
        }
    }

    #[test]
    fn what_nobody_owns_is_for_those_who_see_all() {
        let (one, other) = (TokenId::from_random([1; 8]), TokenId::from_random([2; 8]));
        assert!(Scope::All.covers(None) && Scope::All.covers(Some(one)));
        assert!(Scope::Own(one).covers(Some(one)) && !Scope::Own(one).covers(Some(other)) && !Scope::Own(one).covers(None));
        assert!(!Scope::Nothing.covers(None) && !Scope::Nothing.covers(Some(one)));
    }
}
