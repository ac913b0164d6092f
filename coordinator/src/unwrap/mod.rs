//! Unwrap: every surface gets a texture size and charts that do not overlap.
//!
//! The author's texture coordinates are used where they are usable: present everywhere, inside the unit square, without overlap at the
//! resolution that is baked. Otherwise each flat polygon becomes a chart of its own (`polygons`), packed on shelves (`pack`). Curved
//! meshes without usable coordinates are thereby cut along every polygon, which bakes right and wastes gutters; an atlas that keeps
//! neighbours together can replace `polygons` without touching anything else.

mod author;
mod pack;
mod polygons;
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

/// Lays out all surfaces. Cost: linear in triangles and texels for the author's charts, n log n in polygons for packed ones.
///
/// # Errors
/// Sizes for surfaces that do not exist, textures beyond the limits, and sizes into which a surface's polygons do not fit.
pub fn lay_out(scene: &Scene, settings: &BakeSettings) -> Result<Layout, Problem> {
    check_names(scene, settings)?;
    let mut layout = Layout { surfaces: Vec::with_capacity(scene.surfaces.len()), warnings: vec![] };
    let mut texels = 0;
    for surface in &scene.surfaces {
        let wanted = wanted(surface, settings)?;
        let plan = lay_out_surface(scene, surface, wanted, &mut layout.warnings)?;
        texels += plan.size.texels();
        if texels > limits::JOB_TEXELS {
            return Err(too_many_texels(surface, texels, settings));
        }
        layout.surfaces.push(plan);
    }
    Ok(layout)
}

fn lay_out_surface(scene: &Scene, surface: &Surface, wanted: Wanted, warnings: &mut Vec<Problem>) -> Result<SurfacePlan, Problem> {
    let mut warn = |message: String| warnings.push(problem(format!("surface `{}`: {message}", surface.name)));
    let (source, charts) = match author::lay_out(scene, surface, wanted) {
        Ok((charts, note)) => {
            note.into_iter().for_each(&mut warn);
            (ChartSource::Author, charts)
        }
        Err(why) => {
            if why != author::Unusable::Missing {
                warn(format!("its texture coordinates were replaced by one chart per polygon, because {why}"));
            }
            let (charts, note) =
                polygons::lay_out(scene, surface, wanted).map_err(|e| problem(format!("surface `{}`: {e}", surface.name)))?;
            note.into_iter().for_each(&mut warn);
            (ChartSource::Polygons, charts)
        }
    };
    Ok(SurfacePlan { size: charts.size, source, uv: charts.uv, charts: charts.charts, covered: 0, tiles: vec![] })
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
        problem(format!(
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
    Err(problem(format!("texture_sizes names the surface `{unknown}`, which the scene does not have; it has {}", known.join(", "))))
}

fn too_many_texels(surface: &Surface, texels: u64, settings: &BakeSettings) -> Problem {
    problem(format!(
        "the textures up to surface `{}` have {texels} texels; a job may have {}: lower texel_scale (now {}), texels_per_metre (now {}) \
         or texture_sizes",
        surface.name,
        limits::JOB_TEXELS,
        settings.texel_scale,
        settings.texels_per_metre
    ))
}

fn problem(message: String) -> Problem {
    Problem { message, file: None, line: None }
}

#[cfg(test)]
mod tests;
