//! The OpenAPI 3.1 document: paths and records by derive, then completed from what the derive cannot know.
//!
//! Added afterwards, on the JSON: the settings' schemas, the body of multipart uploads, bytes that are no text, and for each operation the
//! problems that the table of routes says it may answer with. So each fact stands in one place of the code.

use super::{
    archive, assets, bakes,
    catalogue::Kind,
    events, health, import_query, index, jobs, links, live, metrics, page, preview, problem,
    routes::{Route, Routes},
    scenes, session, settings_schema, tiles, worker_protocol, workers,
};
use crate::{auth::Access, records};
use axum::Json;
use serde_json::{Value, json};
use std::{collections::BTreeMap, sync::LazyLock};
use utoipa::OpenApi;

#[derive(OpenApi)]
#[openapi(
    info(title = "Kiln", description = "A bake farm for lighting that depends on the viewer: scenes in, surface light fields out.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0")),
    tags(
        (name = "scenes", description = "Upload and look up scenes"),
        (name = "jobs", description = "Submit bakes and follow them"),
        (name = "packages", description = "Fetch what was baked"),
        (name = "access", description = "Sessions of browsers; tokens are made with `kiln token`"),
        (name = "operations", description = "Workers, health, figures"),
        (name = "worker", description = "The worker protocol: frames of `proto::wire`, refusals as `Refusal` frames"),
        (name = "pages", description = "For people")),
    paths(
        page::dashboard, page::job, page::asset, page::library, index::about, index::problem_page, document,
        scenes::create, scenes::get, bakes::create,
        jobs::create, jobs::list, jobs::get, jobs::change, jobs::retry, jobs::delete, jobs::cancel, events::stream, tiles::get, live::scene, live::segments,
        assets::manifest, assets::file, archive::zip, archive::tar_zst, preview::picture,
        links::create, session::open, session::close,
        worker_protocol::hello, worker_protocol::lease, worker_protocol::scene, worker_protocol::plan, worker_protocol::chunk,
        worker_protocol::heartbeat, worker_protocol::complete, worker_protocol::release,
        workers::list, workers::throughput, health::healthz, health::readyz, metrics::render),
    components(schemas(problem::ProblemDetails, records::JobEvent, events::Snapshot, records::NewJob, records::WebhookMessage))
)]
struct Derived;

static DOCUMENT: LazyLock<Value> = LazyLock::new(|| complete(&Derived::openapi(), &Routes::all().list));

/// The document.
#[must_use]
pub fn openapi() -> &'static Value {
    &DOCUMENT
}

/// This document.
#[utoipa::path(get, path = "/openapi.json", operation_id = "openapi", tag = "pages", responses((status = 200, description = "OpenAPI 3.1", body = Object)))]
pub(super) async fn document() -> Json<&'static Value> {
    Json(openapi())
}

fn complete(derived: &utoipa::openapi::OpenApi, routes: &[Route]) -> Value {
    // Serialising plain data does not fail; were it to, the empty document would fail the tests below.
    let mut document = serde_json::to_value(derived).unwrap_or_default();
    let schemas = &mut document["components"]["schemas"];
    schemas["SettingsPatch"] = settings_schema::settings_patch();
    schemas["BakeSettings"] = settings_schema::bake_settings();
    schemas["NewJob"]["properties"]["settings"] = reference("SettingsPatch");
    schemas["NewJob"]["additionalProperties"] = false.into();
    schemas["NewJob"]["examples"] = json!([{"scene": "0".repeat(64), "settings": {"preset": "draft"}, "labels": {"project": "atrium"}}]);
    schemas["JobRecord"]["properties"]["settings"] = reference("BakeSettings");
    schemas["ImportOptions"] = import_query::schema();
    schemas["SceneRecord"]["properties"]["options"] = reference("ImportOptions");
    schemas["TileRun"] = json!({"type": "object", "description": "The tiles from `start` to before `end`.", "required": ["start", "end"],
        "properties": {"start": {"type": "integer", "minimum": 0}, "end": {"type": "integer", "minimum": 0}}});
    schemas["UnixMillis"] = json!({"type": "integer", "format": "int64", "description": "Milliseconds since 1970-01-01 UTC."});
    if let Some(schemas) = schemas.as_object_mut() {
        schemas.remove("i64");
    }
    document["webhooks"] = webhooks();
    name_shared_types(&mut document);
    describe_uploads(&mut document);
    describe_bytes(&mut document["paths"]);
    document["paths"]["/v1/jobs/{id}/events"]["get"]["responses"]["200"]["content"]["text/event-stream"]["schema"] = event();
    document["components"]["securitySchemes"] = security_schemes();
    for route in routes {
        document["paths"][route.documented_path()][route.verb.name()]["security"] = security(route.access);
        let responses = &mut document["paths"][route.documented_path()][route.verb.name()]["responses"];
        add_refusals(responses, route);
        add_problems(responses, route);
    }
    document
}

fn reference(schema: &str) -> Value {
    json!({"$ref": format!("#/components/schemas/{schema}")})
}

/// What the service sends by itself.
fn webhooks() -> Value {
    let header = |name: &str, description: &str| json!({"name": name, "in": "header", "required": true, "description": description, "schema": {"type": "string"}});
    json!({"jobEnded": {"post": {
        "operationId": "jobEnded",
        "tags": ["jobs"],
        "description": "Sent to the `webhook` of a job that is done, has failed or was cancelled, at least once, as Standard Webhooks has it.",
        "parameters": [
            header("webhook-id", "Names the message; the same in every try to deliver it"),
            header("webhook-timestamp", "When it was sent, seconds since 1970"),
            header("webhook-signature", "`v1,` and the base64 of the HMAC-SHA256 of `id.timestamp.body`"),
        ],
        "requestBody": {"required": true, "content": {"application/json": {"schema": reference("WebhookMessage")}}},
        "responses": {
            "2XX": {"description": "Taken. Nothing of the body is read."},
            "410": {"description": "Unwanted: the message is given up"},
            "default": {"description": "Tried again for about a day. Redirects are not followed."},
        },
    }}})
}

/// Types of `proto`, and the alias of a plain number, that the derive saw only as what they are made of.
fn name_shared_types(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            for (name, field) in fields.iter_mut() {
                match name.as_str() {
                    "$ref" if field == "#/components/schemas/i64" => *field = "#/components/schemas/UnixMillis".into(),
                    "runs" if field["type"] == "array" => field["items"] = reference("TileRun"),
                    "phase" if field["type"] == "string" => field["enum"] = json!(["probe", "bake"]),
                    "phase" if field["type"].is_array() => field["enum"] = json!(["probe", "bake", null]),
                    _ => name_shared_types(field),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(name_shared_types),
        _ => {}
    }
}

/// One part per file, and for bakes the settings.
fn describe_uploads(document: &mut Value) {
    let file = json!({"description": "One part per file, under any field name; `filename` is the path that the scene uses for it."});
    let scene = json!({"type": "object", "additionalProperties": file});
    let mut bake = scene.clone();
    bake["properties"] = json!({"settings": reference("SettingsPatch")});
    for (path, schema) in [("/v1/scenes", scene), ("/v1/bakes", bake)] {
        document["paths"][path]["post"]["requestBody"]["content"]["multipart/form-data"] = json!({ "schema": schema });
    }
}

/// OpenAPI 3.1 describes plain bytes by a media type without a schema.
fn describe_bytes(value: &mut Value) {
    const BYTES: &[&str] = &[
        "*/*",
        "application/octet-stream",
        "application/zip",
        "application/zstd",
        "image/png",
        "model/obj",
        worker_protocol::FRAME,
        live::SEGMENTS,
    ];
    match value {
        Value::Object(fields) => {
            for (name, field) in fields.iter_mut() {
                if BYTES.contains(&name.as_str()) {
                    *field = json!({});
                } else {
                    describe_bytes(field);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(describe_bytes),
        _ => {}
    }
}

/// One event of a stream, field by field.
fn event() -> Value {
    let data = json!({"anyOf": [reference("JobEvent"), reference("Snapshot")]});
    json!({"type": "object", "description": "One event of the stream.", "required": ["event", "id", "data"], "properties": {
        "event": {"enum": ["state", "tiles", "problem", "snapshot"]},
        "id": {"type": "string", "description": "The sequence number."},
        "data": {"type": "string", "contentMediaType": "application/json", "contentSchema": data},
    }})
}

/// How a client says who it is.
fn security_schemes() -> Value {
    json!({
        "token": {"type": "http", "scheme": "bearer", "bearerFormat": "kiln_ID_SECRET",
            "description": "An access token, made with `kiln token create`. An operation takes one of the roles that its `security` lists. \
                Not needed as long as a service on a loopback address has no tokens."},
        "session": {"type": "apiKey", "in": "cookie", "name": super::credentials::COOKIE,
            "description": "A browser's session, opened with POST /v1/session. Whatever changes something must come from a page of the service."},
        "link": {"type": "apiKey", "in": "query", "name": "signature",
            "description": "A link signed with POST /v1/jobs/{id}/links, together with its `expires`: reads this one address."},
    })
}

/// What an operation asks for; nothing for what is public.
fn security(access: Access) -> Value {
    let roles: Vec<&str> = access.roles().iter().map(crate::auth::Role::name).collect();
    match access {
        Access::Public => json!([]),
        Access::Work => json!([{"token": roles}]),
        Access::Package => json!([{"token": roles}, {"session": roles}, {"link": []}]),
        _ => json!([{"token": roles}, {"session": roles}]),
    }
}

/// What the worker protocol refuses with a frame, where a call's own words do not say it.
fn add_refusals(responses: &mut Value, route: &Route) {
    for (status, why) in worker_protocol::refusals(route) {
        let status = status.to_string();
        if responses[&status].is_null() {
            responses[&status] = json!({"description": format!("Refusal: {why}"), "content": {worker_protocol::FRAME: {}}});
        }
    }
}

/// Problems by status: what the table says, those of access, and what any route may answer.
fn add_problems(responses: &mut Value, route: &Route) {
    const ALWAYS: &[Kind] = &[Kind::ForeignHost, Kind::ForeignOrigin, Kind::Busy, Kind::Internal];
    const OF_ACCESS: &[Kind] = &[Kind::Unauthenticated, Kind::Forbidden, Kind::TooManyRequests];
    let of_access = if route.access == Access::Public { &[] } else { OF_ACCESS };
    let mut by_status: BTreeMap<u16, Vec<Kind>> = BTreeMap::new();
    for kind in route.problems.iter().chain(of_access).chain(ALWAYS) {
        by_status.entry(kind.entry().status.as_u16()).or_default().push(*kind);
    }
    for (status, kinds) in by_status {
        let status = status.to_string();
        let titles: Vec<String> = kinds.iter().map(|kind| format!("{} (`{}`)", kind.entry().title, kind.uri())).collect();
        let examples: Value =
            kinds.iter().map(|kind| (kind.entry().slug.to_owned(), example(*kind))).collect::<serde_json::Map<_, _>>().into();
        let content = json!({"schema": reference("ProblemDetails"), "examples": examples});
        // The worker protocol may answer with a frame as well, and the door before it does not.
        let known = responses[&status]["description"].as_str().map(str::to_owned);
        responses[&status]["description"] = known.into_iter().chain(titles).collect::<Vec<_>>().join("; ").into();
        responses[&status]["content"]["application/problem+json"] = content;
    }
}

fn example(kind: Kind) -> Value {
    let entry = kind.entry();
    json!({"value": {"type": kind.uri(), "title": entry.title, "status": entry.status.as_u16(), "detail": entry.meaning}})
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_route_is_documented_and_every_documented_route_exists() {
        let served: BTreeSet<String> = Routes::all().list.iter().map(|r| format!("{} {}", r.verb.name(), r.documented_path())).collect();
        let paths = openapi()["paths"].as_object().unwrap();
        let documented = paths.iter().flat_map(|(path, item)| {
            let methods = item.as_object().unwrap().iter().filter(|(_, operation)| operation["operationId"].is_string());
            methods.map(move |(method, _)| format!("{method} {path}"))
        });
        assert_eq!(documented.collect::<BTreeSet<_>>(), served);
    }

    #[test]
    fn operations_have_names_of_their_own() {
        let operations = openapi()["paths"].as_object().unwrap().values().flat_map(|item| item.as_object().unwrap().values());
        let names: Vec<&str> = operations.filter_map(|operation| operation["operationId"].as_str()).collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len());
        assert_eq!(names.len(), Routes::all().list.len());
    }

    #[test]
    fn operations_say_who_may_use_them_and_how_others_are_refused() {
        for route in Routes::all().list {
            let operation = &openapi()["paths"][route.documented_path()][route.verb.name()];
            let path = route.documented_path();
            let asks = operation["security"].as_array().unwrap();
            assert_eq!(asks.is_empty(), route.access == Access::Public, "{path}");
            for ask in asks {
                let scheme = ask.as_object().unwrap().keys().next().unwrap();
                assert!(openapi()["components"]["securitySchemes"][scheme].is_object(), "{path}: {scheme}");
            }
            for (status, slug) in [("401", "unauthenticated"), ("403", "forbidden"), ("429", "too-many-requests")] {
                let examples = &operation["responses"][status]["content"]["application/problem+json"]["examples"];
                // Logging in asks for nothing beforehand, and still may be refused.
                let logs_in = operation["operationId"] == "logIn" && slug != "forbidden";
                assert_eq!(examples[slug].is_object(), !asks.is_empty() || logs_in, "{path} {status}");
            }
        }
    }

    #[test]
    fn every_parameter_of_a_path_is_documented() {
        for route in Routes::all().list {
            let operation = &openapi()["paths"][route.documented_path()][route.verb.name()];
            let named: BTreeSet<&str> = operation["parameters"]
                .as_array()
                .into_iter()
                .flatten()
                .filter(|p| p["in"] == "path")
                .map(|p| p["name"].as_str().unwrap())
                .collect();
            let path = route.documented_path();
            let needed: BTreeSet<&str> = path.split('/').filter_map(|part| part.strip_prefix('{')?.strip_suffix('}')).collect();
            assert_eq!(named, needed, "{path}");
        }
    }

    #[test]
    fn every_reference_leads_somewhere() {
        fn walk<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
            match value {
                Value::Object(fields) => {
                    found.extend(fields.get("$ref").and_then(Value::as_str));
                    fields.values().for_each(|field| walk(field, found));
                }
                Value::Array(items) => items.iter().for_each(|item| walk(item, found)),
                _ => {}
            }
        }
        let mut found = Vec::new();
        walk(openapi(), &mut found);
        assert!(found.len() > 50);
        for target in found {
            assert!(openapi().pointer(target.trim_start_matches('#')).is_some(), "{target}");
        }
    }

    #[test]
    fn the_document_is_of_version_3_1_and_names_problems() {
        assert_eq!(openapi()["openapi"], "3.1.0");
        let rejected = &openapi()["paths"]["/v1/scenes"]["post"]["responses"]["422"]["content"]["application/problem+json"];
        assert_eq!(rejected["examples"]["scene-rejected"]["value"]["type"], "/problems/scene-rejected");
        let told = &openapi()["webhooks"]["jobEnded"]["post"]["requestBody"]["content"]["application/json"]["schema"];
        assert_eq!(*told, reference("WebhookMessage"));
        assert_eq!(openapi()["components"]["schemas"]["NewJob"]["properties"]["settings"], reference("SettingsPatch"));
    }
}
