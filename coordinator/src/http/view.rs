//! A package in the viewer, served from its folder without a farm: what `kiln view` runs.
//!
//! Only what the manifest names is served, by its name, from a place inside the folder: neither `..` nor a link leads out. The manifest's
//! hashes are the entity tags, as in `assets`; each request looks whether it is still the file that was read, so that a browser is not told
//! to keep what was baked anew. Hashing the files themselves would read gigabytes to say the same. Any static web server can do the same
//! for an exported viewer; this one needs no setting up, sends the same headers as the service and admits the same hosts.

use super::{
    HostPolicy,
    assets::{REVALIDATE, head, whole},
    catalogue::Kind,
    conditional::strong_etag,
    extract::Path,
    layers, page,
    problem::{Answer, Failure},
};
use crate::records::PackageFile;
use axum::{
    Router,
    body::{Body, Bytes},
    extract::{Request, State},
    http::{HeaderMap, Method, header},
    middleware,
    response::{IntoResponse, Response},
    routing::get,
};
use kiln_proto::{
    chain,
    format::manifest::{self, Manifest, ManifestError, Sha256Hex},
};
use serde::Deserialize;
use std::{
    collections::BTreeMap,
    io::{self, SeekFrom},
    os::unix::fs::MetadataExt,
    path::{Path as FsPath, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::SystemTime,
};
use tokio::{
    io::{AsyncReadExt, AsyncSeekExt},
    net::TcpListener,
};
use tokio_util::{io::ReaderStream, sync::CancellationToken};
use tower_http::catch_panic::CatchPanicLayer;

/// The folder of the package within an exported viewer, and its path under the viewer's page.
pub const PACKAGE_FOLDER: &str = "package";

/// A package to look at.
#[derive(Debug)]
pub struct ViewedPackage {
    /// Without links in it.
    root: PathBuf,
    /// The manifest as it was last read.
    known: Mutex<Arc<Contents>>,
}

/// What a manifest says, and which file said it.
#[derive(Debug)]
struct Contents {
    stamp: Stamp,
    manifest: Bytes,
    files: BTreeMap<String, PackageFile>,
}

/// Tells one state of a file from another: when it was written, how long it is, and which file it is.
type Stamp = (Option<SystemTime>, u64, u64);

/// Why a folder cannot be viewed.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// No manifest where one should be.
    #[error("{} holds no package: there is neither manifest.json nor package/manifest.json in it", .0.display())]
    NoPackage(PathBuf),
    /// More than readers accept.
    #[error("{} has {found} bytes; at most {} are allowed", path.display(), manifest::MAX_BYTES)]
    TooLarge {
        /// The manifest.
        path: PathBuf,
        /// Its length.
        found: u64,
    },
    /// Something that is no manifest of this version.
    #[error("{} is no manifest that this version can read", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Why.
        #[source]
        source: ManifestError,
    },
    /// The disk.
    #[error("{} cannot be read", path.display())]
    Read {
        /// The manifest or its folder.
        path: PathBuf,
        /// Why.
        #[source]
        source: io::Error,
    },
}

impl ViewedPackage {
    /// The package in `folder`, or in the `package` folder of an exported viewer.
    ///
    /// # Errors
    /// A folder without a manifest that can be read.
    pub fn open(folder: &FsPath) -> Result<Self, ViewError> {
        let candidates = [folder.to_owned(), folder.join(PACKAGE_FOLDER)];
        let found = candidates.into_iter().find(|root| root.join(manifest::PATH).is_file());
        let root = found.ok_or_else(|| ViewError::NoPackage(folder.to_owned()))?;
        let root = root.canonicalize().map_err(|source| ViewError::Read { path: root.clone(), source })?;
        let known = Mutex::new(Arc::new(Contents::read(&root)?));
        Ok(Self { root, known })
    }

    /// What the manifest says now. Blocks: asks the disk for one file's times, and reads the file when they have changed.
    fn contents(&self) -> Result<Arc<Contents>, ViewError> {
        // What is behind the lock is replaced whole, or not at all.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if stamp(&self.root.join(manifest::PATH))? != known.stamp {
            *known = Arc::new(Contents::read(&self.root)?);
        }
        Ok(Arc::clone(&known))
    }

    /// Where a file of the package is, if it is inside the folder and as long as the manifest says.
    async fn locate(&self, file: &PackageFile) -> Answer<PathBuf> {
        let gone = || Failure::new(Kind::NotFound, "the file is not in the package's folder as the manifest has it");
        let path = tokio::fs::canonicalize(self.root.join(&file.path)).await.map_err(|_| gone())?;
        let there = tokio::fs::metadata(&path).await.map_err(|_| gone())?;
        let right = path.starts_with(&self.root) && there.is_file() && there.len() == file.bytes;
        if right { Ok(path) } else { Err(gone()) }
    }
}

impl Contents {
    fn read(root: &FsPath) -> Result<Self, ViewError> {
        let path = root.join(manifest::PATH);
        // Taken first: a file that changes while it is read is read again next time.
        let stamp = stamp(&path)?;
        if stamp.1 > manifest::MAX_BYTES {
            return Err(ViewError::TooLarge { path, found: stamp.1 });
        }
        let bytes = std::fs::read(&path).map_err(|source| ViewError::Read { path: path.clone(), source })?;
        let manifest = Manifest::from_bytes(&bytes).map_err(|source| ViewError::Manifest { path, source })?;
        let files = manifest.files.into_iter().map(|file| {
            let entry =
                PackageFile { path: file.path.clone(), media_type: file.media_type, bytes: file.bytes, sha256: file.sha256.to_string() };
            (file.path, entry)
        });
        Ok(Self { stamp, files: files.collect(), manifest: bytes.into() })
    }
}

fn stamp(path: &FsPath) -> Result<Stamp, ViewError> {
    let found = std::fs::metadata(path).map_err(|source| ViewError::Read { path: path.to_owned(), source })?;
    Ok((found.modified().ok(), found.len(), found.ino()))
}

/// Serves the viewer with `package` on `listener` until `shutdown` is cancelled. A loopback listener admits only loopback names.
///
/// # Errors
/// A listener that cannot say its address.
pub async fn serve(listener: TcpListener, package: ViewedPackage, shutdown: CancellationToken) -> io::Result<()> {
    let hosts = if listener.local_addr()?.ip().is_loopback() { HostPolicy::Loopback } else { HostPolicy::Any };
    axum::serve(listener, router(package, hosts)).with_graceful_shutdown(shutdown.cancelled_owned()).await
}

fn router(package: ViewedPackage, hosts: HostPolicy) -> Router {
    Router::new()
        .route("/", get(page::viewer))
        .route("/assets/{*path}", get(page::asset))
        .route("/kiln-viewer.js", get(page::library))
        .route("/package/{*path}", get(file))
        .fallback(async || Failure::new(Kind::NotFound, "nothing is served under this path"))
        .layer(CatchPanicLayer::custom(layers::panicked))
        .layer(middleware::from_fn_with_state(hosts, layers::guard))
        .layer(middleware::map_response(async |mut response: Response| {
            layers::secure(response.headers_mut());
            response
        }))
        .with_state(Arc::new(package))
}

/// The path within the package.
#[derive(Debug, Deserialize)]
struct FilePath {
    path: String,
}

async fn file(State(package): State<Arc<ViewedPackage>>, Path(FilePath { path }): Path<FilePath>, request: Request) -> Answer<Response> {
    let viewed = Arc::clone(&package);
    let contents = tokio::task::spawn_blocking(move || viewed.contents()).await.map_err(Failure::internal)?;
    let contents =
        contents.map_err(|error| Failure::new(Kind::NotFound, format!("the package is no longer what it was: {}", chain(&error))))?;
    if path == manifest::PATH {
        return send_manifest(&contents, request.headers());
    }
    let named = contents.files.get(&path);
    let file = named.ok_or_else(|| Failure::new(Kind::NotFound, "the manifest names no file of this path"))?;
    let place = package.locate(file).await?;
    let (status, headers, range) = head(file, REVALIDATE, request.headers())?;
    let body = match range {
        Some(range) if request.method() != Method::HEAD => {
            let mut opened = tokio::fs::File::open(place).await.map_err(Failure::internal)?;
            opened.seek(SeekFrom::Start(range.start)).await.map_err(Failure::internal)?;
            Body::from_stream(ReaderStream::new(opened.take(range.end - range.start)))
        }
        _ => Body::empty(),
    };
    Ok((status, headers, body).into_response())
}

fn send_manifest(contents: &Contents, asked: &HeaderMap) -> Answer<Response> {
    let etag = strong_etag(&Sha256Hex::of(&contents.manifest).to_string());
    Ok(match whole(&etag, REVALIDATE, asked)? {
        Ok(headers) => (headers, [(header::CONTENT_TYPE, "application/json")], contents.manifest.clone()).into_response(),
        Err(held) => held,
    })
}
