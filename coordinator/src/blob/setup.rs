//! From a [`Location`] to a store that is known to work.
//!
//! Credentials, regions, endpoints and proxies are looked for where the clouds' own tools look: the environment (`AWS_…`, `AZURE_…`,
//! `GOOGLE_…`) and the machine's role. A set-up that is wrong must not be found out by the first chunk of a ten-hour bake, so that
//! everything the farm will do is done once with a small object before the service starts.

use super::{Blobs, Cloud, LocalBlobs, Location, RemoteBlobs, error::is_denied, location::BadLocation};
use crate::crypto;
use futures_util::StreamExt;
use object_store::{
    BackoffConfig, ClientConfigKey, Error, ObjectStore, ObjectStoreExt, PutPayload, RetryConfig,
    aws::{AmazonS3Builder, AmazonS3ConfigKey},
    azure::{AzureConfigKey, MicrosoftAzureBuilder},
    gcp::{GoogleCloudStorageBuilder, GoogleConfigKey},
    path::Path as ObjectPath,
    prefix::PrefixStore,
};
use std::{io, path::PathBuf, sync::Arc, time::Duration};
use uuid::Uuid;

/// A request that takes longer failed: time for a block or a part over a slow line.
const REQUEST: &str = "60 seconds";
/// A connection that takes longer failed.
const CONNECT: &str = "5 seconds";
/// Requests that fail are repeated this often, ...
const RETRIES: usize = 8;
/// ... but not after this long. What then fails is put off by who asked.
const RETRY_FOR: Duration = Duration::from_secs(60);
/// The longest pause between two tries; each is drawn at random below it.
const PAUSE: Duration = Duration::from_secs(5);

/// Why blobs cannot be kept where the configuration says.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The text says no place.
    #[error(transparent)]
    Location(#[from] BadLocation),
    /// A folder that cannot be used.
    #[error("blobs cannot be kept in {}: it cannot be created or written", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
    /// The environment says too little, or something that makes no sense.
    #[error("blobs cannot be kept in {location}: no client can be made for it; check {check}")]
    Client {
        /// The place.
        location: Location,
        /// What to look at.
        check: &'static str,
        /// Why.
        #[source]
        source: Box<Error>,
    },
    /// The store does not do what the farm will ask of it.
    #[error("blobs cannot be kept in {location} (endpoint {endpoint}): {doing} a small object failed; {check}")]
    Probe {
        /// The place.
        location: Location,
        /// Whom was talked to.
        endpoint: String,
        /// What was tried.
        doing: &'static str,
        /// What to look at.
        check: String,
        /// Why.
        #[source]
        source: Box<Error>,
    },
}

/// The blobs at a location, after trying them out.
///
/// # Errors
/// A folder that cannot be written; a bucket that does not exist, does not answer, or does not allow to put, get, list and delete.
pub async fn connect(location: &Location) -> Result<Arc<dyn Blobs>, SetupError> {
    let (cloud, bucket, prefix) = match location {
        Location::Folder(path) => {
            let opened = LocalBlobs::open(path, &path.join("incoming"));
            return Ok(Arc::new(opened.map_err(|source| SetupError::Folder { path: path.clone(), source })?));
        }
        Location::Bucket { cloud, bucket, prefix } => (*cloud, bucket.as_str(), prefix),
    };
    crypto::choose();
    let client = client(cloud, bucket);
    let unmade = |source| SetupError::Client { location: location.clone(), check: settings(cloud), source: Box::new(source) };
    let (store, endpoint) = client.map_err(unmade)?;
    let store: Arc<dyn ObjectStore> = Arc::new(PrefixStore::new(store, prefix.clone()));
    probe(&*store).await.map_err(|(doing, source)| SetupError::Probe {
        location: location.clone(),
        endpoint,
        doing,
        check: advice(cloud, bucket, doing, &source),
        source: Box::new(source),
    })?;
    Ok(Arc::new(RemoteBlobs::new(store)))
}

fn retry() -> RetryConfig {
    let backoff = BackoffConfig { max_backoff: PAUSE, ..BackoffConfig::default() };
    RetryConfig { backoff, max_retries: RETRIES, retry_timeout: RETRY_FOR }
}

/// The time-outs, but for those that the environment gives under the cloud's prefix.
fn timeouts(prefix: &str) -> impl Iterator<Item = (ClientConfigKey, &'static str)> {
    let all = [("TIMEOUT", ClientConfigKey::Timeout, REQUEST), ("CONNECT_TIMEOUT", ClientConfigKey::ConnectTimeout, CONNECT)];
    let unset = all.into_iter().filter(move |(name, ..)| std::env::var_os(format!("{prefix}_{name}")).is_none());
    unset.map(|(_, key, value)| (key, value))
}

/// A client for a bucket, and where it will call.
fn client(cloud: Cloud, bucket: &str) -> Result<(Arc<dyn ObjectStore>, String), Error> {
    match cloud {
        Cloud::S3 => {
            // One object at a time is deleted, and a plain DELETE is what every store that calls itself S3 understands.
            let builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retry()).with_disable_bulk_delete(true);
            let builder = timeouts("AWS").fold(builder, |b, (key, value)| b.with_config(AmazonS3ConfigKey::Client(key), value));
            let said = |key| builder.get_config_value(&key);
            let endpoint = said(AmazonS3ConfigKey::S3Endpoint).or_else(|| said(AmazonS3ConfigKey::Endpoint));
            let region = said(AmazonS3ConfigKey::Region).unwrap_or_else(|| "us-east-1".into());
            let endpoint = endpoint.unwrap_or_else(|| format!("https://s3.{region}.amazonaws.com"));
            Ok((Arc::new(builder.build()?), endpoint))
        }
        Cloud::Google => {
            let builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket).with_retry(retry());
            let builder = timeouts("GOOGLE").fold(builder, |b, (key, value)| b.with_config(GoogleConfigKey::Client(key), value));
            let endpoint = builder.get_config_value(&GoogleConfigKey::BaseUrl).unwrap_or_else(|| "https://storage.googleapis.com".into());
            Ok((Arc::new(builder.build()?), endpoint))
        }
        Cloud::Azure => {
            let builder = MicrosoftAzureBuilder::from_env().with_container_name(bucket).with_retry(retry());
            let builder = timeouts("AZURE").fold(builder, |b, (key, value)| b.with_config(AzureConfigKey::Client(key), value));
            let account = builder.get_config_value(&AzureConfigKey::AccountName).unwrap_or_else(|| "(no account)".into());
            let endpoint = builder.get_config_value(&AzureConfigKey::Endpoint);
            let endpoint = endpoint.unwrap_or_else(|| format!("https://{account}.blob.core.windows.net"));
            Ok((Arc::new(builder.build()?), endpoint))
        }
    }
}

/// Does with a small object whatever will be done with blobs; what failed, and how.
async fn probe(store: &dyn ObjectStore) -> Result<(), (&'static str, Error)> {
    let at = ObjectPath::from(format!("probe/{}", Uuid::new_v4()));
    let content = at.to_string().into_bytes();
    store.put(&at, PutPayload::from(content.clone())).await.map_err(|e| ("storing", e))?;
    let outcome = look_at(store, &at, &content).await;
    // Also where looking failed: it should not stay.
    store.delete(&at).await.map_err(|e| ("deleting", e)).and(outcome)?;
    match store.head(&at).await {
        Err(Error::NotFound { .. }) => Ok(()),
        Ok(_) => Err(("no longer finding", Error::Generic { store: "probe", source: "it was deleted and is still there".into() })),
        Err(e) => Err(("no longer finding", e)),
    }
}

async fn look_at(store: &dyn ObjectStore, at: &ObjectPath, content: &[u8]) -> Result<(), (&'static str, Error)> {
    let found = async { store.get(at).await?.bytes().await }.await.map_err(|e| ("reading", e))?;
    if found != content {
        return Err(("reading", Error::Generic { store: "probe", source: "it is not what was stored".into() }));
    }
    match store.list(Some(&ObjectPath::from("probe"))).next().await {
        Some(Ok(_)) => Ok(()),
        Some(Err(e)) => Err(("listing", e)),
        None => Err(("listing", Error::Generic { store: "probe", source: "it was stored, but is not listed".into() })),
    }
}

/// What of the environment a client is made from.
fn settings(cloud: Cloud) -> &'static str {
    match cloud {
        Cloud::S3 => "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY (or the machine's role), AWS_REGION and AWS_ENDPOINT_URL",
        Cloud::Google => "GOOGLE_SERVICE_ACCOUNT or GOOGLE_APPLICATION_CREDENTIALS (files), or the machine's role",
        Cloud::Azure => "AZURE_STORAGE_ACCOUNT_NAME with AZURE_STORAGE_ACCOUNT_KEY, or AZURE_CLIENT_ID, or the machine's role",
    }
}

fn advice(cloud: Cloud, bucket: &str, doing: &str, error: &Error) -> String {
    let settings = settings(cloud);
    if is_denied(error) && doing == "no longer finding" {
        return format!("without the right to list the bucket {bucket}, a blob that is gone looks like one that is forbidden: grant it");
    }
    if is_denied(error) {
        return format!("check {settings}, and that they may put, get, list and delete in {bucket}");
    }
    if matches!(error, Error::NotFound { .. }) {
        return format!("check that the bucket {bucket} exists there, and {settings}");
    }
    let plain = if cloud == Cloud::S3 { "; an endpoint that begins with http:// also needs AWS_ALLOW_HTTP=true" } else { "" };
    format!("check that the endpoint can be reached and that the bucket {bucket} exists, and {settings}{plain}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use object_store::memory::InMemory;

    #[tokio::test]
    async fn a_store_that_works_passes_and_nothing_stays() {
        let store = InMemory::new();
        probe(&store).await.unwrap();
        assert!(store.list(None).next().await.is_none());
    }

    #[tokio::test]
    async fn a_folder_needs_no_network() {
        let dir = tempfile::tempdir().unwrap();
        let location: Location = format!("file://{}/blobs", dir.path().display()).parse().unwrap();
        connect(&location).await.unwrap();
        std::fs::write(dir.path().join("file"), "").unwrap();
        let location: Location = format!("file://{}/file", dir.path().display()).parse().unwrap();
        let error = connect(&location).await.err().unwrap().to_string();
        assert!(error.contains("/file"), "{error}");
    }

    #[test]
    fn advice_fits_the_failure() {
        let denied = Error::PermissionDenied { path: "p".into(), source: "403".into() };
        let gone = Error::NotFound { path: "p".into(), source: "404".into() };
        let away = Error::Generic { store: "S3", source: "connection refused".into() };
        assert!(advice(Cloud::S3, "b", "storing", &denied).contains("AWS_ACCESS_KEY_ID"));
        assert!(advice(Cloud::Azure, "b", "storing", &denied).contains("AZURE_STORAGE_ACCOUNT_KEY"));
        assert!(advice(Cloud::S3, "b", "no longer finding", &denied).contains("right to list"));
        assert!(advice(Cloud::Google, "b", "storing", &gone).contains("bucket b exists"));
        assert!(advice(Cloud::S3, "b", "storing", &away).contains("AWS_ALLOW_HTTP"));
    }
}
