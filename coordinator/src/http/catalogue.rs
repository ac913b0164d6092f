//! The kinds of problem that this API can answer with: for each its `type` URI, status, meaning and remedy.
//!
//! RFC 9457 asks that `type` be a URI, preferably one that leads to documentation. Ours are `/problems/{slug}` on this very server, so that
//! whoever meets one offline, at three in the morning, finds the page. The alternative, free text per error, leaves clients to match words.

use axum::http::StatusCode;

/// What the page of a kind says.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// Last segment of the `type` URI.
    pub slug: &'static str,
    /// The HTTP status it travels with.
    pub status: StatusCode,
    /// RFC 9457 `title`: the same for every occurrence.
    pub title: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// What to do.
    pub remedy: &'static str,
}

macro_rules! kinds {
    ($($name:ident $slug:literal $status:ident $title:literal $meaning:literal $remedy:literal;)*) => {
        /// A kind of problem.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        #[allow(missing_docs)] // Each is documented by its entry, which users read.
        pub(super) enum Kind { $($name),* }

        impl Kind {
            /// Every kind, in the order of the catalogue.
            pub(super) const ALL: &[Kind] = &[$(Kind::$name),*];

            /// What its page says.
            #[must_use]
            pub(super) fn entry(self) -> Entry {
                match self {
                    $(Kind::$name => Entry { slug: $slug, status: StatusCode::$status, title: $title, meaning: $meaning, remedy: $remedy },)*
                }
            }
        }
    };
}

kinds! {
    SceneRejected "scene-rejected" UNPROCESSABLE_ENTITY "The scene cannot be used"
        "The upload was read, but it is not a scene that can be baked. `problems` lists every finding with its file and line."
        "Correct the files named there and upload all of them again.";
    InvalidSettings "invalid-settings" UNPROCESSABLE_ENTITY "The settings are not acceptable"
        "A setting is unknown, has the wrong type, is out of its range, or contradicts another one. `field` names it."
        "See the schema SettingsPatch in /openapi.json for every setting, its range and its default.";
    InvalidRequest "invalid-request" BAD_REQUEST "The request cannot be understood"
        "A parameter of the query, or a header, is missing, unknown or malformed; `detail` names it."
        "Compare the request with /openapi.json.";
    InvalidJson "invalid-json" BAD_REQUEST "The body is not JSON"
        "The body stops being JSON at the position given by `line` and `column`."
        "Correct the text there; trailing commas and comments are not JSON.";
    WrongShape "wrong-shape" UNPROCESSABLE_ENTITY "The JSON has not the expected shape"
        "The body is JSON, but a field is unknown, missing or of another type. `field` names it."
        "Compare the body with its schema in /openapi.json. Unknown fields are refused, so that a typing error is never ignored.";
    TruncatedUpload "truncated-upload" BAD_REQUEST "The upload ended early"
        "The connection or the multipart body ended before all that was announced had arrived. Nothing of it was kept."
        "Upload again.";
    EmptyUpload "empty-upload" UNPROCESSABLE_ENTITY "The upload holds nothing to import"
        "There is no file in the upload, or all its files are empty."
        "Send at least one file with content; in multipart each part needs a filename.";
    BadFileName "bad-file-name" UNPROCESSABLE_ENTITY "A file name is not allowed"
        "Names are relative paths without `..`, drive letters or control characters; no two may be the same but for case."
        "Send the path that the scene uses for the file, such as `textures/wood.png`.";
    TooLarge "too-large" PAYLOAD_TOO_LARGE "The body is too large"
        "The body exceeds what this call accepts; `detail` names the limit."
        "Send less: smaller textures, fewer files, or several scenes.";
    TooSlow "too-slow" REQUEST_TIMEOUT "The body stopped coming"
        "No byte of the body arrived for a minute. Nothing of it was kept."
        "Upload again over a steadier connection.";
    UnsupportedMediaType "unsupported-media-type" UNSUPPORTED_MEDIA_TYPE "The media type is not supported"
        "This call does not take a body of that Content-Type; `detail` names those it takes."
        "Set Content-Type to one of them.";
    UnknownScene "unknown-scene" NOT_FOUND "There is no such scene"
        "No scene has that id or hash."
        "Upload it with POST /v1/scenes, and use the id or the hash of the answer.";
    SceneNotReady "scene-not-ready" CONFLICT "The scene is not ready"
        "The scene was rejected, or is still being imported where that matters; `detail` says which."
        "GET the scene to see its state and problems; wait, or upload a corrected one.";
    UnknownJob "unknown-job" NOT_FOUND "There is no such job"
        "No job has that id; it may have been deleted."
        "List the jobs with GET /v1/jobs.";
    JobNotDone "job-not-done" CONFLICT "The job has no package yet"
        "Assets exist once a job is done; `detail` says how far it is."
        "Follow GET /v1/jobs/{id}/events until the state is `done`.";
    UnknownAsset "unknown-asset" NOT_FOUND "There is no such file in the package"
        "The package of this job has no file at that path."
        "GET /v1/jobs/{id}/assets lists the files.";
    SceneTooLarge "scene-too-large" UNPROCESSABLE_ENTITY "The scene is too large for a picture made here"
        "A picture would take more memory and time than the service has beside its other work; `detail` names the limit."
        "Fetch the package and use `kiln render` on it, or look at it in a browser.";
    RangeNotSatisfiable "range-not-satisfiable" RANGE_NOT_SATISFIABLE "The range is not in the file"
        "The Range header is malformed or begins past the end. Content-Range gives the file's length."
        "Ask for `bytes=FIRST-LAST`, `bytes=FIRST-` or `bytes=-COUNT` within it.";
    PreconditionFailed "precondition-failed" PRECONDITION_FAILED "The file is not the one expected"
        "If-Match names another entity tag than the file's."
        "GET the file again without the condition.";
    NotFound "not-found" NOT_FOUND "There is nothing here"
        "No resource has this path."
        "GET / and /openapi.json list what is here.";
    MethodNotAllowed "method-not-allowed" METHOD_NOT_ALLOWED "The method does not fit the resource"
        "The resource exists, but not for this method. The Allow header lists those it takes."
        "Use one of them.";
    ForeignHost "foreign-host" FORBIDDEN "The Host is not this server's"
        "Without access tokens this server answers only to its loopback names, so that no web page can reach it under a name of its own."
        "Use localhost, 127.0.0.1 or [::1] as host.";
    ForeignOrigin "foreign-origin" FORBIDDEN "The request comes from a foreign web page"
        "Without access tokens this server accepts no requests that a page of another origin makes a browser send."
        "Use a page served from this machine, or a client that is not a browser.";
    Unauthenticated "unauthenticated" UNAUTHORIZED "An access token is needed"
        "The service has access tokens, and the request brought none, or one that is unknown, revoked or expired; `detail` says which."
        "Send `Authorization: Bearer kiln_...`; `kiln` takes --token or KILN_TOKEN. Tokens are made with `kiln token create`.";
    Forbidden "forbidden" FORBIDDEN "The token is not for this"
        "The access token is good, but none of its roles allows this call; `detail` names those that do."
        "Use a token with one of those roles.";
    TooManyRequests "too-many-requests" TOO_MANY_REQUESTS "Too many requests"
        "A token asked more often than the service allows, or an address presented too many tokens that are not accepted."
        "Wait for the seconds that Retry-After names. The service's limits are access.requests_per_s and access.burst.";
    Conflict "conflict" CONFLICT "The request does not fit the present state"
        "Something has changed since; `detail` says what."
        "GET the resource and decide again.";
    WebhookRefused "webhook-refused" UNPROCESSABLE_ENTITY "The webhook may not be told"
        "The address is none, or the service is not configured to send webhooks to its host and port; `detail` says which."
        "Use an address that the service allows, or have its operator allow this one with `kiln serve --webhook-allow`.";
    KeyReused "idempotency-key-reused" UNPROCESSABLE_ENTITY "The Idempotency-Key belongs to another request"
        "A request with this key came within the last 24 hours, with another body, path or query."
        "Make a fresh key for every new request; keep it only to repeat the very same one.";
    KeyInUse "idempotency-key-in-use" CONFLICT "The request is being performed"
        "The first request with this Idempotency-Key is not answered yet."
        "Repeat it after the seconds that Retry-After names, with the same key: the answer is then that of the first.";
    Busy "busy" SERVICE_UNAVAILABLE "The service is busy"
        "Too much is under way, or a part that the service stands on does not answer."
        "Try again after the seconds that Retry-After names.";
    StorageFull "storage-full" INSUFFICIENT_STORAGE "There is no space left"
        "The data folder's disk is full. Nothing was lost, but nothing more can be stored."
        "Free space on the server, then try again.";
    NotReady "not-ready" SERVICE_UNAVAILABLE "The service is not ready"
        "The store or the blobs cannot be used at the moment; `detail` says which and why."
        "Look at the server's log; the service recovers on its own when they do.";
    Internal "internal" INTERNAL_SERVER_ERROR "Something went wrong inside"
        "A fault of the server's own. It was logged under the request id of the X-Request-Id header; the service goes on."
        "Report it with that id.";
}

impl Kind {
    /// The `type` URI, relative to the server.
    #[must_use]
    pub(super) fn uri(self) -> String {
        format!("/problems/{}", self.entry().slug)
    }

    /// The kind with the given last segment.
    #[must_use]
    pub(super) fn from_slug(slug: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.entry().slug == slug)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_slug_and_an_error_status() {
        for kind in Kind::ALL {
            let entry = kind.entry();
            assert_eq!(Kind::from_slug(entry.slug), Some(*kind));
            assert!(entry.status.is_client_error() || entry.status.is_server_error(), "{kind:?}");
            assert!(entry.slug.bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{}", entry.slug);
        }
    }
}
