//! Surfaces: names, parts, and that every list has an entry for each triangle.

use super::{InvalidScene, at_most, lights, within};
use crate::{
    limits,
    scene::{Scene, Surface},
};
use std::collections::HashSet;

impl Scene {
    /// Every surface: names, parts, triangles and the fronts of backs.
    pub(super) fn check_surfaces(&self) -> Result<(), InvalidScene> {
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
            part.shadow_maps.iter().try_for_each(|(_, map)| lights::check_shadow_map("part", &part.name, map))?;
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
}

fn count(s: &Surface, what: &'static str, found: usize) -> InvalidScene {
    InvalidScene::Count { name: s.name.clone(), what, triangles: s.triangles.len(), found }
}
