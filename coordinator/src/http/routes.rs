//! The table of routes: one place that says what is served, by whom, and with which problems it may answer.
//!
//! axum's router cannot be asked what it holds. Building it through this table keeps the OpenAPI document and the router honest about each
//! other: a test compares them, and the problem responses of the document are generated from here.

use super::{
    App, archive, assets, bakes, catalogue::Kind, events, health, index, jobs, live, metrics, openapi, page, preview, scenes, tiles,
    worker_protocol, workers,
};
use axum::{
    Router,
    handler::Handler,
    routing::{MethodFilter, on},
};

/// The methods in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // HTTP's own names.
pub(super) enum Verb {
    Get,
    Post,
    Put,
    Delete,
}

impl Verb {
    /// As an OpenAPI path item names it.
    #[must_use]
    pub(super) fn name(self) -> &'static str {
        match self {
            Verb::Get => "get",
            Verb::Post => "post",
            Verb::Put => "put",
            Verb::Delete => "delete",
        }
    }

    fn filter(self) -> MethodFilter {
        match self {
            Verb::Get => MethodFilter::GET,
            Verb::Post => MethodFilter::POST,
            Verb::Put => MethodFilter::PUT,
            Verb::Delete => MethodFilter::DELETE,
        }
    }
}

/// One route.
#[derive(Debug, Clone, Copy)]
pub(super) struct Route {
    /// The method; GET answers HEAD too.
    pub verb: Verb,
    /// The path in axum's notation.
    pub path: &'static str,
    /// Problems that this route may answer with, beside those that any may (403, 404, 405, 500, 503).
    pub problems: &'static [Kind],
}

impl Route {
    /// The path in OpenAPI's notation, which knows no wildcards.
    #[must_use]
    pub(super) fn documented_path(&self) -> String {
        self.path.replace("{*", "{")
    }
}

/// Routes with their handlers.
#[derive(Default)]
pub(super) struct Routes {
    /// For serving.
    pub router: Router<App>,
    /// For telling.
    pub list: Vec<Route>,
}

impl Routes {
    fn on<H, T>(mut self, verb: Verb, path: &'static str, problems: &'static [Kind], handler: H) -> Self
    where
        H: Handler<T, App>,
        T: 'static,
    {
        self.router = self.router.route(path, on(verb.filter(), handler));
        self.list.push(Route { verb, path, problems });
        self
    }

    /// Everything that is served.
    #[must_use]
    pub(super) fn all() -> Self {
        Self::default().pages().scenes().jobs().packages().worker_protocol().operations()
    }

    fn pages(self) -> Self {
        self.on(Verb::Get, "/", PAGE, page::dashboard)
            .on(Verb::Get, "/jobs/{id}", &[Kind::UnknownJob, Kind::PreconditionFailed], page::job)
            .on(Verb::Get, "/assets/{*path}", &[Kind::NotFound, Kind::PreconditionFailed], page::asset)
            .on(Verb::Get, "/kiln-viewer.js", &[Kind::NotFound, Kind::PreconditionFailed], page::library)
            .on(Verb::Get, "/about", &[], index::about)
            .on(Verb::Get, "/problems/{slug}", &[], index::problem_page)
            .on(Verb::Get, "/openapi.json", &[], openapi::document)
    }

    fn scenes(self) -> Self {
        self.on(Verb::Post, "/v1/scenes", UPLOAD, scenes::create)
            .on(Verb::Get, "/v1/scenes/{scene}", &[Kind::UnknownScene], scenes::get)
            .on(Verb::Post, "/v1/bakes", BAKE, bakes::create)
    }

    fn jobs(self) -> Self {
        self.on(Verb::Post, "/v1/jobs", NEW_JOB, jobs::create)
            .on(Verb::Get, "/v1/jobs", &[Kind::InvalidRequest], jobs::list)
            .on(Verb::Get, "/v1/jobs/{id}", &[Kind::UnknownJob], jobs::get)
            .on(Verb::Delete, "/v1/jobs/{id}", &[Kind::UnknownJob], jobs::delete)
            .on(Verb::Post, "/v1/jobs/{id}/cancel", &[Kind::UnknownJob], jobs::cancel)
            .on(Verb::Get, "/v1/jobs/{id}/events", &[Kind::UnknownJob, Kind::InvalidRequest], events::stream)
            .on(Verb::Get, "/v1/jobs/{id}/scene.kiln", SCENE, live::scene)
            .on(Verb::Get, "/v1/jobs/{id}/segments", &[Kind::UnknownJob, Kind::InvalidRequest], live::segments)
            .on(Verb::Get, "/v1/jobs/{id}/tiles", &[Kind::UnknownJob, Kind::InvalidRequest], tiles::get)
    }

    fn packages(self) -> Self {
        self.on(Verb::Get, "/v1/jobs/{id}/assets", FILE, assets::manifest)
            .on(Verb::Get, "/v1/jobs/{id}/assets/{*path}", FILE, assets::file)
            .on(Verb::Get, "/v1/jobs/{id}/bundle.zip", ARCHIVE, archive::zip)
            .on(Verb::Get, "/v1/jobs/{id}/bundle.tar.zst", ARCHIVE, archive::tar_zst)
            .on(Verb::Get, "/v1/jobs/{id}/preview.png", PICTURE, preview::picture)
    }

    fn worker_protocol(self) -> Self {
        self.on(Verb::Post, "/v1/worker/hello", &[], worker_protocol::hello)
            .on(Verb::Post, "/v1/worker/leases", &[], worker_protocol::lease)
            .on(Verb::Get, "/v1/worker/scenes/{hash}", &[], worker_protocol::scene)
            .on(Verb::Get, "/v1/worker/plans/{digest}", &[], worker_protocol::plan)
            .on(Verb::Put, "/v1/worker/attempts/{token}/chunks/{n}", &[], worker_protocol::chunk)
            .on(Verb::Post, "/v1/worker/attempts/{token}/heartbeat", &[], worker_protocol::heartbeat)
            .on(Verb::Post, "/v1/worker/attempts/{token}/complete", &[], worker_protocol::complete)
            .on(Verb::Post, "/v1/worker/attempts/{token}/release", &[], worker_protocol::release)
    }

    fn operations(self) -> Self {
        self.on(Verb::Get, "/v1/workers", &[], workers::list)
            .on(Verb::Get, "/v1/throughput", &[], workers::throughput)
            .on(Verb::Get, "/healthz", &[], health::healthz)
            .on(Verb::Get, "/readyz", &[Kind::NotReady], health::readyz)
            .on(Verb::Get, "/metrics", &[], metrics::render)
    }
}

const UPLOAD: &[Kind] = &[
    Kind::TruncatedUpload,
    Kind::InvalidRequest,
    Kind::TooSlow,
    Kind::TooLarge,
    Kind::UnsupportedMediaType,
    Kind::EmptyUpload,
    Kind::BadFileName,
    Kind::SceneRejected,
    Kind::StorageFull,
];
const BAKE: &[Kind] = &[
    Kind::TruncatedUpload,
    Kind::InvalidRequest,
    Kind::InvalidJson,
    Kind::TooSlow,
    Kind::TooLarge,
    Kind::UnsupportedMediaType,
    Kind::EmptyUpload,
    Kind::BadFileName,
    Kind::InvalidSettings,
    Kind::SceneRejected,
    Kind::StorageFull,
];
const NEW_JOB: &[Kind] = &[
    Kind::InvalidJson,
    Kind::InvalidRequest,
    Kind::UnknownScene,
    Kind::SceneNotReady,
    Kind::TooLarge,
    Kind::UnsupportedMediaType,
    Kind::WrongShape,
    Kind::InvalidSettings,
    Kind::StorageFull,
];
const PAGE: &[Kind] = &[Kind::PreconditionFailed];
const FILE: &[Kind] = &[Kind::UnknownJob, Kind::UnknownAsset, Kind::JobNotDone, Kind::PreconditionFailed, Kind::RangeNotSatisfiable];
const SCENE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::PreconditionFailed];
const ARCHIVE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::PreconditionFailed];
const PICTURE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::InvalidRequest, Kind::PreconditionFailed, Kind::SceneTooLarge];
