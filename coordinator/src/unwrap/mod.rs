//! Unwrap: every surface gets a texture size and charts that do not overlap.
//!
//! The author's texture coordinates are used where they are usable ([`author`]): the second set, which is meant for light, before the
//! first; present everywhere, inside the unit square, without overlap at the resolution that is baked. Where only the places of their
//! charts are wrong (no room for gutters, mirrored), the charts are kept and packed anew. Otherwise charts are made ([`flat`], [`atlas`]):
//! a surface with vertex normals gets charts of neighbouring triangles where those are fewer than its flat polygons, because every cut
//! shows in a smooth highlight; a surface of flat triangles keeps its polygons apart unless joining them saves a third of the texels,
//! gutters included, as it does where triangles are hardly larger than texels. A surface of several parts whose coordinates do not fit
//! together is laid out part by part ([`parts`]). The back of a two-sided surface has the layout of its front, mirrored.

mod atlas;
mod author;
mod chart;
mod check;
mod flat;
mod pack;
mod parts;
mod raster;

use crate::records::Problem;
use kiln_proto::{
    limits,
    plan::{ChartSource, SurfacePlan},
    scene::{Scene, Surface},
    settings::{BakeSettings, TextureSize},
};

/// The surfaces of a scene laid out in their textures; `covered` and `tiles` of each plan are still empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// One plan per surface, in the scene's order.
    pub surfaces: Vec<SurfacePlan>,
    /// Where charts replaced the author's, or a size was bounded, and why.
    pub warnings: Vec<Problem>,
}

/// What the settings say of a surface's texture.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wanted {
    /// Exactly this size.
    Size(TextureSize),
    /// Texels per metre.
    Density(f64),
}

/// Charts in a texture.
#[derive(Debug, Clone, PartialEq)]
struct Charts {
    size: TextureSize,
    /// Per triangle.
    uv: Vec<[[f32; 2]; 3]>,
    /// Per triangle.
    charts: Vec<u32>,
}

/// Lays out all surfaces. Cost: linear in triangles and texels for the author's charts, n log n in polygons for packed ones, from ten
/// seconds to a minute for a million triangles of curved meshes.
///
/// # Errors
/// Sizes for surfaces that do not exist, textures beyond the limits, and sizes into which a surface's charts do not fit.
pub fn lay_out(scene: &Scene, settings: &BakeSettings) -> Result<Layout, Problem> {
    check_names(scene, settings)?;
    let mut plans: Vec<Option<SurfacePlan>> = vec![None; scene.surfaces.len()];
    let mut warnings = vec![];
    let mut texels = 0;
    let front_of = |s: &Surface| s.back_of.filter(|_| !settings.texture_sizes.contains_key(&s.name)).map(|front| front as usize);
    // Backs follow their fronts, wherever those stand.
    let (backs, fronts): (Vec<usize>, Vec<usize>) = (0..plans.len()).partition(|index| front_of(&scene.surfaces[*index]).is_some());
    for index in fronts.into_iter().chain(backs) {
        let surface = &scene.surfaces[index];
        let mirrored = front_of(surface).and_then(|front| plans[front].as_ref()).map(mirrored);
        let plan = match mirrored {
            Some(plan) => plan,
            None => parts::lay_out(scene, surface, wanted(surface, settings)?, &mut warnings)?,
        };
        texels += plan.size.texels();
        if texels > limits::JOB_TEXELS {
            return Err(too_many_texels(surface, texels, settings));
        }
        plans[index] = Some(plan);
    }
    Ok(Layout { surfaces: plans.into_iter().flatten().collect(), warnings })
}

/// The layout of a back: that of its front seen from behind. Its triangles have their second and third corners exchanged.
fn mirrored(front: &SurfacePlan) -> SurfacePlan {
    let turn = |[u, v]: [f32; 2]| [1.0 - u, v];
    let uv = front.uv.iter().map(|[a, b, c]| [turn(*a), turn(*c), turn(*b)]).collect();
    SurfacePlan { source: ChartSource::Front, uv, ..front.clone() }
}

fn wanted(surface: &Surface, settings: &BakeSettings) -> Result<Wanted, Problem> {
    let scale = f64::from(settings.texel_scale);
    let Some(size) = settings.texture_sizes.get(&surface.name) else {
        return Ok(Wanted::Density(f64::from(settings.texels_per_metre) * scale));
    };
    let side = |n: u32| (f64::from(n) * scale).round().max(1.0) as u32;
    let (width, height) = (side(size.width), side(size.height));
    TextureSize::new(width, height).map(Wanted::Size).map_err(|_| {
        let max = limits::TEXTURE_SIDE;
        Problem::new(format!(
            "surface `{}`: {size} scaled by {scale} is {width}x{height}; at most {max} texels a side are allowed",
            surface.name
        ))
    })
}

fn check_names(scene: &Scene, settings: &BakeSettings) -> Result<(), Problem> {
    const SHOWN: usize = 20;
    let Some(unknown) = settings.texture_sizes.keys().find(|name| scene.surface(name).is_none()) else { return Ok(()) };
    let mut known: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).take(SHOWN).collect();
    if scene.surfaces.len() > SHOWN {
        known.push("…");
    }
    Err(Problem::new(format!("texture_sizes names the surface `{unknown}`, which the scene does not have; it has {}", known.join(", "))))
}

fn too_many_texels(surface: &Surface, texels: u64, settings: &BakeSettings) -> Problem {
    Problem::new(format!(
        "the textures up to surface `{}` have {texels} texels; a job may have {}: lower texel_scale (now {}), texels_per_metre (now {}) \
         or texture_sizes",
        surface.name,
        limits::JOB_TEXELS,
        settings.texel_scale,
        settings.texels_per_metre
    ))
}

#[cfg(test)]
mod tests;
