//! What the configuration says of webhooks.

use super::place::Place;
use crate::records::Problem;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Webhooks: where they may go, and what they are signed with.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WebhookConfig {
    /// `HOST` (at the scheme's own port) or `HOST:PORT`; nowhere where nothing is said.
    pub allow: Vec<String>,
    /// A file with the secret of the signatures: `whsec_` and 24 to 64 bytes in base64. Needed where anything is allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub secret_file: Option<PathBuf>,
}

impl WebhookConfig {
    /// Every problem with these values.
    #[must_use]
    pub fn check(&self) -> Vec<Problem> {
        let bad = self.allow.iter().filter_map(|text| text.parse::<Place>().err());
        let mut problems: Vec<Problem> = bad.map(|bad| Problem::new(bad.to_string())).collect();
        if !self.allow.is_empty() && self.secret_file.is_none() {
            problems.push(Problem::new("webhooks.secret_file: webhooks are signed; give a file with a secret (--webhook-secret-file)"));
        }
        problems
    }
}
