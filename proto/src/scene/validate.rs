//! What makes a scene valid, checked where it is made (import) and wherever it crosses a boundary (worker, package reader).

use super::{
    AlphaMode, Environment, Falloff, LayerMode, Light, LightShape, Lobe, Mapping, Material, MetallicRoughness, Phong, Reflection,
    SCENE_VERSION, Scene, Surface, Texture, TextureRef,
};
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
        if let Some(index) = self.tangents.iter().position(|t| !finite(&t[..3]) || t[3].abs() != 1.0) {
            return Err(InvalidScene::NotFinite { owner: format!("tangent {index}") });
        }
        if let Some(index) = self.colors.iter().position(|c| !c.iter().all(|v| (0.0..=1.0).contains(v))) {
            return Err(InvalidScene::NotFinite { owner: format!("vertex colour {index}") });
        }
        self.textures.iter().try_for_each(check_texture)?;
        self.materials.iter().try_for_each(|m| self.check_material(m))?;
        self.lights.iter().try_for_each(|l| self.check_light(l))?;
        self.environment.iter().try_for_each(check_environment)?;
        self.check_views()?;
        self.check_surfaces()
    }

    fn check_surfaces(&self) -> Result<(), InvalidScene> {
        let (mut names, mut stems) = (HashSet::new(), HashSet::new());
        for (index, s) in self.surfaces.iter().enumerate() {
            let usable = |n: &str| !n.is_empty() && n.len() <= limits::NAME_BYTES;
            if !usable(&s.name) || !usable(&s.file_stem) || !names.insert(&s.name) || !stems.insert(s.file_stem.to_lowercase()) {
                return Err(InvalidScene::Name { index, name: s.name.clone() });
            }
            self.check_parts(s)?;
            self.check_triangles(s)?;
            self.check_back(index, s)?;
        }
        Ok(())
    }

    fn check_parts(&self, s: &Surface) -> Result<(), InvalidScene> {
        let counted: usize = s.parts.iter().map(|p| p.triangles as usize).sum();
        if counted != s.triangles.len() || s.parts.is_empty() {
            return Err(count(s, "triangles in its parts", counted));
        }
        for part in &s.parts {
            let owner = || format!("part `{}` of surface `{}`", part.name, s.name);
            within(owner, "material", part.material, self.materials.len())?;
            let lights = part.receive_shadows.iter().chain(&part.unlit_by).chain(part.shadow_maps.iter().map(|(light, _)| light));
            lights.copied().try_for_each(|light| within(owner, "light", light, self.lights.len()))?;
            if part.unlit_by.windows(2).any(|w| w[0] >= w[1]) {
                return Err(InvalidScene::Light { what: "part", name: part.name.clone(), reason: "lists lights out of order" });
            }
        }
        Ok(())
    }

    fn check_triangles(&self, s: &Surface) -> Result<(), InvalidScene> {
        let all = s.triangles.len();
        let owner = || format!("a triangle of `{}`", s.name);
        for t in &s.triangles {
            t.corners.iter().try_for_each(|c| within(owner, "vertex", *c, self.positions.len()))?;
        }
        let pools = [
            ("normals", &s.normals, self.normals.len()),
            ("tangents", &s.tangents, self.tangents.len()),
            ("colours", &s.colors, self.colors.len()),
        ];
        for (what, corners, pool) in pools {
            if !corners.is_empty() && corners.len() != all {
                return Err(count(s, what, corners.len()));
            }
            corners.iter().flatten().try_for_each(|c| within(owner, what, *c, pool))?;
        }
        at_most("coordinate sets of a surface", s.uv_sets.len(), limits::UV_SETS)?;
        for set in &s.uv_sets {
            if set.len() != all {
                return Err(count(s, "texture coordinates in a set", set.len()));
            }
            if set.iter().flatten().flatten().flatten().any(|v| !v.is_finite()) {
                return Err(InvalidScene::NotFinite { owner: format!("a texture coordinate of `{}`", s.name) });
            }
        }
        Ok(())
    }

    /// A back has the triangles of its front, turned over.
    fn check_back(&self, index: usize, s: &Surface) -> Result<(), InvalidScene> {
        let Some(front) = s.back_of else { return Ok(()) };
        let turned = |f: &Surface| {
            f.back_of.is_none()
                && f.triangles.len() == s.triangles.len()
                && f.triangles.iter().zip(&s.triangles).all(|(f, b)| f.corners == [b.corners[0], b.corners[2], b.corners[1]])
        };
        let front = self.surfaces.get(front as usize).filter(|_| front as usize != index);
        if front.is_some_and(turned) { Ok(()) } else { Err(InvalidScene::Back { name: s.name.clone() }) }
    }

    fn check_material(&self, m: &Material) -> Result<(), InvalidScene> {
        check_colours(m, &[m.emission])?;
        match &m.reflection {
            Reflection::None => {}
            Reflection::Phong(phong) => check_phong(m, phong)?,
            Reflection::MetallicRoughness(pbr) => check_metallic_roughness(m, pbr)?,
        }
        let (opacity, cutoff) = (m.opacity.factor, if let AlphaMode::Mask { cutoff } = m.opacity.mode { cutoff } else { 0.0 });
        if !(is_share(opacity) && cutoff.is_finite() && cutoff >= 0.0) || m.normal_map.is_some_and(|n| !n.scale.is_finite()) {
            return Err(fault(m, "has an opacity, a cutoff or a normal scale out of range"));
        }
        m.textures().try_for_each(|t| self.check_texture_ref(&m.name, t))
    }

    fn check_texture_ref(&self, name: &str, t: &TextureRef) -> Result<(), InvalidScene> {
        let owner = || format!("`{name}`");
        within(owner, "texture", t.texture, self.textures.len())?;
        if let Mapping::Projected { projector } = t.mapping {
            within(owner, "projector", projector, self.projectors.len())?;
        }
        if t.transform.as_flattened().iter().all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(InvalidScene::NotFinite { owner: format!("a texture transform of `{name}`") })
        }
    }

    fn check_light(&self, l: &Light) -> Result<(), InvalidScene> {
        let bad = |reason| Err(InvalidScene::Light { what: "light", name: l.name.clone(), reason });
        let usable = |c: Rgb| c.is_finite() && c.to_array().iter().all(|v| *v >= 0.0);
        if !usable(l.intensity) || !usable(l.ambient) {
            return bad("has an intensity that is negative or not finite");
        }
        if !is_share(l.shadow_intensity) {
            return bad("has a shadow intensity outside [0, 1]");
        }
        let unit = |d: [f32; 3]| (glam::Vec3::from_array(d).length() - 1.0).abs() < 1e-3;
        let placed = match l.shape {
            LightShape::Point { position } => finite(&position),
            LightShape::Directional { direction } => unit(direction),
            LightShape::Spot { position, direction, cut_off, beam_width, .. } => {
                finite(&position)
                    && unit(direction)
                    && (0.0..=std::f32::consts::PI).contains(&cut_off)
                    && (0.0..=cut_off).contains(&beam_width)
            }
        };
        let weakened = match l.falloff {
            Falloff::InverseSquare { range } => range.is_none_or(|r| r > 0.0 && r.is_finite()),
            Falloff::Polynomial { attenuation, radius } => attenuation.iter().all(|a| *a >= 0.0 && a.is_finite()) && radius >= 0.0,
        };
        if !placed || !weakened {
            return bad("has a position, a direction, an angle or a falloff out of range");
        }
        l.texture.iter().try_for_each(|t| self.check_texture_ref(&l.name, t))
    }

    fn check_views(&self) -> Result<(), InvalidScene> {
        for p in &self.projectors {
            within(
                || format!("projector `{}`", p.name),
                "light",
                p.light.unwrap_or(0),
                self.lights.len().max(usize::from(p.light.is_none())),
            )?;
            if !p.matrix.as_flattened().iter().all(|v| v.is_finite()) {
                return Err(InvalidScene::NotFinite { owner: format!("projector `{}`", p.name) });
            }
        }
        match self.cameras.iter().find(|c| ![c.eye, c.forward, c.up].iter().all(|v| finite(v))) {
            Some(c) => Err(InvalidScene::NotFinite { owner: format!("camera `{}`", c.name) }),
            None => Ok(()),
        }
    }
}

fn check_colours(m: &Material, colours: &[Rgb]) -> Result<(), InvalidScene> {
    for c in colours {
        if !c.is_finite() {
            return Err(InvalidScene::NotFinite { owner: format!("material `{}`", m.name) });
        }
        if c.to_array().iter().any(|v| *v < 0.0) {
            return Err(fault(m, "has a negative reflectance or emission"));
        }
    }
    Ok(())
}

fn check_phong(m: &Material, phong: &Phong) -> Result<(), InvalidScene> {
    check_colours(m, &[phong.diffuse, phong.specular])?;
    if (phong.diffuse + phong.specular).max_channel() > 1.0 + 1e-5 {
        return Err(fault(m, "reflects more light than it receives"));
    }
    if let Lobe::Phong { exponent } = phong.lobe
        && !(exponent.is_finite() && exponent >= 0.0)
    {
        return Err(fault(m, "has a Phong exponent that is negative or not finite"));
    }
    if !is_share(phong.ambient) {
        return Err(fault(m, "has an ambient share out of range"));
    }
    check_layers(m, &phong.layers)
}

fn check_metallic_roughness(m: &Material, pbr: &MetallicRoughness) -> Result<(), InvalidScene> {
    check_colours(m, &[pbr.base_color, pbr.specular_color])?;
    if pbr.base_color.max_channel() > 1.0 + 1e-5 {
        return Err(fault(m, "reflects more light than it receives"));
    }
    let shares = [pbr.metallic, pbr.roughness, pbr.specular, pbr.transmission];
    if !shares.iter().all(|v| is_share(*v)) || !(pbr.ior == 0.0 || (pbr.ior >= 1.0 && pbr.ior.is_finite())) {
        return Err(fault(m, "has a metallic, roughness, specular, transmission or ior value out of range"));
    }
    check_layers(m, &pbr.layers)
}

fn check_layers(m: &Material, layers: &[super::TextureLayer]) -> Result<(), InvalidScene> {
    let usable = |mode| !matches!(mode, LayerMode::Modulate { scale } if !(0.0..=4.0).contains(&scale));
    if layers.iter().all(|l| usable(l.mode)) { Ok(()) } else { Err(fault(m, "has a texture layer whose scale is out of range")) }
}

fn check_environment(e: &Environment) -> Result<(), InvalidScene> {
    let bad = |reason| Err(InvalidScene::Light { what: "environment", name: e.name.clone(), reason });
    let pixels = u64::from(e.width) * u64::from(e.height);
    if pixels == 0 || pixels > limits::ENVIRONMENT_PIXELS || e.rgb.len() as u64 != pixels {
        return bad("has a size that does not fit its pixels");
    }
    if !(e.rotation.is_finite() && e.intensity.is_finite() && e.intensity >= 0.0) {
        return bad("has a rotation or an intensity out of range");
    }
    if e.rgb.as_flattened().iter().all(|v| *v >= 0.0 && v.is_finite()) {
        Ok(())
    } else {
        bad("has radiance that is negative or not finite")
    }
}

fn fault(m: &Material, reason: &'static str) -> InvalidScene {
    InvalidScene::Material { name: m.name.clone(), reason }
}

fn count(s: &Surface, what: &'static str, found: usize) -> InvalidScene {
    InvalidScene::Count { name: s.name.clone(), what, triangles: s.triangles.len(), found }
}

fn finite(v: &[f32]) -> bool {
    v.iter().all(|v| v.is_finite())
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

fn check_texture(t: &Texture) -> Result<(), InvalidScene> {
    let pixels = u64::from(t.width) * u64::from(t.height);
    if pixels == 0 || pixels > limits::TEXTURE_PIXELS || t.texels.len() as u64 != t.channels() as u64 * pixels {
        return Err(InvalidScene::Texture { name: t.name.clone(), width: t.width, height: t.height, bytes: t.texels.len() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Coding, Part, TextureLayer, Triangle};
    use super::*;

    fn scene() -> Scene {
        Scene {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            surfaces: vec![Surface {
                name: "floor".into(),
                file_stem: "floor".into(),
                parts: vec![Part::plain("floor", 0, 1)],
                triangles: vec![Triangle { corners: [0, 1, 2], polygon: 0 }],
                ..Surface::default()
            }],
            materials: vec![Material::matt("grey", Rgb::splat(0.5))],
            ..Scene::empty()
        }
    }

    fn phong(s: &mut Scene) -> &mut Phong {
        match &mut s.materials[0].reflection {
            Reflection::Phong(phong) => phong,
            other => panic!("{other:?}"),
        }
    }

    fn back() -> Surface {
        Surface {
            name: "floor~back".into(),
            file_stem: "floor~back".into(),
            back_of: Some(0),
            triangles: vec![Triangle { corners: [0, 2, 1], polygon: 0 }],
            ..scene().surfaces[0].clone()
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
        assert_eq!(Scene::hash_of(&bytes).to_string(), "d473d09ddddebf9704434b493b42ab889d0cef16d86e02274a7eb77443fb1700");
    }

    #[test]
    fn each_fault_is_found_and_named() {
        let broken = |f: fn(&mut Scene)| {
            let mut s = scene();
            f(&mut s);
            s.validate().unwrap_err().to_string()
        };
        assert!(broken(|s| s.version = 9).contains("version 9"));
        assert!(broken(|s| (s.surfaces[0].triangles.clear(), s.surfaces[0].parts[0].triangles = 0).1).contains("no triangle"));
        assert!(broken(|s| s.positions[1][2] = f32::NAN).contains("vertex 1"));
        assert!(broken(|s| s.surfaces[0].triangles[0].corners[2] = 7).contains("vertex 7"));
        assert!(broken(|s| s.surfaces.push(s.surfaces[0].clone())).contains("not unique"));
        assert!(broken(|s| phong(s).specular = Rgb::splat(0.6)).contains("more light"));
        assert!(broken(|s| s.materials[0].emission.g = -1.0).contains("negative"));
        assert!(
            broken(|s| phong(s).layers.push(TextureLayer { texture: TextureRef::plain(0, 0), mode: LayerMode::Replace }))
                .contains("texture 0")
        );
        let short = |s: &mut Scene| {
            let texels = vec![0; 11];
            s.textures.push(Texture { name: "t".into(), width: 2, height: 2, coding: Coding::Srgb, has_alpha: false, texels });
        };
        assert!(broken(short).contains("11 bytes"));
        assert!(broken(|s| s.surfaces[0].parts[0].triangles = 2).contains("2 triangles in its parts"));
        assert!(broken(|s| s.surfaces[0].normals = vec![[0; 3]]).contains("normals 0"));
        assert!(broken(|s| s.surfaces[0].tangents = vec![[0; 3]]).contains("tangents 0"));
        assert!(broken(|s| s.tangents = vec![[1.0, 0.0, 0.0, 0.5]]).contains("tangent 0"));
        assert!(broken(|s| s.surfaces[0].uv_sets = vec![vec![]]).contains("0 texture coordinates"));
        assert!(broken(|s| s.surfaces[0].parts[0].unlit_by = vec![3]).contains("light 3"));
        assert!(broken(|s| s.materials[0].opacity.factor = 1.5).contains("opacity"));
    }

    #[test]
    fn a_back_has_the_triangles_of_its_front_turned_over() {
        let with = |back: Surface| Scene { surfaces: vec![scene().surfaces[0].clone(), back], ..scene() }.validate();
        with(back()).unwrap();
        let wrong = |f: fn(&mut Surface)| {
            let mut back = back();
            f(&mut back);
            with(back).unwrap_err().to_string().contains("not the back")
        };
        assert!(wrong(|b| b.triangles[0].corners = [0, 1, 2]) && wrong(|b| b.back_of = Some(1)) && wrong(|b| b.back_of = Some(9)));
    }

    #[test]
    fn energy_above_one_is_scaled_to_one() {
        assert_eq!(energy_scale(Rgb::splat(0.5), Rgb::splat(0.5)), 1.0);
        assert_eq!(energy_scale(Rgb::splat(1.0), Rgb::new(0.0, 1.0, 0.0)), 0.5);
    }
}
