//! How a package is compressed, and what is kept beside it.

use serde::{Deserialize, Serialize};
use std::fmt;

/// How a package is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Codec {
    /// Piecewise linear segments along the directions of a texel: the thesis's file set.
    #[default]
    Pwl,
}

/// How `pwl` picks the samples it keeps, with the parameter of each rule. Radiance is coded to 8 bits first; errors are in those levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "rule", deny_unknown_fields)]
pub enum Rule {
    /// The thesis's pseudo-code (7.2.4): bounds the change of slope, not the error.
    Thesis {
        /// T.
        threshold: u16,
    },
    /// The longest segment in which every skipped sample's summed error stays below T (its chapter 8).
    Cumulative {
        /// T.
        threshold: u16,
    },
    /// A swing filter: no sample and channel differs by more than eps.
    Bounded {
        /// The largest error.
        eps: u8,
    },
}

impl Default for Rule {
    fn default() -> Self {
        Rule::Bounded { eps: 2 }
    }
}

impl fmt::Display for Rule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Rule::Thesis { threshold } => write!(f, "thesis T={threshold}"),
            Rule::Cumulative { threshold } => write!(f, "cumulative T={threshold}"),
            Rule::Bounded { eps } => write!(f, "bounded eps={eps}"),
        }
    }
}

/// The name of a rule, without its parameter, as settings give it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RuleName {
    /// See [`Rule::Thesis`].
    Thesis,
    /// See [`Rule::Cumulative`].
    Cumulative,
    /// See [`Rule::Bounded`].
    #[default]
    Bounded,
}

/// Uncompressed radiance kept beside the compressed files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RawFormat {
    /// 8 bits a channel, coded with the job's exposure.
    U8,
    /// 32-bit linear radiance.
    F32,
}
