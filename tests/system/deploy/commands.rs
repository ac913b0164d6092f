//! Every flag and every variable of Kiln in `deploy/` and in docs/operations.md is one that the program knows.

use super::{deployed, text};
use crate::harness::succeed;
use std::collections::{BTreeMap, BTreeSet};

const PAGE: &str = "docs/operations.md";
/// Commands that have commands.
const NESTED: [&str; 2] = ["token", "config"];

/// Calls of the program in a text: subcommand and flags. Shell, YAML lists, JSON lists and prose are read alike: what follows `kiln` up to
/// the end of the command.
fn calls(text: &str) -> Vec<(Vec<String>, Vec<String>)> {
    let joined = text.replace("\\\n", " ");
    let mut found = Vec::new();
    for line in joined.split(['\n', '`', ']', '|', ';', '#']) {
        let words: Vec<&str> = line.split(|c: char| c.is_whitespace() || "[,\"'()".contains(c)).filter(|word| !word.is_empty()).collect();
        for at in words.iter().enumerate().filter(|(_, word)| **word == "kiln" || word.ends_with("/kiln")).map(|(at, _)| at) {
            let rest = words[at + 1..].iter().take_while(|word| **word != "&&");
            let (flags, others): (Vec<&str>, Vec<&str>) = rest.copied().partition(|word| word.starts_with("--"));
            let flags = flags.iter().map(|flag| flag.split('=').next().unwrap().to_owned()).collect();
            let depth = if others.first().is_some_and(|command| NESTED.contains(command)) { 2 } else { 1 };
            found.push((others.into_iter().take(depth).map(str::to_owned).collect(), flags));
        }
    }
    found
}

/// The words of a help text.
fn words(help: &str) -> BTreeSet<String> {
    help.split(|c: char| !c.is_ascii_alphanumeric() && !"-_".contains(c)).map(str::to_owned).collect()
}

/// Help texts by subcommand; of those that have subcommands themselves, also theirs.
fn helps() -> BTreeMap<Vec<String>, BTreeSet<String>> {
    let listed = |args: &[&str]| {
        let help = succeed(args);
        let (_, list) = help.split_once("Commands:\n").unwrap();
        let list = list.lines().take_while(|line| !line.is_empty()).filter(|line| line.starts_with("  ") && !line.starts_with("   "));
        list.map(|line| line.split_whitespace().next().unwrap().to_owned()).filter(|name| name != "help").collect::<Vec<_>>()
    };
    let mut helps = BTreeMap::new();
    for command in listed(&["--help"]) {
        let nested = if NESTED.contains(&command.as_str()) { listed(&[&command, "--help"]) } else { Vec::new() };
        for name in nested {
            let help = words(&succeed([command.as_str(), &name, "--help"]));
            helps.insert(vec![command.clone(), name], help);
        }
        let help = words(&succeed([command.as_str(), "--help"]));
        helps.insert(vec![command], help);
    }
    helps
}

#[test]
fn deploy_names_only_flags_that_exist() {
    let helps = helps();
    let mut checked = 0;
    for path in deployed().iter().map(String::as_str).chain([PAGE]) {
        for (command, flags) in calls(&text(path)) {
            // Also where it is the name of something else, such as a user.
            let Some(help) = helps.get(&command).or_else(|| helps.get(command.get(..1)?)) else { continue };
            for flag in flags {
                assert!(help.contains(&flag), "{path}: `kiln {}` has no {flag}", command.join(" "));
                checked += 1;
            }
        }
    }
    assert!(checked > 20, "only {checked} flags were found");
    let all: BTreeSet<&String> = helps.values().flatten().collect();
    for word in text(PAGE).split('`').filter(|word| word.starts_with("--") && !word.contains('\n')) {
        let flag = word.split([' ', '=']).next().unwrap();
        assert!(all.contains(&flag.to_owned()), "{PAGE}: no command has {flag}");
    }
}

#[test]
fn deploy_names_only_variables_that_exist() {
    let mut known: BTreeSet<String> = helps().into_values().flatten().collect();
    known.extend(words(&text("coordinator/build.rs")));
    for path in deployed().iter().map(String::as_str).chain([PAGE]) {
        for word in words(&text(path)).iter().filter(|word| word.starts_with("KILN_")) {
            assert!(known.contains(word), "{path} sets {word}, which nothing reads");
        }
    }
}

#[test]
fn calls_are_found_in_every_notation() {
    let expected = (vec!["work".to_owned()], vec!["--threads".to_owned(), "--spool".to_owned()]);
    for text in [
        "exec kiln work --threads \"${N:-0}\" \\\n    --spool /x\nother --flag",
        "command: [kiln, work, --threads, \"4\", --spool=/x]  # --no",
        "ExecStart=/bin/sh -c 'exec /usr/local/bin/kiln work --threads \"$$N\" --spool /x'",
        "Use `kiln work --threads 4 --spool /x`, or `--nothing`.",
        "kiln work --threads 1 --spool /x && docker run --rm x",
    ] {
        assert!(calls(text).contains(&expected), "{text}: {:?}", calls(text));
    }
}
