//! The viewer beside a package, and `kiln view`.

use crate::harness::{Server, announced, bake_room, fail, kiln, package, run, runtime, succeed};
use std::{
    io::{Read, Write},
    net::TcpStream,
    path::Path,
};
use tempfile::TempDir;

/// Whether `dir` holds the viewer and, in its place, a package that is true to its claims.
fn is_whole(dir: &Path) {
    let mut names: Vec<String> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["assets", "index.html", "kiln-viewer.js", "package"]);
    let assets = package(&dir.join("assets"));
    assert!(assets.keys().any(|name| name.ends_with(".js")), "{:?}", assets.keys());
    // What only the pages of the service load.
    assert!(!assets.keys().any(|name| name.starts_with("dashboard-") || name.starts_with("job-")), "{:?}", assets.keys());
    succeed(["inspect", "--verify", dir.join("package").to_str().unwrap()]);
}

#[test]
fn a_package_is_fetched_with_its_viewer() {
    let dir = TempDir::new().unwrap();
    let server = Server::start(&dir.path().join("data"), "127.0.0.1:0", &[]);
    let job = server.submit_room(&[]);
    let out = dir.path().join("site");
    let fetch = ["fetch", &job, "--server", &server.url, "--with-viewer", "-o", out.to_str().unwrap()];
    fail(1, &["job"], fetch);
    assert!(!out.exists(), "a fetch that failed leaves nothing");
    let _worker = server.worker(&[]);
    server.wait_for(&job, "the end", |r| r["state"] == "done");
    let output = run(fetch);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains(&format!("kiln view {}", out.display())), "{said}");
    is_whole(&out);
    fail(2, &["not empty"], fetch);
    let quiet = run(["--json", "fetch", &job, "--server", &server.url, "--with-viewer", "-o", dir.path().join("quiet").to_str().unwrap()]);
    assert!(quiet.status.success() && quiet.stderr.is_empty(), "{}", String::from_utf8_lossy(&quiet.stderr));
}

/// What a server says to a request written by hand: a client library would tidy `..` away before it is sent.
fn raw(url: &str, path: &str, host: &str) -> String {
    let address = url.trim_start_matches("http://").trim_end_matches('/');
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut said = Vec::new();
    stream.read_to_end(&mut said).unwrap();
    String::from_utf8_lossy(&said).into_owned()
}

#[test]
fn view_serves_a_package_and_nothing_else() {
    let dir = TempDir::new().unwrap();
    let site = dir.path().join("site");
    bake_room(&site, &["--with-viewer"]);
    is_whole(&site);
    std::fs::write(dir.path().join("secret"), "secret").unwrap();
    let files = package(&site.join("package"));
    for folder in [site.clone(), site.join("package")] {
        let (mut process, said) = announced(kiln(["--json", "view", folder.to_str().unwrap()]));
        let url = said["url"].as_str().unwrap().to_owned();
        let get = |path: &str, range: Option<&str>| {
            runtime().block_on(async {
                let request = reqwest::Client::new().get(format!("{url}{path}"));
                let request = range.map_or(request.try_clone().unwrap(), |range| request.header("range", range));
                let response = request.send().await.unwrap();
                (response.status().as_u16(), response.headers().clone(), response.bytes().await.unwrap().to_vec())
            })
        };
        let (status, headers, page) = get("", None);
        assert_eq!((status, &page), (200, &std::fs::read(site.join("index.html")).unwrap()));
        assert!(headers["content-security-policy"].to_str().unwrap().contains("script-src 'self'"));
        assert_eq!(get("package/manifest.json", None).2, files["manifest.json"]);
        let floor = &files["surfaces/floor.mtsp"];
        assert_eq!(&get("package/surfaces/floor.mtsp", None).2, floor);
        let (status, headers, part) = get("package/surfaces/floor.mtsp", Some("bytes=2-5"));
        assert_eq!((status, part.as_slice()), (206, &floor[2..6]));
        assert!(headers.contains_key("etag") && headers["x-content-type-options"] == "nosniff");

        let host = url.trim_start_matches("http://").trim_end_matches('/');
        for path in ["/package/../../secret", "/package/%2e%2e/%2e%2e/secret", "/package//etc/passwd", "/package/report.json", "/secret"] {
            let said = raw(&url, path, host);
            assert!(said.starts_with("HTTP/1.1 404"), "{path}: {said}");
        }
        assert!(raw(&url, "/", "kiln.evil.example").starts_with("HTTP/1.1 403"));
        process.terminate();
        assert!(process.wait().success());
    }
}

#[test]
fn view_sees_when_the_package_has_changed() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("package");
    bake_room(&folder, &["--seed", "1"]);
    let (_process, said) = announced(kiln(["--json", "view", folder.to_str().unwrap()]));
    let url = said["url"].as_str().unwrap();
    let tag = || {
        let said = raw(url, "/package/surfaces/floor.mtnc", "localhost");
        assert!(said.starts_with("HTTP/1.1 200"), "{said}");
        said.lines().find(|line| line.starts_with("etag:")).unwrap().to_owned()
    };
    let before = tag();
    assert_eq!(tag(), before);
    let other = dir.path().join("other");
    bake_room(&other, &["--seed", "2"]);
    // As `kiln fetch` does it: the manifest last.
    std::fs::remove_dir_all(&folder).unwrap();
    std::fs::rename(&other, &folder).unwrap();
    assert_ne!(tag(), before);
    let manifest = std::fs::read_to_string(folder.join("manifest.json")).unwrap();
    std::fs::write(folder.join("manifest.json"), manifest.replacen("\"schema\": 2", "\"schema\": 12", 1)).unwrap();
    let said = raw(url, "/package/surfaces/floor.mtnc", "localhost");
    assert!(said.starts_with("HTTP/1.1 404") && said.contains("schema version 12"), "{said}");
    fail(1, &["schema version 12"], ["view", folder.to_str().unwrap()]);
}

#[test]
fn view_follows_no_link_out_of_the_package() {
    let dir = TempDir::new().unwrap();
    let folder = dir.path().join("package");
    bake_room(&folder, &[]);
    let (inside, outside) = (folder.join("surfaces/floor.mtsp"), dir.path().join("elsewhere"));
    std::fs::rename(&inside, &outside).unwrap();
    std::os::unix::fs::symlink(&outside, &inside).unwrap();
    let (_process, said) = announced(kiln(["--json", "view", folder.to_str().unwrap()]));
    let url = said["url"].as_str().unwrap();
    assert!(raw(url, "/package/surfaces/floor.mtsp", "localhost").starts_with("HTTP/1.1 404"));
    assert!(raw(url, "/package/surfaces/floor.mtm", "localhost").starts_with("HTTP/1.1 200"));
}

#[test]
fn what_is_no_package_is_refused() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().to_str().unwrap();
    fail(1, &["manifest.json"], ["view", path]);
    std::fs::write(dir.path().join("manifest.json"), "{}").unwrap();
    fail(1, &["manifest.json", "schema"], ["view", path]);
    fail(2, &["loopback"], ["view", path, "--listen", "0.0.0.0:0"]);
}
