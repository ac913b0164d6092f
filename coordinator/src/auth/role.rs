//! The four roles of a token, and sets of them.

use serde::{Serialize, Serializer};
use std::{fmt, str::FromStr};

/// What a token is for. A token has one or several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Upload scenes and bake them; sees and touches only what it brought itself.
    Submit,
    /// Look at everything, change nothing.
    Read,
    /// Speak the worker protocol, and nothing else.
    Worker,
    /// Everything but the worker protocol.
    Admin,
}

impl Role {
    /// Every role, in the order in which they are listed.
    pub const ALL: [Role; 4] = [Role::Submit, Role::Read, Role::Worker, Role::Admin];

    /// Its name on the command line, in the store and in answers.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Role::Submit => "submit",
            Role::Read => "read",
            Role::Worker => "worker",
            Role::Admin => "admin",
        }
    }

    const fn bit(self) -> u8 {
        match self {
            Role::Submit => 1,
            Role::Read => 2,
            Role::Worker => 4,
            Role::Admin => 8,
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A text that is no role.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a role; roles are submit, read, worker and admin")]
pub struct BadRole(String);

impl FromStr for Role {
    type Err = BadRole;
    fn from_str(text: &str) -> Result<Self, BadRole> {
        Self::ALL.into_iter().find(|role| role.name() == text).ok_or_else(|| BadRole(text.chars().take(40).collect()))
    }
}

/// A set of roles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Roles(u8);

impl Roles {
    /// No role at all.
    pub const NONE: Roles = Roles(0);
    /// Every role.
    pub const ALL: Roles = Roles::of(&Role::ALL);

    /// A set of these.
    #[must_use]
    pub const fn of(roles: &[Role]) -> Self {
        let (mut bits, mut at) = (0, 0);
        while at < roles.len() {
            bits |= roles[at].bit();
            at += 1;
        }
        Self(bits)
    }

    /// Whether `role` is in the set.
    #[must_use]
    pub const fn has(self, role: Role) -> bool {
        self.0 & role.bit() != 0
    }

    /// Whether the two sets share a role.
    #[must_use]
    pub const fn meets(self, other: Roles) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its roles, in their order.
    pub fn iter(self) -> impl Iterator<Item = Role> {
        Role::ALL.into_iter().filter(move |role| self.has(*role))
    }
}

/// `read,admin`; nothing for the empty set.
impl fmt::Display for Roles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, role) in self.iter().enumerate() {
            write!(f, "{}{role}", if n == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl FromStr for Roles {
    type Err = BadRole;
    fn from_str(text: &str) -> Result<Self, BadRole> {
        let roles: Result<Vec<Role>, BadRole> = text.split(',').filter(|part| !part.is_empty()).map(str::parse).collect();
        Ok(Self::of(&roles?))
    }
}

impl Serialize for Roles {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_seq(self.iter().map(Role::name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_survive_their_text_and_nonsense_is_refused() {
        for bits in 0..16 {
            let set = Roles(bits);
            assert_eq!(set.to_string().parse::<Roles>().unwrap(), set);
            assert_eq!(set.iter().count() as u32, bits.count_ones());
        }
        assert_eq!(Roles::of(&[Role::Admin, Role::Read]).to_string(), "read,admin");
        assert!("read,root".parse::<Roles>().unwrap_err().to_string().contains("`root`"));
    }

    #[test]
    fn sets_meet_where_they_share_a_role() {
        let set = Roles::of(&[Role::Submit, Role::Worker]);
        assert!(set.meets(Roles::of(&[Role::Worker, Role::Admin])));
        assert!(!set.meets(Roles::of(&[Role::Read, Role::Admin])));
        assert!(!Roles::NONE.meets(Roles::ALL));
    }
}
