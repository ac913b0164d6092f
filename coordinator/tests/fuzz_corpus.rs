//! The corpus of every fuzz target, replayed: what once was found stays mended, and no parser takes more memory than it may.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "../../fuzz/src/bounds.rs"]
#[allow(unreachable_pub)] // The fuzz crate is where it is public.
mod bounds;
#[path = "fuzz_corpus/large.rs"]
mod large;

use kiln_coordinator::fuzzing::{TARGETS, find};
use std::{collections::BTreeSet, path::PathBuf};

#[global_allocator]
static ALLOCATOR: bounds::Counting = bounds::Counting;

fn fuzz_folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fuzz")
}

/// The inputs of a target, in the order of their names.
fn corpus(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = fuzz_folder().join("corpus").join(target);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

/// The count of memory is that of the whole process: the other test does next to nothing beside this one. Each input is also cut short,
/// which is what uploads do. Inputs of a corpus are small beside the base of the bound, so files of megabytes go before.
#[test]
fn no_parser_panics_or_takes_more_memory_than_it_may() {
    assert!(bounds::peak(|| drop(std::hint::black_box(vec![1u8; 3 << 20]))) >= 3 << 20, "memory is not counted");
    let mut missed = vec![];
    for (name, input) in large::inputs() {
        let target = find(name).unwrap();
        let peak = bounds::peak(|| (target.run)(&input));
        if peak > bounds::allowed(&input, 0) {
            missed.push(format!("{name}, large: {peak} bytes at once for {} of input", input.len()));
        }
    }
    for target in TARGETS {
        let inputs = corpus(target.name);
        assert!(!inputs.is_empty(), "{} has no corpus", target.name);
        // Tables are made once, for all inputs.
        (target.run)(&inputs[0].1);
        for (path, whole) in inputs {
            for length in [whole.len(), whole.len() / 2, whole.len().saturating_sub(1)] {
                let input = &whole[..length];
                let peak = bounds::peak(|| (target.run)(input));
                let allowed = bounds::allowed(input, (target.images)(input));
                if peak > allowed {
                    missed.push(format!("{}, first {length} bytes: {peak} bytes at once; {allowed} are allowed", path.display()));
                }
            }
        }
    }
    assert_eq!(missed, [""; 0]);
}

#[test]
fn the_list_of_targets_is_the_list_of_fuzz_targets() {
    let names: BTreeSet<String> = TARGETS.iter().map(|t| t.name.to_owned()).collect();
    let files = std::fs::read_dir(fuzz_folder().join("fuzz_targets")).unwrap();
    let files: BTreeSet<String> = files.map(|f| f.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    let folders = std::fs::read_dir(fuzz_folder().join("corpus")).unwrap();
    let folders: BTreeSet<String> = folders.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!((&files, &folders), (&names, &names));
}
