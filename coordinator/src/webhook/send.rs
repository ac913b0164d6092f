//! One try to send a message.

use super::{Webhooks, place};
use crate::crypto;
use kiln_proto::chain;
use reqwest::{
    Client, StatusCode, Url,
    header::{CONTENT_TYPE, USER_AGENT},
    redirect::Policy,
};
use std::time::Duration;

/// How long a receiver may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// A message that was not taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Undelivered {
    /// Why, without the address: it may hold a secret.
    pub(crate) why: String,
    /// The receiver said that it wants no more.
    pub(crate) for_good: bool,
}

impl Undelivered {
    /// What another try may mend.
    pub(crate) fn for_now(why: impl Into<String>) -> Self {
        Self { why: why.into(), for_good: false }
    }
}

impl Webhooks {
    /// Sends a message with its signature. It is taken when the answer is a success; nothing of the answer but its status is read.
    ///
    /// # Errors
    /// An address that is not allowed (any more), a receiver that cannot be reached, is slow, redirects or refuses.
    pub(crate) async fn send(&self, address: &str, id: &str, timestamp_s: i64, body: Vec<u8>) -> Result<(), Undelivered> {
        let (url, secret) = self.ready(address).map_err(|bad| Undelivered::for_now(bad.to_string()))?;
        let host = place::of(&url);
        let client = client(&url).map_err(|error| Undelivered::for_now(format!("no client can be made: {}", chain(&error))))?;
        let request = client
            .post(url)
            .header(CONTENT_TYPE, "application/json")
            .header(USER_AGENT, concat!("kiln/", env!("CARGO_PKG_VERSION")))
            .header("webhook-id", id)
            .header("webhook-timestamp", timestamp_s)
            .header("webhook-signature", secret.sign(id, timestamp_s, &body));
        match request.body(body).send().await {
            Ok(response) if response.status().is_success() => Ok(()),
            Ok(response) => {
                let status = response.status();
                Err(Undelivered { why: format!("{host} answered {status}"), for_good: status == StatusCode::GONE })
            }
            Err(error) => Err(Undelivered::for_now(format!("{host} did not answer: {}", chain(&error.without_url())))),
        }
    }
}

/// A client for one message: they are few, and no connection waits for the next.
fn client(url: &Url) -> reqwest::Result<Client> {
    crypto::choose();
    let client = Client::builder().timeout(PATIENCE).redirect(Policy::none());
    // A machine without root certificates could not even speak HTTP otherwise.
    if url.scheme() == "http" { client.tls_certs_only([]).build() } else { client.build() }
}
