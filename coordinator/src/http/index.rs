//! Pages for people without script: what is here, and what each kind of problem means. Plain HTML without style or script, so that the
//! strict Content-Security-Policy of the API holds here too.

use super::{
    catalogue::Kind,
    extract::Path,
    problem::{Answer, Failure},
};
use axum::response::Html;
use kiln_proto::ids::JobId;
use std::fmt::Write as _;

/// What is here.
#[utoipa::path(get, path = "/about", operation_id = "about", tag = "pages", responses((status = 200, description = "An overview", body = String, content_type = "text/html")))]
pub(super) async fn about() -> Html<String> {
    let mut rows = String::new();
    for (link, what) in [
        ("/", "the dashboard"),
        ("/openapi.json", "the API, as OpenAPI 3.1"),
        ("/v1/jobs", "jobs"),
        ("/v1/workers", "workers"),
        ("/healthz", "is the process alive?"),
        ("/readyz", "can it work?"),
        ("/metrics", "figures for Prometheus"),
    ] {
        let _ = write!(rows, "<li><a href=\"{link}\">{link}</a>: {what}</li>"); // Writing to a String cannot fail.
    }
    let bake = "curl -F scene=@room.obj -F materials=@room.mtl -F 'settings={\"preset\":\"draft\"}' http://HOST/v1/bakes";
    Html(page("Kiln", &format!("<p>Bake a scene:</p><pre>{bake}</pre><ul>{rows}</ul><p>Problems:</p><ul>{}</ul>", problem_links())))
}

/// What stands for the page of a job in a build without the page.
pub(super) fn job_without_page(job: JobId) -> Html<String> {
    let link = format!("/v1/jobs/{job}");
    let body = format!("<p>This build of Kiln has no page.</p><p><a href=\"{link}\">{link}</a> has the job as JSON.</p>");
    Html(page(&format!("Job {job}"), &body))
}

fn problem_links() -> String {
    Kind::ALL.iter().fold(String::new(), |mut links, kind| {
        let _ = write!(links, "<li><a href=\"{}\">{}</a></li>", kind.uri(), escape(kind.entry().title));
        links
    })
}

/// What a kind of problem means and what to do about it.
#[utoipa::path(get, path = "/problems/{slug}", operation_id = "problemPage", tag = "pages", params(("slug" = String, Path, description = "Last segment of a problem's `type`")),
    responses((status = 200, description = "The page", body = String, content_type = "text/html")))]
pub(super) async fn problem_page(Path(slug): Path<String>) -> Answer<Html<String>> {
    let kind = Kind::from_slug(&slug).ok_or_else(|| Failure::new(Kind::NotFound, "there is no problem of that name"))?;
    let entry = kind.entry();
    let body = format!(
        "<p>HTTP status {}.</p><p>{}</p><p>{}</p><p><a href=\"/about\">Overview</a></p>",
        entry.status,
        escape(entry.meaning),
        escape(entry.remedy)
    );
    Ok(Html(page(entry.title, &body)))
}

fn page(title: &str, body: &str) -> String {
    let title = escape(title);
    format!("<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><h1>{title}</h1>{body}</html>\n")
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
