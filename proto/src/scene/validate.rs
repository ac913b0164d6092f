//! What makes a scene valid, checked where it is made (import) and wherever it crosses a boundary (worker, package reader).

mod lights;
mod materials;
mod surfaces;
mod views;

use super::{SCENE_VERSION, Scene};
use crate::{limits, units::Rgb};

/// The first thing found wrong with a scene.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InvalidScene {
    /// Written by another version.
    #[error("scene version {found}; this program reads version {SCENE_VERSION}")]
    Version {
        /// What the scene says.
        found: u32,
    },
    /// Nothing to bake.
    #[error("the scene has no triangle with an area")]
    Empty,
    /// More of something than a limit allows.
    #[error("the scene has {found} {what}; at most {max} are allowed")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        max: usize,
    },
    /// A name that is empty, too long or taken.
    #[error("surface {index} has the name `{name}`, which is empty, too long or not unique")]
    Name {
        /// Index of the surface.
        index: usize,
        /// Its name.
        name: String,
    },
    /// An index beyond the end of what it points into.
    #[error("{owner} refers to {what} {index}, but there are only {count}")]
    Dangling {
        /// Who refers.
        owner: String,
        /// To what.
        what: &'static str,
        /// Which one.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// NaN or infinity.
    #[error("{owner} has a value that is not finite")]
    NotFinite {
        /// Where.
        owner: String,
    },
    /// A tangent whose fourth number is not a side.
    #[error("tangent {index} has a side other than 1 or -1")]
    Side {
        /// Which of the scene's tangents.
        index: usize,
    },
    /// Numbers that belong to triangles but are not one for each.
    #[error("surface `{name}` has {triangles} triangles but {found} {what}")]
    Count {
        /// Its name.
        name: String,
        /// Entries of what.
        what: &'static str,
        /// Its triangles.
        triangles: usize,
        /// How many entries there are.
        found: usize,
    },
    /// A back that is not the back of its front.
    #[error("surface `{name}` is not the back of the surface that it names")]
    Back {
        /// Its name.
        name: String,
    },
    /// A light, environment, camera or projector with an impossible value.
    #[error("{what} `{name}` {reason}")]
    Light {
        /// What it is.
        what: &'static str,
        /// Its name.
        name: String,
        /// What is wrong.
        reason: &'static str,
    },
    /// A reflectance or emission below zero, more emission than there may be, reflecting more than it receives, or a negative exponent.
    #[error("material `{name}` {reason}")]
    Material {
        /// Its name.
        name: String,
        /// What is wrong.
        reason: &'static str,
    },
    /// An image whose bytes do not match its size.
    #[error("texture `{name}` is {width}x{height} but has {bytes} bytes")]
    Texture {
        /// Its name.
        name: String,
        /// Texels along u.
        width: u32,
        /// Texels along v.
        height: u32,
        /// Bytes found.
        bytes: usize,
    },
}

/// The factor that brings a material's reflectance to at most one in every channel: 1 where it is already. Diffuse and specular
/// reflectance are scaled alike, which keeps their balance. A texture only lowers Kd, so Kd alone bounds it.
#[must_use]
pub fn energy_scale(diffuse: Rgb, specular: Rgb) -> f32 {
    let total = (diffuse + specular).max_channel();
    if total > 1.0 { 1.0 / total } else { 1.0 }
}

impl Scene {
    /// Checks every index, number, name and limit.
    ///
    /// # Errors
    /// The first fault found.
    pub fn validate(&self) -> Result<(), InvalidScene> {
        if self.version != SCENE_VERSION {
            return Err(InvalidScene::Version { found: self.version });
        }
        at_most("surfaces", self.surfaces.len(), limits::SURFACES)?;
        at_most("triangles", self.triangle_count(), limits::TRIANGLES)?;
        at_most("lights", self.lights.len(), limits::LIGHTS)?;
        at_most("cameras", self.cameras.len(), limits::LIGHTS)?;
        at_most("projectors", self.projectors.len(), limits::LIGHTS)?;
        if self.triangle_count() == 0 {
            return Err(InvalidScene::Empty);
        }
        for (what, pool) in [("vertex", &self.positions), ("normal", &self.normals)] {
            if let Some(index) = pool.iter().position(|p| !finite(p)) {
                return Err(InvalidScene::NotFinite { owner: format!("{what} {index}") });
            }
        }
        if let Some(index) = self.tangents.iter().position(|t| !finite(&t[..3])) {
            return Err(InvalidScene::NotFinite { owner: format!("tangent {index}") });
        }
        if let Some(index) = self.tangents.iter().position(|t| t[3].abs() != 1.0) {
            return Err(InvalidScene::Side { index });
        }
        if let Some(index) = self.colors.iter().position(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
            return Err(InvalidScene::NotFinite { owner: format!("vertex colour {index}") });
        }
        self.textures.iter().try_for_each(materials::check_texture)?;
        self.materials.iter().try_for_each(|m| self.check_material(m))?;
        self.lights.iter().try_for_each(|l| self.check_light(l))?;
        self.environment.iter().try_for_each(lights::check_environment)?;
        self.projectors.iter().try_for_each(|p| self.check_projector(p))?;
        self.cameras.iter().try_for_each(views::check_camera)?;
        self.check_surfaces()
    }
}

/// Whether all of these are numbers.
fn finite(v: &[f32]) -> bool {
    v.iter().all(|v| v.is_finite())
}

/// Whether this is a direction: of unit length but for rounding.
fn is_unit(d: [f32; 3]) -> bool {
    (glam::Vec3::from_array(d).length() - 1.0).abs() < 1e-3
}

/// Whether something may be this bright in each channel.
fn is_strength(c: Rgb) -> bool {
    c.to_array().iter().all(|v| (0.0..=limits::BRIGHTEST).contains(v))
}

fn is_share(v: f32) -> bool {
    (0.0..=1.0).contains(&v)
}

fn at_most(what: &'static str, found: usize, max: usize) -> Result<(), InvalidScene> {
    if found > max { Err(InvalidScene::TooMany { what, found, max }) } else { Ok(()) }
}

fn within(owner: impl Fn() -> String, what: &'static str, index: u32, count: usize) -> Result<(), InvalidScene> {
    if (index as usize) < count { Ok(()) } else { Err(InvalidScene::Dangling { owner: owner(), what, index, count }) }
}

#[cfg(test)]
mod tests;
