//! The page: the dashboard at `/`, a job at `/jobs/{id}`, and the files that both load. A build without it answers in plain HTML.
//!
//! Files under `assets/` have a hash of their content in their names and may be kept for ever; the others are asked for again, which costs
//! an answer without a body. Entity tags are hashes of the content, with a mark for the compressed form (RFC 9110, section 8.8.3.3).

use super::{
    assets::{IMMUTABLE, REVALIDATE, whole},
    catalogue::Kind,
    conditional::strong_etag,
    extract::{JobInPath, Path},
    index,
    layers::PAGE_POLICY,
    problem::{Answer, Failure},
};
use crate::page::{self, PageFile};
use axum::{
    body::{Body, Bytes},
    http::{HeaderMap, HeaderValue, header},
    response::{IntoResponse, Response},
};
use serde::Deserialize;

/// The dashboard: jobs, workers, throughput. In a build without the page, the overview.
#[utoipa::path(get, path = "/", operation_id = "dashboard", tag = "pages", responses((status = 200, description = "The page", body = String, content_type = "text/html")))]
pub(super) async fn dashboard(headers: HeaderMap) -> Answer<Response> {
    match page::file("index.html") {
        Some(file) => send(file, REVALIDATE, &headers),
        None => Ok(index::about().await.into_response()),
    }
}

/// The page of a job, for every text that is a job's id: what becomes of the job is told by the page.
#[utoipa::path(get, path = "/jobs/{id}", operation_id = "jobPage", tag = "pages", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The page", body = String, content_type = "text/html")))]
pub(super) async fn job(JobInPath(job): JobInPath, headers: HeaderMap) -> Answer<Response> {
    match page::file("job.html") {
        Some(file) => send(file, REVALIDATE, &headers),
        None => Ok(index::job_without_page(job).into_response()),
    }
}

/// The path within `assets/`.
#[derive(Debug, Deserialize)]
pub(super) struct AssetPath {
    path: String,
}

/// A file that the page loads.
#[utoipa::path(get, path = "/assets/{path}", operation_id = "pageAsset", tag = "pages", params(("path" = String, Path, description = "The file's name")),
    responses((status = 200, description = "The file, of its own media type", content_type = "*/*", body = Vec<u8>)))]
pub(super) async fn asset(Path(AssetPath { path }): Path<AssetPath>, headers: HeaderMap) -> Answer<Response> {
    send(find(&format!("assets/{path}"))?, IMMUTABLE, &headers)
}

/// The viewer as a library for other pages.
#[utoipa::path(get, path = "/kiln-viewer.js", operation_id = "viewerLibrary", tag = "pages",
    responses((status = 200, description = "An ES module that defines `<kiln-viewer>`", body = String, content_type = "text/javascript")))]
pub(super) async fn library(headers: HeaderMap) -> Answer<Response> {
    send(find("kiln-viewer.js")?, REVALIDATE, &headers)
}

/// The viewer's page by itself, as `kiln view` serves it.
pub(super) async fn viewer(headers: HeaderMap) -> Answer<Response> {
    send(find("viewer.html")?, REVALIDATE, &headers)
}

fn find(path: &str) -> Answer<&'static PageFile> {
    page::file(path).ok_or_else(|| Failure::new(Kind::NotFound, "the page has no file of this name"))
}

fn send(file: &'static PageFile, keep: &'static str, asked: &HeaderMap) -> Answer<Response> {
    let packed = if takes_gzip(asked) { file.gzip() } else { None };
    let mark = if packed.is_some() { "-gzip" } else { "" };
    let etag = strong_etag(&format!("{}{mark}", file.sha256));
    let mut headers = match whole(&etag, keep, asked)? {
        Ok(headers) => headers,
        Err(held) => return Ok((common(), held).into_response()),
    };
    headers.extend(common());
    let bytes = packed.unwrap_or(&file.bytes);
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(file.media_type));
    if packed.is_some() {
        headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static("gzip"));
    }
    Ok((headers, Body::from(Bytes::from_static(bytes))).into_response())
}

/// What every answer about a file of the page carries.
fn common() -> HeaderMap {
    [(header::VARY, HeaderValue::from_static("accept-encoding")), (header::CONTENT_SECURITY_POLICY, PAGE_POLICY)].into_iter().collect()
}

/// Whether the client takes gzip (RFC 9110, section 12.5.3): named, or meant by `*`, and not with weight 0.
fn takes_gzip(headers: &HeaderMap) -> bool {
    let values = headers.get_all(header::ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    let codings: Vec<(&str, bool)> = values.flat_map(|value| value.split(',')).map(coding).collect();
    let says = |name: &str| codings.iter().find(|(coding, _)| coding.eq_ignore_ascii_case(name)).map(|(_, welcome)| *welcome);
    says("gzip").or_else(|| says("*")).unwrap_or(false)
}

/// A coding and whether it is welcome.
fn coding(part: &str) -> (&str, bool) {
    let (name, weight) = part.split_once(';').unwrap_or((part, "q=1"));
    let weight = weight.trim().trim_start_matches(['q', 'Q']).trim_start().trim_start_matches('=').trim();
    (name.trim(), weight.parse::<f32>().is_ok_and(|weight| weight > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gzip_is_sent_to_those_who_take_it() {
        for (text, expected) in [
            ("gzip, deflate, br", true),
            ("br;q=1.0, GZIP;q=0.8", true),
            ("*", true),
            ("br", false),
            ("gzip;q=0, *", false),
            ("gzip; q=0.000", false),
            ("gzipped", false),
            ("", false),
        ] {
            let headers = [(header::ACCEPT_ENCODING, text.parse().unwrap())].into_iter().collect();
            assert_eq!(takes_gzip(&headers), expected, "{text}");
        }
        assert!(!takes_gzip(&HeaderMap::new()));
    }
}
