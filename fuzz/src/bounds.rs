//! How much memory a parser takes: a counting allocator, and a bound.
//!
//! At no moment may a parser hold more than four times its input, what is declared in it, and a base for tables and decoders that does not
//! grow with anything. That holds for all inputs of fuzzing (64 KiB at most, so the base is most of it), for scenes of megabytes as
//! programs write them, and for dense lists of a few megabytes. It does not hold for whatever can be made up. Beyond the base these take
//! more times their text: triangles of OBJ between vertices below 10 and numbers of one digit in the JSON of glTF a little more, names that
//! are used once and smoothing groups over such triangles several times as much, empty nodes of glTF and of X3D, whose number has a limit,
//! ten times as much and more. Copies by instances of prototypes and by nodes that share a mesh are made of no text at all. What holds for
//! all of them are the limits of the design: bytes of text, nodes, triangles, pixels.
//!
//! Counting in the allocator sees what a parser really asks for, before the system has any of it; a limit on the process would see only
//! what was touched, and end the run instead of naming the input.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicUsize, Ordering::Relaxed},
};

/// Bytes beside input and images: tables of a node type each, states of decompressors, buffers of readers.
const BASE: u64 = 8 << 20;
/// Bytes per byte of input.
const FACTOR: u64 = 4;

/// The system's allocator, counting.
pub struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn grow(bytes: usize) {
    let held = HELD.fetch_add(bytes, Relaxed).wrapping_add(bytes);
    PEAK.fetch_max(held, Relaxed);
}

// SAFETY: every call goes to the system's allocator with the caller's own arguments; counting touches no memory of theirs.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the pointer came from the system's allocator with this layout, as all of ours do.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        grow(size);
        HELD.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the pointer came from the system's allocator with this layout, and the caller vouches for the size.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Runs a parser; the most bytes that it held at once. Right only while nothing else in the process allocates.
pub fn peak(run: impl FnOnce()) -> u64 {
    let before = HELD.load(Relaxed);
    PEAK.store(before, Relaxed);
    run();
    PEAK.load(Relaxed).saturating_sub(before) as u64
}

/// The most bytes that a parser may hold for an input that declares `images` bytes of images and packed text.
pub fn allowed(input: &[u8], images: u64) -> u64 {
    (FACTOR * input.len() as u64).saturating_add(images).saturating_add(BASE)
}
