//! `lfRadiance(uv, w)`: the light field at one point toward one viewer, the contract that the shaders are held to.
//!
//! Four texels around the point times four grid directions around the view. Each of the 16 values is decoded exactly and taken to linear
//! radiance before it is weighted: a mean of sRGB bytes would darken every edge between light and shade. Texels that hold no samples take
//! no part, and the weights of the others are divided by their sum, so that what lies beside a chart never darkens its border. Nearest
//! texels and directions would cost a sixteenth and show the grid. The parts are public beside the whole ([`radiance`]), because a renderer
//! of pictures goes through a package texel by texel, not pixel by pixel.

use crate::{
    grid::{SphericalGrid, Stencil},
    math,
    settings::TextureSize,
    units::Rgb,
};
use glam::Vec3;

/// Four texels, as column + width x row, with their bilinear weights; the weights sum to one. At the border of a texture a texel may come
/// twice.
pub type Footprint = [(u64, f32); 4];

/// The texels around `uv`, in the texture coordinates of the plan: (0, 0) is the corner of the first texel, whose centre is half a texel
/// away. Points outside the texture take its border.
#[must_use]
pub fn footprint(uv: [f32; 2], size: TextureSize) -> Footprint {
    let axis = |at: f32, side: u32| {
        let g = (at * side as f32 - 0.5).clamp(0.0, (side - 1) as f32);
        let low = g.floor();
        let first = low as u64;
        (first, (first + 1).min(u64::from(side) - 1), g - low)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (axis(uv[0], size.width), axis(uv[1], size.height));
    let at = |x: u64, y: u64| y * u64::from(size.width) + x;
    [(at(x0, y0), (1.0 - fx) * (1.0 - fy)), (at(x1, y0), fx * (1.0 - fy)), (at(x0, y1), (1.0 - fx) * fy), (at(x1, y1), fx * fy)]
}

/// The grid directions around a unit direction in the surface's frame at the point that is looked at
/// ([`SurfaceFrames`](crate::frame::SurfaceFrames)). A view below its horizon is taken along it: on a flat triangle's front that is
/// rounding, on a smooth surface the silhouette, whose interpolated normals turn away from the eye before its triangles do.
#[must_use]
pub fn stencil(grid: SphericalGrid, toward: Vec3) -> Stencil {
    grid.stencil(toward.with_z(toward.z.max(0.0)))
}

/// One texel's radiance toward a view: `sample` gives the linear radiance at a depth of the grid, W/(sr m²).
#[must_use]
pub fn toward(stencil: &Stencil, mut sample: impl FnMut(u32) -> Rgb) -> Rgb {
    stencil.iter().fold(Rgb::BLACK, |sum, (depth, weight)| sum + sample(*depth) * *weight)
}

/// The sum over the texels of a footprint that hold samples.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Blend {
    sum: Rgb,
    weight: f32,
}

impl Blend {
    /// Adds a texel that holds samples, with its weight in the footprint.
    pub fn add(&mut self, radiance: Rgb, weight: f32) {
        self.sum += radiance * weight;
        self.weight += weight;
    }

    /// The radiance, or `None` where no texel with any weight holds samples.
    #[must_use]
    pub fn finish(self) -> Option<Rgb> {
        (self.weight > 0.0).then(|| self.sum * (1.0 / self.weight))
    }
}

/// The radiance at `uv` toward `view`, W/(sr m²), or `None` where the light field has nothing. `sample` gives the linear radiance of a
/// texel at a depth, `None` for a texel that holds no samples.
#[must_use]
pub fn radiance(
    uv: [f32; 2],
    view: Vec3,
    size: TextureSize,
    grid: SphericalGrid,
    mut sample: impl FnMut(u64, u32) -> Option<Rgb>,
) -> Option<Rgb> {
    let directions = stencil(grid, view);
    let mut blend = Blend::default();
    for (texel, weight) in footprint(uv, size) {
        // A texel holds all directions or none.
        if sample(texel, directions[0].0).is_some() {
            blend.add(toward(&directions, |depth| sample(texel, depth).unwrap_or(Rgb::BLACK)), weight);
        }
    }
    blend.finish()
}

/// The radiance that a perfectly diffuse texel of the same radiosity would have: the mean over the grid's directions, weighted with cosine
/// and solid angle.
#[derive(Debug, Clone, PartialEq)]
pub struct DiffuseMean {
    /// Of each ring, normalised; a ring's directions share its weight.
    weights: Vec<f64>,
    n_phi: usize,
}

impl DiffuseMean {
    /// The weights of a grid.
    #[must_use]
    pub fn new(grid: SphericalGrid) -> Self {
        let ring = |i: u32| {
            let (sin, cos) = math::sin_cos_degrees((f64::from(i) + 0.5) * 90.0 / f64::from(grid.n_theta()));
            sin * cos
        };
        let rings: Vec<f64> = (0..grid.n_theta()).map(ring).collect();
        let sum = rings.iter().sum::<f64>() * f64::from(grid.n_phi());
        Self { weights: rings.iter().map(|w| w / sum).collect(), n_phi: grid.n_phi() as usize }
    }

    /// The mean of D linear radiances in depth order. Exact to the last bit of an f32 where all are equal.
    #[must_use]
    pub fn of(&self, radiance: impl IntoIterator<Item = Rgb>) -> Rgb {
        let mut sum = [0.0f64; 3];
        for (depth, rgb) in radiance.into_iter().enumerate() {
            let weight = self.weights.get(depth / self.n_phi).copied().unwrap_or(0.0);
            sum.iter_mut().zip(rgb.to_array()).for_each(|(sum, v)| *sum += weight * f64::from(v));
        }
        Rgb::from(sum.map(|v| v as f32))
    }
}

#[cfg(test)]
mod tests;
