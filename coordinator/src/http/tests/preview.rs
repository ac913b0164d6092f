//! Pictures of a package that is really there: imported, planned and assembled; every texel is grey.

use super::*;
use crate::{
    engine::{PictureError, tests::real},
    http::{Kind, preview::failure},
    preview::{Stop, Stopped, View},
};
use kiln_proto::ids::JobId;

async fn view(bench: &Bench, job: &str, query: &str) -> Reply {
    bench.get(&format!("/v1/jobs/{job}/preview.png{query}")).await
}

async fn with_tag(bench: &Bench, path: &str, name: header::HeaderName, tag: &str) -> Reply {
    bench.send(Request::get(path).header(name, tag).body(Body::empty()).unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_has_a_picture_when_it_is_done() {
    let bench = Bench::new().await;
    let job = real::submit(&bench.engine).await;
    let early = view(&bench, &job.to_string(), "").await.problem();
    assert_eq!((early.0, early.1.as_str()), (409, "job-not-done"));
    real::bake(&bench.engine, job).await;
    let job = job.to_string();
    the_picture_shows_the_floor(&bench, &job).await;
    tags_name_package_view_and_renderer(&bench, &job).await;
    bad_parameters_are_named(&bench, &job).await;
    a_head_is_answered_without_the_picture(&bench, &job).await;
    a_service_that_stops_makes_no_pictures(&bench, &job).await;
}

async fn a_head_is_answered_without_the_picture(bench: &Bench, job: &str) {
    // The eye is where the default target is, which only whoever makes the picture finds out.
    let path = format!("/v1/jobs/{job}/preview.png?eye=2,1,-2");
    let head = bench.send(Request::head(&path).body(Body::empty()).unwrap()).await;
    assert_eq!((head.status, &head.headers[header::CONTENT_TYPE], head.body.len()), (StatusCode::OK, &"image/png".parse().unwrap(), 0));
    assert!(head.headers.contains_key(header::ETAG) && bench.get(&path).await.status == StatusCode::BAD_REQUEST);
}

async fn a_service_that_stops_makes_no_pictures(bench: &Bench, job: &str) {
    let closing = CancellationToken::new();
    closing.cancel();
    let router = App::new(Arc::clone(&bench.engine), HostPolicy::Loopback, None, closing).router();
    let path = format!("/v1/jobs/{job}/preview.png?eye=5,5,5&w=8&h=8");
    let reply = send(&router, Request::get(path).body(Body::empty()).unwrap()).await;
    assert_eq!((reply.problem().1.as_str(), &reply.headers[header::RETRY_AFTER]), ("busy", &"2".parse().unwrap()));
}

async fn the_picture_shows_the_floor(bench: &Bench, job: &str) {
    // The floor spans x from 0 to 4 and z from 0 to -4; from above and off the lamp, at (3, 0, -3.8), nothing is in the way.
    let reply = view(bench, job, "?eye=3.5,3,0&target=3.5,0,-0.5&w=64&h=48").await;
    assert_eq!((reply.status, &reply.headers[header::CONTENT_TYPE]), (StatusCode::OK, &"image/png".parse().unwrap()));
    assert_eq!(reply.headers[header::CACHE_CONTROL], "private, max-age=3600");
    let picture = image::load_from_memory(&reply.body).unwrap().to_rgb8();
    assert_eq!((picture.dimensions(), picture.get_pixel(32, 24).0), ((64, 48), [90; 3]));
    let away = view(bench, job, "?eye=0,1,9&target=0,1,99&w=4&h=4").await;
    let picture = image::load_from_memory(&away.body).unwrap().to_rgb8();
    assert!(picture.pixels().all(|p| p.0 == [0x20, 0x24, 0x28]), "nothing but background");
    let brighter = view(bench, job, "?eye=3.5,3,0&target=3.5,0,-0.5&w=4&h=4&exposure=1&mode=diffuse").await;
    let picture = image::load_from_memory(&brighter.body).unwrap().to_rgb8();
    let twice = kiln_proto::units::radiance_to_byte(kiln_proto::units::byte_to_radiance(90, 1.0), 2.0);
    assert_eq!(picture.get_pixel(2, 2).0, [twice; 3]);
}

async fn tags_name_package_view_and_renderer(bench: &Bench, job: &str) {
    let path = format!("/v1/jobs/{job}/preview.png?eye=1,2,3&w=8&h=8");
    let first = bench.get(&path).await;
    let tag = first.headers[header::ETAG].to_str().unwrap().to_owned();
    assert!(tag.len() == 66 && tag.starts_with('"'), "{tag}");
    let held = with_tag(bench, &path, header::IF_NONE_MATCH, &tag).await;
    assert_eq!((held.status, held.body.len(), &held.headers[header::ETAG]), (StatusCode::NOT_MODIFIED, 0, &first.headers[header::ETAG]));
    assert_eq!(with_tag(bench, &path, header::IF_MATCH, "\"other\"").await.problem().0, 412);
    // The same view in other words is the same picture; another view is not.
    let same = view(bench, job, "?h=8&eye=%2B1.0,2e0,3.00&w=08&fov=45&mode=light-field").await;
    assert_eq!((&same.headers[header::ETAG], &same.body), (&first.headers[header::ETAG], &first.body));
    for other in ["h=9", "h=8&eye=1,2,3.1", "h=8&mode=diffuse", "h=8&antialias=1", "h=8&hide_environment=true"] {
        let eye = if other.contains("eye") { "" } else { "&eye=1,2,3" };
        let seen = view(bench, job, &format!("?w=8&{other}{eye}")).await;
        assert_ne!(seen.headers[header::ETAG], first.headers[header::ETAG], "{other}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_deleted_while_its_picture_is_made_is_unknown() {
    let bench = Bench::new().await;
    let job = real::submit(&bench.engine).await;
    real::bake(&bench.engine, job).await;
    let app = App::new(Arc::clone(&bench.engine), HostPolicy::Loopback, None, CancellationToken::new());
    let package = bench.engine.stored_package(job).await.unwrap();
    std::fs::remove_dir_all(bench.folder.path().join("data/blobs")).unwrap();
    let make = || package.picture(&View::default(), &Stop::default()).unwrap_err();
    let lost = tokio::task::block_in_place(make);
    assert_eq!(failure(&app, job, lost).await.kind(), Kind::Internal, "of a job that is there, that is our fault");
    bench.engine.delete_job(job).await.unwrap();
    let gone = tokio::task::block_in_place(make);
    assert_eq!(failure(&app, job, gone).await.kind(), Kind::UnknownJob);
    let late = failure(&app, job, PictureError::Stopped(Stopped::Late)).await;
    assert!(late.kind() == Kind::Busy && late.detail().contains("fewer pixels"), "{late}");
}

/// As many live views as are answered at a time, and as many as wait for it.
#[tokio::test(flavor = "multi_thread")]
async fn live_views_beyond_those_that_wait_are_told_to_come_back() {
    let bench = Bench::new().await;
    let job = real::submit(&bench.engine).await;
    let app = App::new(Arc::clone(&bench.engine), HostPolicy::Loopback, None, CancellationToken::new());
    let router = app.clone().router();
    let mut waiting: Vec<_> = (0..20).map(|_| Box::pin(app.live.leave())).collect();
    let mut held = Vec::new();
    for one in &mut waiting {
        held.push(futures_util::poll!(one.as_mut()));
    }
    assert_eq!(held.iter().filter(|one| one.is_ready()).count(), 4);
    let get = |path| send(&router, Request::get(path).body(Body::empty()).unwrap());
    let path = format!("/v1/jobs/{job}/segments?runs=0");
    assert_eq!(get(path.clone()).await.problem().1, "busy");
    drop((held, waiting));
    assert_eq!(get(path).await.status, StatusCode::OK);
}

async fn bad_parameters_are_named(bench: &Bench, job: &str) {
    for (query, field) in [
        ("?w=100000", "w"),
        ("?w=4096&h=4096", "h"),
        ("?h=0", "h"),
        ("?w=-5", "w"),
        ("?eye=nan,0,0", "eye"),
        ("?eye=0,inf,0", "eye"),
        ("?eye=1,2", "eye"),
        ("?eye=1,1,1&target=1,1,1", "eye"),
        ("?target=1e30,0,0", "target"),
        ("?fov=0", "fov"),
        ("?fov=NaN", "fov"),
        ("?exposure=99", "exposure"),
        ("?mode=dark", "mode"),
        ("?antialias=5", "antialias"),
        ("?hide_environment=perhaps", "hide_environment"),
        ("?w=2048&h=2048&antialias=2", "antialias"),
        ("?width=640", "width"),
        // The default target, which only the scene knows: the middle of its bounds.
        ("?eye=2,1,-2", "eye"),
    ] {
        let reply = view(bench, job, query).await;
        let (status, kind, detail) = reply.problem();
        assert_eq!((status, kind.as_str(), &reply.json()["field"]), (400, "invalid-request", &field.into()), "{query}: {detail}");
    }
    assert_eq!(view(bench, &JobId::random().to_string(), "").await.problem().1, "unknown-job");
}
