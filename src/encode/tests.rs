use super::*;
use crate::package::fixture;
use kiln_proto::settings::{Rule, RuleName, WalkMode};
use std::{collections::BTreeMap, fs};

fn args(package: &Path, out: &Path) -> Args {
    let rule = RuleArgs { rule: None, eps: None, threshold: None, walk: None };
    Args { package: package.into(), output: out.into(), codec: None, rule, raw: None }
}

fn encode(args: &Args) -> Result<(), ToolError> {
    run(args, false, &mut vec![])
}

fn files(dir: &Path) -> BTreeMap<String, Vec<u8>> {
    let read = |folder: &Path| {
        let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file());
        entries.map(|p| (p.strip_prefix(dir).unwrap().display().to_string(), fs::read(&p).unwrap())).collect::<Vec<_>>()
    };
    read(dir).into_iter().chain(read(&dir.join("surfaces"))).collect()
}

/// Every file, `scene.kiln` and the manifest included, is the one that a bake with the new settings makes.
#[test]
fn encoding_again_is_baking_again() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fixture::bake(&at("f32"), fixture::settings(Rule::Bounded { eps: 2 }, Some(RawFormat::F32)));
    fixture::bake(&at("u8"), fixture::settings(Rule::Bounded { eps: 2 }, Some(RawFormat::U8)));
    let thesis = Rule::Thesis { threshold: 0 };
    for (k, (from, rule, raw, walk)) in [
        ("f32", thesis, None, None),
        ("f32", Rule::Cumulative { threshold: 9 }, Some(RawFormat::U8), Some(WalkMode::Phi)),
        ("f32", Rule::Bounded { eps: 2 }, Some(RawFormat::F32), None),
        ("u8", thesis, Some(RawFormat::U8), Some(WalkMode::Theta)),
        ("u8", Rule::Bounded { eps: 1 }, None, None),
    ]
    .into_iter()
    .enumerate()
    {
        let mut settings = fixture::settings(rule, raw);
        settings.walk = walk.unwrap_or_default();
        let (baked, encoded) = (at(&format!("baked{k}")), at(&format!("encoded{k}")));
        fixture::bake(&baked, settings);
        let mut args = Args { raw, ..args(&at(from), &encoded) };
        args.rule.walk = walk;
        match rule {
            Rule::Thesis { threshold } => (args.rule.rule, args.rule.threshold) = (Some(RuleName::Thesis), Some(threshold)),
            Rule::Cumulative { threshold } => (args.rule.rule, args.rule.threshold) = (Some(RuleName::Cumulative), Some(threshold)),
            Rule::Bounded { eps: 2 } => {}
            Rule::Bounded { eps } => args.rule.eps = Some(eps),
        }
        encode(&args).unwrap();
        let (baked, encoded) = (files(&baked), files(&encoded));
        assert!(baked.keys().eq(encoded.keys()));
        assert_eq!(fs::read_dir(at(&format!("encoded{k}"))).unwrap().count(), 3, "the staging folder is gone");
        let differing: Vec<_> = baked.iter().filter(|(name, bytes)| encoded[*name] != **bytes).map(|(name, _)| name).collect();
        assert!(differing.is_empty(), "{from} to {rule}: {differing:?}");
    }
}

/// Holes are filled anew from what the new encoding keeps, and stay listed.
#[test]
fn a_package_with_holes_keeps_them() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let settings = |eps, raw| fixture::settings(Rule::Bounded { eps }, raw);
    fixture::bake_around(&at("from"), settings(2, Some(RawFormat::F32)), [&[1], &[0]]);
    fixture::bake_around(&at("baked"), settings(1, Some(RawFormat::U8)), [&[1], &[0]]);
    let mut args = Args { raw: Some(RawFormat::U8), ..args(&at("from"), &at("encoded")) };
    args.rule.eps = Some(1);
    encode(&args).unwrap();
    assert!(files(&at("baked")) == files(&at("encoded")));
}

#[test]
fn what_cannot_be_encoded_is_refused_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fixture::bake(&at("none"), fixture::settings(Rule::default(), None));
    fixture::bake(&at("u8"), fixture::settings(Rule::default(), Some(RawFormat::U8)));
    let refusal = |args: Args| {
        let error = encode(&args).unwrap_err();
        (error.is_usage(), error.to_string())
    };
    let (usage, text) = refusal(args(&at("none"), &at("out")));
    assert!(!usage && text.contains("keeps no raw radiance"), "{text}");
    let (usage, text) = refusal(Args { raw: Some(RawFormat::F32), ..args(&at("u8"), &at("out")) });
    assert!(usage && text.contains("8 bits only"), "{text}");
    let (usage, text) = refusal(Args {
        rule: RuleArgs { rule: Some(RuleName::Thesis), eps: Some(1), threshold: None, walk: None },
        ..args(&at("u8"), &at("out"))
    });
    assert!(usage && text.contains("eps"), "{text}");
    let (usage, text) = refusal(args(&at("u8"), &at("none")));
    assert!(usage && text.contains("not empty"), "{text}");
    assert!(!at("out").exists());
    fs::write(at("u8/surfaces/lamp.mtex"), "short").unwrap();
    let (usage, text) = refusal(args(&at("u8"), &at("out")));
    assert!(!usage && text.contains("lamp.mtex") && !at("out").exists(), "{text}");
}

/// Fresh hashes over damaged light would make it whole for ever.
#[test]
fn damaged_raw_is_not_encoded() {
    let dir = tempfile::tempdir().unwrap();
    let (from, to) = (dir.path().join("from"), dir.path().join("to"));
    for raw in [RawFormat::F32, RawFormat::U8] {
        fixture::bake(&from, fixture::settings(Rule::default(), Some(raw)));
        fixture::flip(&from.join("surfaces/wall.mtex"));
        let error = encode(&args(&from, &to)).unwrap_err();
        let text = kiln_proto::chain(&error);
        assert!(!error.is_usage() && text.contains("surfaces/wall.mtex") && text.contains("checksum"), "{text}");
        assert!(!to.exists());
    }
}
