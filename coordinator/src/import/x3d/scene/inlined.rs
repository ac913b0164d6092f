//! Files of other formats that an X3D scene inlines: each is imported as if it stood alone, then put in its place.

use super::walk::{Placed, World};
use crate::import::{Bundle, findings::Findings, import_file};
use kiln_proto::{options::ImportOptions, scene::Scene};

/// The scenes of all inlined files, in the order of the walk; a file that stands in several places is imported for each.
pub(super) fn read<'w, 'd>(
    bundle: &Bundle,
    world: &'w World<'d>,
    options: &ImportOptions,
    findings: &mut Findings,
) -> Vec<(&'w Placed<'d>, Scene)> {
    let mut scenes = vec![];
    for (placed, path) in &world.files {
        if let Some(scene) = import_file(bundle, path, options, findings) {
            scenes.push((placed, scene));
        }
    }
    scenes
}
