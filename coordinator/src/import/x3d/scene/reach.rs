//! Which lights do not reach a shape: those that are not `global` shine on what hangs in their own group only (ISO/IEC 19775-1: 17.3.1).
//!
//! The answer is the same for all that stands in one group and is found once for it. Every surface carries a list of its own in the end,
//! and groups that use each other make millions of pairs of few nodes, so pairs are counted before any list is copied.

use super::walk::{Group, World};
use crate::import::findings::Findings;
use std::{
    collections::{BTreeMap, BTreeSet},
    rc::Rc,
};

/// Pairs of a surface and a light that may be listed, or of a group and a light that may be looked at; 64 MB of numbers.
const MAX_PAIRS: usize = 1 << 24;

/// The lights that do not reach a group, and what may still be listed.
pub(super) struct Reach<'w, 'd> {
    world: &'w World<'d>,
    /// Lights that are not global, with their groups.
    bound: Vec<(u32, Group)>,
    known: BTreeMap<Group, Rc<[u32]>>,
    left: usize,
}

/// The pairs are too many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the scene has more than {MAX_PAIRS} pairs of a shape and a light that shines on some shapes only, or whose shadows some shapes receive; \
     make such lights `global`, or list fewer of them in receiveShadows"
)]
pub(super) struct TooManyPairs;

impl<'w, 'd> Reach<'w, 'd> {
    pub(super) fn new(world: &'w World<'d>) -> Self {
        let lights = (0u32..).zip(&world.lights);
        let bound = lights.filter(|(_, l)| !l.node.bool("global")).map(|(index, l)| (index, l.group)).collect();
        Self { world, bound, known: BTreeMap::new(), left: MAX_PAIRS }
    }

    /// The indices of the lights that do not reach what stands in a group, ascending.
    pub(super) fn unlit_by(&mut self, group: Group) -> Result<Rc<[u32]>, TooManyPairs> {
        if self.bound.is_empty() {
            return Ok(Rc::default());
        }
        if let Some(known) = self.known.get(&group) {
            return Ok(Rc::clone(known));
        }
        self.take(self.bound.len())?;
        let around = self.world.around(group);
        let unlit = self.bound.iter().filter(|(_, of)| around.binary_search(of).is_err()).map(|(index, _)| *index).collect();
        let unlit: Rc<[u32]> = unlit;
        self.known.insert(group, Rc::clone(&unlit));
        Ok(unlit)
    }

    /// Says which lights reach nothing: they are not global, and their groups hold neither shapes nor files.
    pub(super) fn say_what_shines_on_nothing(&self, findings: &mut Findings) {
        if self.bound.is_empty() {
            return;
        }
        let world = self.world;
        let held = world.shapes.iter().chain(world.files.iter().map(|(placed, _)| placed)).map(|placed| placed.group);
        let held: BTreeSet<Group> = held.collect();
        let reached: BTreeSet<Group> = held.into_iter().flat_map(|group| world.around(group)).collect();
        for (index, _) in self.bound.iter().filter(|(_, group)| !reached.contains(group)) {
            let what = "lights that are not `global` and whose group has no shapes shine on nothing; make them `global`";
            findings.count(world.lights[*index as usize].node.at(), what);
        }
    }

    /// Counts pairs that somebody is about to list.
    pub(super) fn take(&mut self, pairs: usize) -> Result<(), TooManyPairs> {
        self.left = self.left.checked_sub(pairs).ok_or(TooManyPairs)?;
        Ok(())
    }
}
