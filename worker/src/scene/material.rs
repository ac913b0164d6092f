//! Materials at a point: textures, vertex colours and factors become a few numbers.

use super::{BakeScene, Prim};
use crate::bsdf::{Bsdf, Specular, coat::Coat, power::Exponent};
use glam::{Vec3, Vec4};
use kiln_proto::{
    frame::Lie,
    scene::{Lobe, Mapping, Material, MetallicRoughness, NormalMap, Phong, Place, Reflection, Scene, alpha_of, energy_scale},
    units::Rgb,
};

/// The least share of a mapped normal that points along the surface's own: what a map turns further would look at the inside.
const LEAST_HEIGHT: f32 = 0.02;

/// Where the facets of a material are a perfect mirror.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polish {
    /// Nowhere: it has lobes, or no facets at all.
    Nowhere,
    /// Where a texture says so; elsewhere it is rough.
    Somewhere,
    /// Everywhere.
    Everywhere,
}

impl Polish {
    /// Of all materials. Cost: linear in the texels of roughness textures, each of which is read once.
    pub(super) fn all(scene: &Scene) -> Vec<Self> {
        let mut ranges = vec![None; scene.textures.len()];
        let mut range = |texture: u32| *ranges[texture as usize].get_or_insert_with(|| scene.textures[texture as usize].range(1));
        scene.materials.iter().map(|material| Self::of(material, &mut range)).collect()
    }

    /// A perfect mirror that is not made of facets is one everywhere. `range` tells what values the roughness of a texture has.
    fn of(material: &Material, mut range: impl FnMut(u32) -> (f32, f32)) -> Self {
        let (low, high) = match &material.reflection {
            Reflection::Phong(Phong { lobe: Lobe::Mirror, specular, .. }) if specular.max_channel() > 0.0 => (0.0, 0.0),
            Reflection::MetallicRoughness(m) => {
                let (low, high) = m.metallic_roughness_texture.map_or((1.0, 1.0), |t| {
                    let (low, high) = range(t.texture);
                    // Where a projector does not reach, the factor is alone.
                    if matches!(t.mapping, Mapping::Uv { .. }) { (low, high) } else { (low, 1.0) }
                });
                (alpha_of(m.roughness * low), alpha_of(m.roughness * high))
            }
            Reflection::None | Reflection::Phong(_) => (1.0, 1.0),
        };
        match (low > 0.0, high > 0.0) {
            (true, _) => Self::Nowhere,
            (false, true) => Self::Somewhere,
            (false, false) => Self::Everywhere,
        }
    }
}

impl BakeScene {
    /// A point of a primitive as textures see it.
    #[must_use]
    #[inline]
    pub fn place(&self, prim: u32, bary: [f32; 2]) -> Place {
        let p = self.prim(prim);
        Place { surface: p.surface, triangle: prim - self.first[p.surface as usize], bary, position: p.at(bary).to_array() }
    }

    /// What leaves the front of a primitive by itself, W/(sr m²), whatever its opacity.
    #[inline]
    pub fn emission(&self, prim: u32, bary: [f32; 2]) -> Rgb {
        if !self.prim(prim).is_emissive {
            return Rgb::BLACK;
        }
        let material = self.material_of(prim);
        match material.emission_texture {
            Some(t) => match self.scene.texture_at(&t, &self.place(prim, bary)) {
                Some([r, g, b, _]) => material.emission * Rgb::new(r, g, b),
                None => material.emission,
            },
            None => material.emission,
        }
    }

    /// How a primitive reflects at a point.
    #[inline]
    pub fn bsdf(&self, prim: u32, bary: [f32; 2]) -> Bsdf {
        let p = self.prim(prim);
        match self.constant[p.material as usize] {
            Some(bsdf) if !p.is_colored => bsdf,
            _ => evaluate(&self.scene, self.material_of(prim), &self.place(prim, bary)),
        }
    }

    /// What a smooth-faced, transmissive primitive lets straight on toward a direction of this cosine: black for most materials.
    pub(super) fn clear(&self, prim: u32, bary: [f32; 2], cos: f32) -> Rgb {
        self.scene.clear_at(self.material_of(prim), &self.place(prim, bary), cos)
    }

    /// The normal that reflection sees at a point, in world space, for a surface normal `normal`; the same where there is no map.
    ///
    /// It lies along the tangents of the corners, interpolated and made orthogonal to the normal, or along dP/du of the map's own
    /// coordinates where there are none; the bitangent is on the side that they say.
    #[inline]
    pub(super) fn mapped_normal(&self, prim: u32, bary: [f32; 2], normal: Vec3) -> Vec3 {
        match self.material_of(prim).normal_map {
            Some(map) => self.tilt(&map, prim, bary, normal).unwrap_or(normal),
            None => normal,
        }
    }

    fn tilt(&self, map: &NormalMap, prim: u32, bary: [f32; 2], normal: Vec3) -> Option<Vec3> {
        let (p, place) = (self.prim(prim), self.place(prim, bary));
        let (tangent, bitangent) = self.tangents(map, p, &place, normal)?;
        let [x, y, z, _] = self.scene.texture_at(&map.texture, &place)?.map(|v| 2.0 * v - 1.0);
        // The back of a sheet has the front's normals, reversed; its own coordinates mirror only the third axis.
        let side = if p.is_back { -map.scale } else { map.scale };
        let local = Vec3::new(x * side, y * side, z.max(LEAST_HEIGHT)).normalize_or(Vec3::Z);
        let local = local.with_z(local.z.max(LEAST_HEIGHT));
        (tangent * local.x + bitangent * local.y + normal * local.z).try_normalize()
    }

    /// The tangent and the bitangent between the corners' tangents; `None` where the surface has none there.
    fn smooth_tangents(&self, place: &Place, normal: Vec3) -> Option<(Vec3, Vec3)> {
        let corners = self.scene.surfaces[place.surface as usize].tangents.get(place.triangle as usize)?;
        let [a, b, c] = corners.map(|index| Vec4::from_array(self.scene.tangents[index as usize]));
        let mixed = a * (1.0 - place.bary[0] - place.bary[1]) + b * place.bary[0] + c * place.bary[1];
        let along = mixed.truncate();
        let tangent = (along - normal * normal.dot(along)).try_normalize()?;
        Some((tangent, normal.cross(tangent) * if mixed.w < 0.0 { -1.0 } else { 1.0 }))
    }

    fn tangents(&self, map: &NormalMap, p: &Prim, place: &Place, normal: Vec3) -> Option<(Vec3, Vec3)> {
        let Mapping::Uv { set } = map.texture.mapping else { return None };
        if let Some(smooth) = self.smooth_tangents(place, normal) {
            return Some(smooth);
        }
        let corners = self.scene.surfaces[p.surface as usize].uv(set as usize, place.triangle as usize)?;
        let lie = Lie::of(p.corners.map(Vec3::as_dvec3), corners.map(|uv| map.texture.moved(uv)))?;
        let along = lie.along_u.as_vec3();
        let tangent = (along - normal * normal.dot(along)).try_normalize()?;
        Some((tangent, normal.cross(tangent) * lie.side as f32))
    }
}

/// A material whose reflection is the same everywhere but for vertex colours.
pub(super) fn constant(scene: &Scene, material: &Material) -> Option<Bsdf> {
    // No surface has this number, so that vertex colours are ones.
    let nowhere = Place { surface: u32::MAX, triangle: 0, bary: [0.0; 2], position: [0.0; 3] };
    (material.reflection.textures().next().is_none()).then(|| evaluate(scene, material, &nowhere))
}

fn evaluate(scene: &Scene, material: &Material, place: &Place) -> Bsdf {
    match &material.reflection {
        Reflection::None => Bsdf::BLACK,
        Reflection::Phong(p) => phong(scene, p, place),
        Reflection::MetallicRoughness(m) => {
            let (coat, diffuse) = layered_coat(scene, m, place);
            Bsdf { diffuse, specular: Specular::Coat(coat) }
        }
    }
}

fn phong(scene: &Scene, p: &Phong, place: &Place) -> Bsdf {
    let mut diffuse = scene.layered(p.diffuse, &p.layers, place);
    let mut ks = match p.specular_texture.and_then(|t| scene.texture_at(&t, place)) {
        Some([r, g, b, _]) => p.specular * Rgb::new(r, g, b),
        None => p.specular,
    };
    // Factors were scaled to one at import, but layers may add to the diffuse part.
    if !p.layers.is_empty() {
        let scale = energy_scale(diffuse, ks);
        (diffuse, ks) = (diffuse * scale, ks * scale);
    }
    let specular = match p.lobe {
        _ if p.specular.max_channel() <= 0.0 => Specular::None,
        Lobe::Phong { exponent } => Specular::Phong { ks, exponent: Exponent::new(exponent) },
        Lobe::Mirror => Specular::Mirror { ks },
    };
    Bsdf { diffuse, specular }
}

/// The parameters of appendix B at a place, as the few numbers that its formulas come down to: the coat, and the diffuse base beneath it.
fn layered_coat(scene: &Scene, m: &MetallicRoughness, place: &Place) -> (Coat, Rgb) {
    let texel = |t: &Option<_>| t.as_ref().and_then(|t| scene.texture_at(t, place)).unwrap_or([1.0; 4]);
    let base = scene.layered(m.base_color, &m.layers, place);
    let [_, green, blue, _] = texel(&m.metallic_roughness_texture);
    let (metallic, alpha) = (m.metallic * blue, alpha_of(m.roughness * green));
    let weight = m.specular * texel(&m.specular_texture)[3];
    let [r, g, b, _] = texel(&m.specular_color_texture);
    let transmission = m.transmission * texel(&m.transmission_texture)[0];
    let ratio = (m.ior - 1.0) / (m.ior + 1.0);
    let f0 = m.specular_color * Rgb::new(r, g, b) * (ratio * ratio);
    let f0 = Rgb::from(f0.to_array().map(|v| v.min(1.0)));
    let dielectric = 1.0 - metallic;
    let missing = |c: Rgb| Rgb::WHITE + c * -1.0;
    let coat = Coat {
        alpha,
        normal: base * metallic + f0 * (weight * dielectric),
        rise: missing(base) * metallic + missing(f0) * (weight * dielectric),
        kept: 1.0 - weight * f0.max_channel(),
        lost: weight * (1.0 - f0.max_channel()),
        // Through perfectly smooth facets light goes straight on, which `clear` tells.
        through: if alpha > 0.0 { base * (dielectric * transmission) } else { Rgb::BLACK },
    };
    (coat, base * (dielectric * (1.0 - transmission)))
}
