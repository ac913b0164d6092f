//! The light of what a band of rays sees, layer by layer: all texels that the layers looked up at once need, each read and decoded once, in
//! the order of the files.
//!
//! Needs are sorted by surface and texel and grouped into runs; each run is one positioned read per file. What a run yields goes into the
//! layers' own places, and each adds its four up in the footprint's order: the picture does not depend on how many threads there are.

use super::{
    RenderError,
    light::{Block, Light, SurfaceLight, TexelLight},
    stop::Stop,
    view::Mode,
    visibility::Seen,
};
use kiln_proto::{
    format::stream::{ReadError, Run},
    grid::Stencil,
    lookup::{self, Blend, DiffuseMean, Footprint},
    plan::Plan,
    units::Rgb,
};
use rayon::prelude::*;

/// Bytes that one read takes at most, about.
const READ: u64 = 1 << 20;
/// Texels that are read though nobody needs them, where that joins two runs: cheaper than another read.
const GAP: u64 = 16;

/// One texel that one layer needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Need {
    surface: u32,
    /// Column + width x row: below 2^26.
    texel: u32,
    /// 4 x layer + place in the footprint.
    slot: u32,
}

/// A texel's light toward one ray, with the slot that it belongs to.
type Found = (u32, Rgb);

/// The radiance of each layer toward the eye; `None` where the light field has nothing. Asks before each read whether to go on.
pub(super) fn shade(plan: &Plan, light: &mut Light<'_>, seen: &[Seen], mode: Mode, stop: &Stop) -> Result<Vec<Option<Rgb>>, RenderError> {
    let mut needs: Vec<Need> = seen.par_iter().enumerate().flat_map_iter(|(layer, seen)| needs_of(plan, layer, seen)).collect();
    needs.par_sort_unstable();
    let shader = Shader { stencils: stencils(plan, seen, mode), mean: DiffuseMean::new(plan.settings.directions), mode };
    let mut found: Vec<Option<Rgb>> = vec![None; 4 * seen.len()];
    for needs in needs.chunk_by(|a, b| a.surface == b.surface) {
        stop.check()?;
        let surface = light.surface(needs[0].surface as usize)?;
        let most = (READ / surface.texel_bytes()).max(1);
        let parts: Vec<&[Need]> = join(needs, most);
        let shaded = |part| {
            stop.check()?;
            shader.run(&surface, part).map_err(RenderError::from)
        };
        let parts = parts.into_par_iter().map(shaded).collect::<Result<Vec<_>, _>>()?;
        parts.into_iter().flatten().for_each(|(slot, rgb)| found[slot as usize] = Some(rgb));
    }
    let blend = |(seen, found): (&Seen, &[Option<Rgb>])| {
        let mut blend = Blend::default();
        for ((_, weight), light) in seen.footprint(plan).iter().zip(found) {
            if let Some(light) = light {
                blend.add(*light, *weight);
            }
        }
        blend.finish()
    };
    Ok(seen.par_iter().zip(found.par_chunks(4)).map(blend).collect())
}

fn needs_of(plan: &Plan, layer: usize, seen: &Seen) -> impl Iterator<Item = Need> + use<> {
    let (surface, footprint): (u32, Footprint) = (seen.surface, seen.footprint(plan));
    let need = move |k: usize| Need { surface, texel: footprint[k].0 as u32, slot: (4 * layer + k) as u32 };
    (0..4).filter(move |k| footprint[*k].1 > 0.0).map(need)
}

/// The directions of each layer, in the mode that asks for them.
fn stencils(plan: &Plan, seen: &[Seen], mode: Mode) -> Vec<Stencil> {
    match mode {
        Mode::LightField => seen.par_iter().map(|s| lookup::stencil(plan.settings.directions, s.toward)).collect(),
        Mode::Diffuse => vec![],
    }
}

/// Cuts sorted needs of one surface into parts that are each read at once.
fn join(needs: &[Need], most: u64) -> Vec<&[Need]> {
    let (mut parts, mut from) = (vec![], 0);
    for k in 1..=needs.len() {
        let ends = needs
            .get(k)
            .is_none_or(|need| u64::from(need.texel - needs[k - 1].texel) > GAP || u64::from(need.texel - needs[from].texel) >= most);
        if ends {
            parts.push(&needs[from..k]);
            from = k;
        }
    }
    parts
}

/// What every run is shaded with.
struct Shader {
    stencils: Vec<Stencil>,
    mean: DiffuseMean,
    mode: Mode,
}

impl Shader {
    /// The light of needs that lie close together.
    fn run(&self, surface: &SurfaceLight<'_>, needs: &[Need]) -> Result<Vec<Found>, ReadError> {
        let (first, last) = (u64::from(needs[0].texel), u64::from(needs[needs.len() - 1].texel));
        let block: Block<'_> = surface.read(Run { first, count: last - first + 1 })?;
        let mut found = Vec::with_capacity(needs.len());
        for same in needs.chunk_by(|a, b| a.texel == b.texel) {
            let Some(texel) = block.texel((u64::from(same[0].texel) - first) as usize)? else { continue };
            match self.mode {
                Mode::LightField => found.extend(same.iter().map(|need| (need.slot, self.toward(&texel, need.slot)))),
                Mode::Diffuse => {
                    let mean = self.mean.of(texel.all());
                    found.extend(same.iter().map(|need| (need.slot, mean)));
                }
            }
        }
        Ok(found)
    }

    fn toward(&self, texel: &TexelLight<'_>, slot: u32) -> Rgb {
        lookup::toward(&self.stencils[slot as usize / 4], |depth| texel.sample(depth))
    }
}
