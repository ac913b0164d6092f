//! How a command says who it is to a coordinator: the same flags for every command that talks to one.

use clap::Args;
use kiln_proto::secret::Secret;
use kiln_worker::config::Access;
use reqwest::Url;
use std::{net::IpAddr, path::PathBuf};

/// Access to a coordinator.
#[derive(Debug, Clone, Default, Args)]
pub struct AccessArgs {
    /// An access token. Better in the environment: command lines are visible to everyone on the machine
    #[arg(long, env = "KILN_TOKEN", hide_env_values = true)]
    token: Option<Secret>,
    /// A certificate (PEM) that vouches for the coordinator's, beside those that the system trusts
    #[arg(long, value_name = "FILE", env = "KILN_CA")]
    ca: Option<PathBuf>,
}

impl AccessArgs {
    /// As clients take it. A token that travels unencrypted to another machine is worth a warning.
    pub fn to(&self, server: &str) -> Access {
        // An empty variable is how scripts say that there is none.
        let token = self.token.clone().filter(|token| !token.expose().is_empty());
        if token.is_some() && is_exposed(server) {
            tracing::warn!("the access token travels to {server} unencrypted: use an https:// address, or a tunnel");
        }
        Access { token, ca: self.ca.clone() }
    }
}

/// The address of a coordinator as people write it: `http://` where no scheme stands.
pub fn address(text: &str) -> String {
    let whole = if text.contains("://") { text.to_owned() } else { format!("http://{text}") };
    whole.trim_end_matches('/').to_owned()
}

/// Whether what is sent there can be read on the way.
fn is_exposed(server: &str) -> bool {
    let Some(url) = Url::parse(server).ok().filter(|url| url.scheme() == "http") else { return false };
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    host != "localhost" && !host.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_completed() {
        assert_eq!(address("127.0.0.1:8080"), "http://127.0.0.1:8080");
        assert_eq!(address("https://bake.example/kiln/"), "https://bake.example/kiln");
    }

    #[test]
    fn only_plain_addresses_elsewhere_expose_what_is_sent() {
        for sent in
            ["http://bake.example:8080", "http://10.0.0.1", "http://localhost.example", "http://127.example", "http://[2001:db8::1]:1"]
        {
            assert!(is_exposed(sent), "{sent}");
        }
        for kept in ["https://bake.example", "http://127.0.0.1:8080", "http://localhost", "http://[::1]:1"] {
            assert!(!is_exposed(kept), "{kept}");
        }
    }
}
