//! Opening a data folder.
//!
//! ```text
//! DATA/lock       held by the coordinator that owns the folder
//! DATA/kiln.db    the store
//! DATA/blobs/     blobs, unless the configuration keeps them elsewhere
//! DATA/spool/     bodies and scratch on their way; emptied at start
//! ```

use super::{
    Clock, Engine, EngineError, background, clock,
    core::Core,
    ports::{Kiln, Pipeline},
};
use crate::{
    blob::{self, Blobs, LocalBlobs, Location, SetupError},
    config::Config,
    store::{SqlStore, Store},
    webhook::Webhooks,
};
use std::{
    fs::{DirBuilder, File, OpenOptions, TryLockError},
    io,
    os::unix::fs::DirBuilderExt,
    path::Path,
    sync::Arc,
};
use tokio::{sync::Mutex, task::JoinSet};

/// What an engine stands on; [`Engine::open`] takes the usual ones, tests bring their own.
pub struct Parts {
    /// Where state lives.
    pub store: Arc<dyn Store>,
    /// Where bytes live.
    pub blobs: Arc<dyn Blobs>,
    /// What does the work.
    pub pipeline: Arc<dyn Pipeline>,
    /// What time it is.
    pub clock: Clock,
}

impl Parts {
    /// What the configuration says: SQLite and files in the data folder, which exists, or what it names instead.
    ///
    /// # Errors
    /// A folder that cannot be written, a database that cannot be used or reached.
    pub async fn of(config: &Config) -> Result<Self, EngineError> {
        let data = &config.data_dir;
        let store: Arc<dyn Store> = Arc::new(SqlStore::open(config.store.as_deref(), data).await?);
        let blobs: Arc<dyn Blobs> = match &config.blobs {
            Some(place) => blob::connect(&place.parse::<Location>().map_err(SetupError::from)?).await?,
            None => {
                let blobs = LocalBlobs::open(&data.join("blobs"), &data.join("spool"));
                Arc::new(blobs.map_err(|source| unusable(&data.join("blobs"), "creating it", source))?)
            }
        };
        Ok(Self { clock: clock::following(&store).await?, store, blobs, pipeline: Arc::new(Kiln) })
    }
}

fn unusable(path: &Path, doing: &'static str, source: io::Error) -> EngineError {
    EngineError::DataFolder { path: path.to_owned(), doing, source }
}

impl Engine {
    /// Opens the data folder (created when missing), continues what an earlier coordinator began, and starts the background work.
    ///
    /// # Errors
    /// A configuration with problems; a folder that cannot be created or written, is used by another coordinator, or holds a database that
    /// is damaged or of a later version; a place for blobs that cannot be used.
    pub async fn open(config: Config) -> Result<Arc<Engine>, EngineError> {
        Self::open_through(config, Arc::new(Kiln)).await
    }

    /// As [`Engine::open`], with another pipeline: a [`Sandbox`](crate::sandbox::Sandbox) where strangers send scenes.
    ///
    /// # Errors
    /// As [`Engine::open`].
    pub async fn open_through(config: Config, pipeline: Arc<dyn Pipeline>) -> Result<Arc<Engine>, EngineError> {
        let lock = take_folder(&config)?;
        let parts = Parts { pipeline, ..Parts::of(&config).await? };
        Self::start(config, parts, lock).await
    }

    /// As [`Engine::open`], on other parts.
    ///
    /// # Errors
    /// As [`Engine::open`].
    pub async fn open_with(config: Config, parts: Parts) -> Result<Arc<Engine>, EngineError> {
        let lock = take_folder(&config)?;
        Self::start(config, parts, lock).await
    }

    async fn start(config: Config, parts: Parts, lock: File) -> Result<Arc<Engine>, EngineError> {
        let spool = config.data_dir.join("spool");
        let webhooks = Webhooks::open(&config.webhooks).map_err(|problem| EngineError::Invalid(vec![problem]))?;
        let core = Arc::new(Core::new(config, spool, parts.store, parts.blobs, parts.pipeline, parts.clock, webhooks));
        // The lock proves that whoever held these tasks is dead, where nobody else may use the store; otherwise they expire. Attempts stay: their
        // workers may well be alive.
        let resumed = if core.store.is_shared() { 0 } else { core.store.take_over_tasks(core.now()).await? };
        if resumed > 0 {
            tracing::info!(tasks = resumed, "continuing what an earlier coordinator began");
        }
        let mut background = JoinSet::new();
        background::start(&core, &mut background);
        Ok(Arc::new(Engine { core, background: Mutex::new(background), _lock: lock }))
    }
}

/// Creates a folder that is for its owner alone: the store holds the secret that sessions and links are signed with.
pub(crate) fn private_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// Creates the folder, makes sure that nobody else uses it, and empties the spool.
fn take_folder(config: &Config) -> Result<File, EngineError> {
    let problems = config.check();
    if !problems.is_empty() {
        return Err(EngineError::Invalid(problems));
    }
    let data = &config.data_dir;
    private_folder(data).map_err(|e| unusable(data, "creating it", e))?;
    let path = data.join("lock");
    let lock = OpenOptions::new().create(true).truncate(false).write(true).open(&path);
    let lock = lock.map_err(|e| unusable(data, "writing to it", e))?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(EngineError::Locked { path: data.clone() }),
        Err(TryLockError::Error(e)) => return Err(unusable(&path, "locking it", e)),
    }
    let spool = data.join("spool");
    match std::fs::remove_dir_all(&spool) {
        Ok(()) => {}
        Err(e) if e.kind() == io::ErrorKind::NotFound => {}
        Err(e) => return Err(unusable(&spool, "emptying it", e)),
    }
    std::fs::create_dir_all(&spool).map_err(|e| unusable(&spool, "creating it", e))?;
    Ok(lock)
}
