//! What makes a scene valid, checked where it is made (import) and wherever it crosses a boundary (worker, package reader).

use super::{Lobe, Material, SCENE_VERSION, Scene, Texture};
use crate::{limits, units::Rgb};
use std::collections::HashSet;

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
    /// A reflectance or emission below zero, reflecting more than it receives, or a negative exponent.
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
        if self.triangle_count() == 0 {
            return Err(InvalidScene::Empty);
        }
        if let Some(index) = self.positions.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
            return Err(InvalidScene::NotFinite { owner: format!("vertex {index}") });
        }
        self.textures.iter().try_for_each(check_texture)?;
        self.materials.iter().try_for_each(|m| self.check_material(m))?;
        self.check_surfaces()
    }

    fn check_surfaces(&self) -> Result<(), InvalidScene> {
        let (mut names, mut stems) = (HashSet::new(), HashSet::new());
        for (index, s) in self.surfaces.iter().enumerate() {
            let usable = |n: &str| !n.is_empty() && n.len() <= limits::NAME_BYTES;
            if !usable(&s.name) || !usable(&s.file_stem) || !names.insert(&s.name) || !stems.insert(s.file_stem.to_lowercase()) {
                return Err(InvalidScene::Name { index, name: s.name.clone() });
            }
            within(|| format!("surface `{}`", s.name), "material", s.material, self.materials.len())?;
            for t in &s.triangles {
                t.corners.iter().try_for_each(|c| within(|| format!("a triangle of `{}`", s.name), "vertex", *c, self.positions.len()))?;
                if t.uv.iter().flatten().flatten().any(|v| !v.is_finite()) {
                    return Err(InvalidScene::NotFinite { owner: format!("a texture coordinate of `{}`", s.name) });
                }
            }
        }
        Ok(())
    }

    fn check_material(&self, m: &Material) -> Result<(), InvalidScene> {
        let fault = |reason| Err(InvalidScene::Material { name: m.name.clone(), reason });
        for c in [m.diffuse, m.specular, m.emission] {
            if !c.is_finite() {
                return Err(InvalidScene::NotFinite { owner: format!("material `{}`", m.name) });
            }
            if c.to_array().iter().any(|v| *v < 0.0) {
                return fault("has a negative reflectance or emission");
            }
        }
        if (m.diffuse + m.specular).max_channel() > 1.0 + 1e-5 {
            return fault("reflects more light than it receives");
        }
        if let Lobe::Phong { exponent } = m.lobe
            && !(exponent.is_finite() && exponent >= 0.0)
        {
            return fault("has a Phong exponent that is negative or not finite");
        }
        let owner = || format!("material `{}`", m.name);
        [m.diffuse_texture, m.emission_texture].into_iter().flatten().try_for_each(|t| within(owner, "texture", t, self.textures.len()))
    }
}

fn at_most(what: &'static str, found: usize, max: usize) -> Result<(), InvalidScene> {
    if found > max { Err(InvalidScene::TooMany { what, found, max }) } else { Ok(()) }
}

fn within(owner: impl Fn() -> String, what: &'static str, index: u32, count: usize) -> Result<(), InvalidScene> {
    if (index as usize) < count { Ok(()) } else { Err(InvalidScene::Dangling { owner: owner(), what, index, count }) }
}

fn check_texture(t: &Texture) -> Result<(), InvalidScene> {
    let pixels = u64::from(t.width) * u64::from(t.height);
    if pixels == 0 || pixels > limits::TEXTURE_PIXELS || t.rgb.len() as u64 != 3 * pixels {
        return Err(InvalidScene::Texture { name: t.name.clone(), width: t.width, height: t.height, bytes: t.rgb.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Surface, Triangle};
    use super::*;

    fn scene() -> Scene {
        Scene {
            version: SCENE_VERSION,
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            surfaces: vec![Surface {
                name: "floor".into(),
                file_stem: "floor".into(),
                material: 0,
                triangles: vec![Triangle { corners: [0, 1, 2], uv: None, polygon: 0 }],
            }],
            materials: vec![Material {
                name: "grey".into(),
                diffuse: Rgb::splat(0.5),
                diffuse_texture: None,
                specular: Rgb::BLACK,
                lobe: Lobe::Phong { exponent: 1.0 },
                emission: Rgb::BLACK,
                emission_texture: None,
            }],
            textures: vec![],
        }
    }

    #[test]
    fn a_valid_scene_survives_its_canonical_bytes() {
        let bytes = scene().to_bytes().unwrap();
        assert_eq!(Scene::from_bytes(&bytes).unwrap(), scene());
        assert!(Scene::from_bytes(&bytes[..bytes.len() - 1]).is_err());
        assert!(Scene::from_bytes(&[bytes.as_slice(), &[0]].concat()).is_err(), "trailing bytes must be refused");
    }

    /// A change of the canonical form changes every scene's address: then `SCENE_VERSION` goes up and this hash is written anew.
    #[test]
    fn the_canonical_bytes_never_change() {
        let bytes = scene().to_bytes().unwrap();
        assert_eq!(Scene::hash_of(&bytes).to_string(), "0db9893f4661b799a78b48de01451428408835eb562abdc75c5d1859f15e15bd");
    }

    #[test]
    fn each_fault_is_found_and_named() {
        let broken = |f: fn(&mut Scene)| {
            let mut s = scene();
            f(&mut s);
            s.validate().unwrap_err().to_string()
        };
        assert!(broken(|s| s.version = 9).contains("version 9"));
        assert!(broken(|s| s.surfaces[0].triangles.clear()).contains("no triangle"));
        assert!(broken(|s| s.positions[1][2] = f32::NAN).contains("vertex 1"));
        assert!(broken(|s| s.surfaces[0].triangles[0].corners[2] = 7).contains("vertex 7"));
        assert!(broken(|s| s.surfaces.push(s.surfaces[0].clone())).contains("not unique"));
        assert!(broken(|s| s.materials[0].specular = Rgb::splat(0.6)).contains("more light"));
        assert!(broken(|s| s.materials[0].emission.g = -1.0).contains("negative"));
        assert!(broken(|s| s.materials[0].diffuse_texture = Some(0)).contains("texture 0"));
        assert!(broken(|s| s.textures.push(Texture { name: "t".into(), width: 2, height: 2, rgb: vec![0; 11] })).contains("11 bytes"));
    }

    #[test]
    fn energy_above_one_is_scaled_to_one() {
        assert_eq!(energy_scale(Rgb::splat(0.5), Rgb::splat(0.5)), 1.0);
        assert_eq!(energy_scale(Rgb::splat(1.0), Rgb::new(0.0, 1.0, 0.0)), 0.5);
    }
}
