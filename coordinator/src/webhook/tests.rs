//! Which addresses are allowed, and what is signed.

use super::*;

const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

fn webhooks(allow: &[&str]) -> Webhooks {
    let allow = allow.iter().map(|text| text.parse().unwrap()).collect();
    Webhooks { allow, secret: Some(Secret::parse(SECRET).unwrap()) }
}

/// The example of the specification's own libraries.
#[test]
fn signatures_are_those_of_standard_webhooks() {
    let signed = Secret::parse(SECRET).unwrap().sign("msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, br#"{"test": 2432232314}"#);
    assert_eq!(signed, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    let bare = Secret::parse(SECRET.trim_start_matches("whsec_")).unwrap();
    assert_eq!(bare.sign("a", 1, b"x"), Secret::parse(SECRET).unwrap().sign("a", 1, b"x"));
}

#[test]
fn secrets_that_are_none_are_refused_without_being_told() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let config = WebhookConfig { allow: vec!["a.example".into()], secret_file: Some(file.path().to_owned()) };
    for bad in ["", "hunter2", "whsec_aGVsbG8="] {
        std::fs::write(file.path(), bad).unwrap();
        let said = Webhooks::open(&config).err().unwrap().message;
        assert!(said.starts_with("webhooks.secret_file") && said.contains("openssl") && (bad.is_empty() || !said.contains(bad)), "{said}");
    }
    std::fs::write(file.path(), format!("{SECRET}\n")).unwrap();
    assert!(Webhooks::open(&config).unwrap().check("https://a.example/x").is_ok());
    let missing = WebhookConfig { secret_file: Some("/nonexistent".into()), ..config.clone() };
    assert!(Webhooks::open(&missing).err().unwrap().message.contains("/nonexistent"));
    assert_eq!(config.check(), []);
    let problems = WebhookConfig { allow: vec!["a.example".into(), "b c".into()], secret_file: None }.check();
    assert_eq!(problems.len(), 2, "{problems:?}");
}

#[test]
fn only_what_is_allowed_is_taken() {
    let hooks = webhooks(&["CI.example", "10.0.0.5:9000", "[::1]:81", "bücher.example:443"]);
    for good in [
        "https://ci.example/kiln?token=x",
        "http://CI.EXAMPLE/",
        "https://ci.example:443/",
        "http://10.0.0.5:9000",
        "http://[0:0::1]:81/",
        "https://xn--bcher-kva.example/",
        "http://bücher.example:443/",
    ] {
        assert_eq!(hooks.check(good).map(|_| ()), Ok(()), "{good}");
    }
    for (bad, place) in [
        ("https://ci.example:8443/", "ci.example:8443"),
        ("http://ci.example.evil.example/", "ci.example.evil.example"),
        ("http://ci.example.", "ci.example."),
        ("http://10.0.0.5/", "10.0.0.5"),
        // Whatever the spelling, the parser's host counts.
        ("http://167772165:9001/", "10.0.0.5:9001"),
        ("http://ci.example\\@evil.example/", ""),
        ("http://evil.example#@ci.example/", "evil.example"),
        ("http://169.254.169.254/latest/meta-data", "169.254.169.254"),
        ("http://bücher.example/", "xn--bcher-kva.example"),
    ] {
        match hooks.check(bad) {
            Err(BadWebhook::NotAllowed(found)) => assert_eq!(found, place, "{bad}"),
            // A backslash is a slash to the parser: the host is the allowed one.
            Ok(url) => assert!(place.is_empty() && url.host_str() == Some("ci.example"), "{bad} was read as {url}"),
            other => panic!("{bad}: {other:?}"),
        }
    }
    for bad in ["ftp://ci.example/", "file:///etc/passwd", "https://user@ci.example/", "https://:pass@ci.example/"] {
        assert!(matches!(hooks.check(bad), Err(BadWebhook::Kind(_))), "{bad}");
    }
    assert!(matches!(hooks.check(&format!("https://ci.example/{}", "x".repeat(2_000))), Err(BadWebhook::Kind(_))));
    for bad in ["", "ci.example", "https://", "//ci.example/"] {
        assert!(matches!(hooks.check(bad), Err(BadWebhook::NoUrl(_))), "{bad}");
    }
}

#[test]
fn without_configuration_nothing_is_sent_and_the_message_says_what_to_configure() {
    let off = Webhooks::open(&WebhookConfig::default()).unwrap().check("https://ci.example/").unwrap_err();
    assert!(off == BadWebhook::Off && off.to_string().contains("--webhook-allow") && off.to_string().contains("--webhook-secret-file"));
    let other = webhooks(&["ci.example"]).check("http://other.example:81/").unwrap_err().to_string();
    assert!(other.contains("--webhook-allow other.example:81"), "{other}");
}

#[test]
fn places_are_hosts_with_or_without_a_port() {
    for bad in [
        "",
        ":80",
        "a b",
        "https://a.example",
        "a.example/x",
        "user@a.example",
        "a.example:",
        "a.example:99999",
        "::1",
        "a.example?x",
        "a.example#x",
    ] {
        assert!(bad.parse::<Place>().is_err(), "{bad}");
    }
    for good in ["a.example", "a.example:80", "[::1]", "[::1]:8080", "127.0.0.1", "LOCALHOST:1"] {
        assert!(good.parse::<Place>().is_ok(), "{good}");
    }
}
