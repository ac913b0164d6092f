//! The page over HTTP: which files, under which headers.

use super::*;
use crate::page;
use kiln_proto::ids::JobId;

#[cfg(feature = "page")]
impl Bench {
    async fn ask(&self, path: &str, headers: &[(header::HeaderName, &str)]) -> Reply {
        let request = headers.iter().fold(Request::get(path), |request, (name, value)| request.header(name, *value));
        self.send(request.body(Body::empty()).unwrap()).await
    }
}

#[tokio::test]
async fn the_overview_is_plain_and_links_what_is_there() {
    let bench = Bench::new().await;
    let reply = bench.get("/about").await;
    let text = String::from_utf8(reply.body.to_vec()).unwrap();
    assert!(text.contains("/openapi.json") && text.contains("/problems/busy") && !text.contains("<script"), "{text}");
    assert!(!reply.headers[header::CONTENT_SECURITY_POLICY].to_str().unwrap().contains("'self'"));
}

#[tokio::test]
async fn what_is_no_job_and_no_file_is_a_problem() {
    let bench = Bench::new().await;
    assert_eq!(bench.get("/jobs/nonsense").await.problem().1, "unknown-job");
    for path in ["/assets/none-such.js", "/assets/../index.html", "/assets/%2e%2e/index.html", "/assets//etc/passwd"] {
        assert_eq!(bench.get(path).await.problem().1, "not-found", "{path}");
    }
}

#[tokio::test]
#[cfg(feature = "page")]
async fn pages_are_asked_for_again_and_hashed_files_kept() {
    let bench = Bench::new().await;
    let asset = page::viewer().into_iter().find_map(|(path, _)| path.starts_with("assets/").then(|| format!("/{path}"))).unwrap();
    let job = format!("/jobs/{}", JobId::random());
    for (path, file, keep) in [
        ("/", "index.html", "no-cache"),
        (job.as_str(), "job.html", "no-cache"),
        ("/kiln-viewer.js", "kiln-viewer.js", "no-cache"),
        (&asset, asset.trim_start_matches('/'), "private, max-age=31536000, immutable"),
    ] {
        let reply = bench.get(path).await;
        let file = page::file(file).unwrap();
        assert_eq!((reply.status, &reply.body[..]), (StatusCode::OK, &*file.bytes), "{path}");
        assert_eq!(reply.headers[header::CACHE_CONTROL], keep, "{path}");
        assert_eq!(reply.headers[header::CONTENT_TYPE], file.media_type, "{path}");
        let policy = reply.headers[header::CONTENT_SECURITY_POLICY].to_str().unwrap();
        assert!(policy.contains("script-src 'self';") && !policy.contains("unsafe"), "{policy}");
        assert_eq!(reply.headers.get_all(header::CONTENT_SECURITY_POLICY).iter().count(), 1);
        assert_eq!(reply.headers["cross-origin-resource-policy"], "same-origin");
        let held = bench.ask(path, &[(header::IF_NONE_MATCH, reply.headers[header::ETAG].to_str().unwrap())]).await;
        assert_eq!((held.status, held.body.len()), (StatusCode::NOT_MODIFIED, 0), "{path}");
    }
}

#[tokio::test]
#[cfg(feature = "page")]
async fn the_compressed_form_has_a_tag_of_its_own() {
    let bench = Bench::new().await;
    let (largest, _) = page::viewer().into_iter().max_by_key(|(_, file)| file.bytes.len()).unwrap();
    let path = format!("/{largest}");
    let plain = bench.get(&path).await;
    let packed = bench.ask(&path, &[(header::ACCEPT_ENCODING, "br, gzip")]).await;
    assert_eq!(packed.headers[header::CONTENT_ENCODING], "gzip");
    assert_eq!(packed.headers[header::VARY], "accept-encoding");
    assert_ne!(plain.headers[header::ETAG], packed.headers[header::ETAG]);
    let mut unpacked = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&*packed.body), &mut unpacked).unwrap();
    assert_eq!(unpacked, plain.body);
    let tag = plain.headers[header::ETAG].to_str().unwrap();
    let other = bench.ask(&path, &[(header::ACCEPT_ENCODING, "gzip"), (header::IF_NONE_MATCH, tag)]).await;
    assert_eq!(other.status, StatusCode::OK);
    let refused = bench.ask(&path, &[(header::IF_MATCH, "\"other\"")]).await;
    assert_eq!(refused.problem().1, "precondition-failed");
}

#[tokio::test]
#[cfg(not(feature = "page"))]
async fn a_build_without_the_page_says_so() {
    let bench = Bench::new().await;
    assert_eq!(bench.get("/").await.body, bench.get("/about").await.body);
    assert!(page::viewer().is_empty());
    let job = JobId::random();
    let text = String::from_utf8(bench.get(&format!("/jobs/{job}")).await.body.to_vec()).unwrap();
    assert!(text.contains("no page") && text.contains(&format!("/v1/jobs/{job}\"")), "{text}");
    assert_eq!(bench.get("/kiln-viewer.js").await.problem().1, "not-found");
}
