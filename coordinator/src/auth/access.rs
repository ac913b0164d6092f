//! What a route is for, and whether a caller may use it: a pure table.
//!
//! Every route of the table of routes carries one [`Access`]. What is not in the table is for nobody who has not said who they are.

use super::{Principal, Role, Roles, Scope};

/// What a route is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Health, the page's static files, logging in: for everyone, because it tells nothing of the farm.
    Public,
    /// Looking: lists and documents. What is shown is filtered by [`Principal::sees`].
    Look,
    /// Looking at the job in the path.
    LookAtJob,
    /// Fetching files of the job in the path, for which there are signed links too.
    Package,
    /// Bringing scenes and jobs.
    Submit,
    /// Changing the job in the path.
    ChangeJob,
    /// Figures about the whole farm.
    Operate,
    /// The worker protocol.
    Work,
}

/// Whether a caller may.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Yes.
    Allow,
    /// Not before saying who it is.
    Authenticate,
    /// No: none of its roles is for this.
    Forbid,
}

impl Access {
    /// The roles of which one is needed. Empty for what is public.
    #[must_use]
    pub const fn roles(self) -> Roles {
        match self {
            Access::Public => Roles::NONE,
            Access::Look | Access::LookAtJob | Access::Package => Roles::of(&[Role::Submit, Role::Read, Role::Admin]),
            Access::Submit | Access::ChangeJob => Roles::of(&[Role::Submit, Role::Admin]),
            Access::Operate => Roles::of(&[Role::Read, Role::Admin]),
            Access::Work => Roles::of(&[Role::Worker]),
        }
    }

    /// Whose jobs the caller may name in the path; `None` where the path names no job.
    #[must_use]
    pub fn jobs(self, principal: &Principal) -> Option<Scope> {
        match (self, principal) {
            // The signature is for the path of one job.
            (Access::Package, Principal::Link) => Some(Scope::All),
            (Access::LookAtJob | Access::Package, _) => Some(principal.sees()),
            (Access::ChangeJob, _) => Some(principal.changes()),
            (Access::Public | Access::Look | Access::Submit | Access::Operate | Access::Work, _) => None,
        }
    }
}

/// Whether `principal` may use a route; `None` is a path or method that does not exist, which is told only to those who are known.
#[must_use]
pub fn decide(access: Option<Access>, principal: &Principal) -> Verdict {
    match (access, principal) {
        (Some(Access::Public), _) | (_, Principal::Local) | (Some(Access::Package), Principal::Link) => Verdict::Allow,
        (_, Principal::Anonymous | Principal::Link) => Verdict::Authenticate,
        (None, _) => Verdict::Allow,
        (Some(access), _) if principal.roles().meets(access.roles()) => Verdict::Allow,
        (Some(_), _) => Verdict::Forbid,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auth::TokenId;

    #[test]
    fn links_open_files_of_a_package_and_nothing_else() {
        assert_eq!(decide(Some(Access::Package), &Principal::Link), Verdict::Allow);
        for access in [Access::Look, Access::LookAtJob, Access::Submit, Access::ChangeJob, Access::Operate, Access::Work] {
            assert_eq!(decide(Some(access), &Principal::Link), Verdict::Authenticate, "{access:?}");
        }
    }

    #[test]
    fn what_does_not_exist_is_told_only_to_those_who_are_known() {
        assert_eq!(decide(None, &Principal::Anonymous), Verdict::Authenticate);
        let worker = Principal::Token { id: TokenId::from_random([0; 8]), roles: Roles::of(&[Role::Worker]) };
        assert_eq!(decide(None, &worker), Verdict::Allow);
    }

    #[test]
    fn a_token_without_roles_may_do_what_everyone_may() {
        let nobody = Principal::Token { id: TokenId::from_random([0; 8]), roles: Roles::NONE };
        assert_eq!(decide(Some(Access::Public), &nobody), Verdict::Allow);
        assert_eq!(decide(Some(Access::Look), &nobody), Verdict::Forbid);
    }
}
