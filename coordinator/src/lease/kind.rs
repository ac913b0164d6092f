//! What an attempt is for.

use kiln_proto::ids::Token;

/// What an attempt is for. Its worker is not told: whoever knew that it checks another could lie where nobody checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Tiles that nobody has baked.
    Work,
    /// Tiles that another attempt, this one, is late with (see [`Field`](super::Field)).
    Twin(Token),
    /// One tile that is done, to compare the bytes (see [`Checks`](super::Checks)).
    Check,
}

impl Kind {
    /// Its name, as stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Kind::Work => "work",
            Kind::Twin(_) => "twin",
            Kind::Check => "check",
        }
    }

    /// The attempt that it is a twin of.
    #[must_use]
    pub fn twin_of(self) -> Option<Token> {
        if let Kind::Twin(of) = self { Some(of) } else { None }
    }
}
