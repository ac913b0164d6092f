//! The table of routes: one place that says what is served, by whom, and with which problems it may answer.
//!
//! axum's router cannot be asked what it holds. Building it through this table keeps the OpenAPI document and the router honest about each
//! other: a test compares them, and the problem responses of the document are generated from here.

use super::{
    App, archive, assets, bakes, catalogue::Kind, events, health, index, jobs, links, live, metrics, openapi, page, preview, scenes,
    session, tiles, worker_protocol, workers,
};
use crate::auth::Access;
use axum::{
    Router,
    handler::Handler,
    http::Method,
    routing::{MethodFilter, on},
};

/// The methods in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // HTTP's own names.
pub(super) enum Verb {
    Get,
    Post,
    Put,
    Patch,
    Delete,
}

impl Verb {
    /// The verb of a method; GET answers HEAD too.
    #[must_use]
    pub(super) fn of(method: &Method) -> Option<Self> {
        match *method {
            Method::GET | Method::HEAD => Some(Verb::Get),
            Method::POST => Some(Verb::Post),
            Method::PUT => Some(Verb::Put),
            Method::PATCH => Some(Verb::Patch),
            Method::DELETE => Some(Verb::Delete),
            _ => None,
        }
    }

    /// As an OpenAPI path item names it.
    #[must_use]
    pub(super) fn name(self) -> &'static str {
        match self {
            Verb::Get => "get",
            Verb::Post => "post",
            Verb::Put => "put",
            Verb::Patch => "patch",
            Verb::Delete => "delete",
        }
    }

    fn filter(self) -> MethodFilter {
        match self {
            Verb::Get => MethodFilter::GET,
            Verb::Post => MethodFilter::POST,
            Verb::Put => MethodFilter::PUT,
            Verb::Patch => MethodFilter::PATCH,
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
    /// Who may use it.
    pub access: Access,
    /// Problems that this route may answer with, beside those that any may (404, 405, 500, 503) and those of access (401, 403, 429).
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
    fn on<H, T>(mut self, verb: Verb, path: &'static str, access: Access, problems: &'static [Kind], handler: H) -> Self
    where
        H: Handler<T, App>,
        T: 'static,
    {
        self.router = self.router.route(path, on(verb.filter(), handler));
        self.list.push(Route { verb, path, access, problems });
        self
    }

    /// Everything that is served.
    #[must_use]
    pub(super) fn all() -> Self {
        Self::default().pages().scenes().jobs().packages().access().worker_protocol().operations()
    }

    fn pages(self) -> Self {
        self.on(Verb::Get, "/", Access::Public, PAGE, page::dashboard)
            .on(Verb::Get, "/jobs/{id}", Access::Public, &[Kind::UnknownJob, Kind::PreconditionFailed], page::job)
            .on(Verb::Get, "/assets/{*path}", Access::Public, &[Kind::NotFound, Kind::PreconditionFailed], page::asset)
            .on(Verb::Get, "/kiln-viewer.js", Access::Public, &[Kind::NotFound, Kind::PreconditionFailed], page::library)
            .on(Verb::Get, "/about", Access::Look, &[], index::about)
            .on(Verb::Get, "/problems/{slug}", Access::Public, &[Kind::NotFound], index::problem_page)
            .on(Verb::Get, "/openapi.json", Access::Look, &[], openapi::document)
    }

    fn scenes(self) -> Self {
        self.on(Verb::Post, "/v1/scenes", Access::Submit, UPLOAD, scenes::create)
            .on(Verb::Get, "/v1/scenes/{scene}", Access::Look, &[Kind::UnknownScene], scenes::get)
            .on(Verb::Post, "/v1/bakes", Access::Submit, BAKE, bakes::create)
    }

    fn jobs(self) -> Self {
        self.on(Verb::Post, "/v1/jobs", Access::Submit, NEW_JOB, jobs::create)
            .on(Verb::Get, "/v1/jobs", Access::Look, &[Kind::InvalidRequest], jobs::list)
            .on(Verb::Get, "/v1/jobs/{id}", Access::LookAtJob, &[Kind::UnknownJob], jobs::get)
            .on(Verb::Patch, "/v1/jobs/{id}", Access::ChangeJob, CHANGE, jobs::change)
            .on(Verb::Post, "/v1/jobs/{id}/retry", Access::ChangeJob, &[Kind::UnknownJob, Kind::Conflict], jobs::retry)
            .on(Verb::Delete, "/v1/jobs/{id}", Access::ChangeJob, &[Kind::UnknownJob], jobs::delete)
            .on(Verb::Post, "/v1/jobs/{id}/cancel", Access::ChangeJob, &[Kind::UnknownJob], jobs::cancel)
            .on(Verb::Get, "/v1/jobs/{id}/events", Access::LookAtJob, &[Kind::UnknownJob, Kind::InvalidRequest], events::stream)
            .on(Verb::Get, "/v1/jobs/{id}/scene.kiln", Access::LookAtJob, SCENE, live::scene)
            .on(Verb::Get, "/v1/jobs/{id}/segments", Access::LookAtJob, &[Kind::UnknownJob, Kind::InvalidRequest], live::segments)
            .on(Verb::Get, "/v1/jobs/{id}/tiles", Access::LookAtJob, &[Kind::UnknownJob, Kind::InvalidRequest], tiles::get)
    }

    fn packages(self) -> Self {
        self.on(Verb::Get, "/v1/jobs/{id}/assets", Access::Package, FILE, assets::manifest)
            .on(Verb::Get, "/v1/jobs/{id}/assets/{*path}", Access::Package, FILE, assets::file)
            .on(Verb::Get, "/v1/jobs/{id}/bundle.zip", Access::Package, ARCHIVE, archive::zip)
            .on(Verb::Get, "/v1/jobs/{id}/bundle.tar.zst", Access::Package, ARCHIVE, archive::tar_zst)
            .on(Verb::Get, "/v1/jobs/{id}/preview.png", Access::Package, PICTURE, preview::picture)
    }

    fn access(self) -> Self {
        self.on(Verb::Post, "/v1/session", Access::Public, LOG_IN, session::open)
            .on(Verb::Delete, "/v1/session", Access::Public, &[], session::close)
            .on(Verb::Post, "/v1/jobs/{id}/links", Access::ChangeJob, NEW_LINK, links::create)
    }

    fn worker_protocol(self) -> Self {
        self.on(Verb::Post, "/v1/worker/hello", Access::Work, &[], worker_protocol::hello)
            .on(Verb::Post, "/v1/worker/leases", Access::Work, &[], worker_protocol::lease)
            .on(Verb::Get, "/v1/worker/scenes/{hash}", Access::Work, &[], worker_protocol::scene)
            .on(Verb::Get, "/v1/worker/plans/{digest}", Access::Work, &[], worker_protocol::plan)
            .on(Verb::Put, "/v1/worker/attempts/{token}/chunks/{n}", Access::Work, &[], worker_protocol::chunk)
            .on(Verb::Post, "/v1/worker/attempts/{token}/heartbeat", Access::Work, &[], worker_protocol::heartbeat)
            .on(Verb::Post, "/v1/worker/attempts/{token}/complete", Access::Work, &[], worker_protocol::complete)
            .on(Verb::Post, "/v1/worker/attempts/{token}/release", Access::Work, &[], worker_protocol::release)
    }

    fn operations(self) -> Self {
        self.on(Verb::Get, "/v1/workers", Access::Look, &[], workers::list)
            .on(Verb::Get, "/v1/throughput", Access::Look, &[], workers::throughput)
            .on(Verb::Get, "/healthz", Access::Public, &[], health::healthz)
            .on(Verb::Get, "/readyz", Access::Public, &[Kind::NotReady], health::readyz)
            .on(Verb::Get, "/metrics", Access::Operate, &[], metrics::render)
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
    Kind::KeyReused,
    Kind::KeyInUse,
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
    Kind::KeyReused,
    Kind::KeyInUse,
    Kind::WebhookRefused,
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
    Kind::KeyReused,
    Kind::KeyInUse,
    Kind::WebhookRefused,
    Kind::StorageFull,
];
const CHANGE: &[Kind] = &[
    Kind::UnknownJob,
    Kind::Conflict,
    Kind::InvalidJson,
    Kind::WrongShape,
    Kind::TruncatedUpload,
    Kind::TooSlow,
    Kind::TooLarge,
    Kind::UnsupportedMediaType,
];
const PAGE: &[Kind] = &[Kind::PreconditionFailed];
const FILE: &[Kind] = &[Kind::UnknownJob, Kind::UnknownAsset, Kind::JobNotDone, Kind::PreconditionFailed, Kind::RangeNotSatisfiable];
const SCENE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::PreconditionFailed];
const ARCHIVE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::PreconditionFailed];
const PICTURE: &[Kind] = &[Kind::UnknownJob, Kind::JobNotDone, Kind::InvalidRequest, Kind::PreconditionFailed, Kind::SceneTooLarge];
const LOG_IN: &[Kind] =
    &[Kind::InvalidJson, Kind::WrongShape, Kind::UnsupportedMediaType, Kind::TooLarge, Kind::Unauthenticated, Kind::TooManyRequests];
const NEW_LINK: &[Kind] = &[Kind::UnknownJob, Kind::InvalidJson, Kind::WrongShape, Kind::UnsupportedMediaType, Kind::TooLarge];
