//! Materials and textures: numbers within their ranges, and no more light reflected than received.

use super::{InvalidScene, is_share, is_strength, within};
use crate::{
    limits,
    scene::{
        AlphaMode, LayerMode, Lobe, Mapping, Material, MetallicRoughness, Phong, Reflection, Scene, Texture, TextureLayer, TextureRef,
    },
    units::Rgb,
};

impl Scene {
    /// One material with the textures that it names.
    pub(super) fn check_material(&self, m: &Material) -> Result<(), InvalidScene> {
        check_colours(m, &[m.emission])?;
        if !is_strength(m.emission) {
            return Err(fault(m, "has an emission above 1e13"));
        }
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

    /// A use of a texture by the material or light of this name.
    pub(super) fn check_texture_ref(&self, name: &str, t: &TextureRef) -> Result<(), InvalidScene> {
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

fn check_layers(m: &Material, layers: &[TextureLayer]) -> Result<(), InvalidScene> {
    let usable = |mode| !matches!(mode, LayerMode::Modulate { scale } if !(0.0..=4.0).contains(&scale));
    if layers.iter().all(|l| usable(l.mode)) { Ok(()) } else { Err(fault(m, "has a texture layer whose scale is out of range")) }
}

fn fault(m: &Material, reason: &'static str) -> InvalidScene {
    InvalidScene::Material { name: m.name.clone(), reason }
}

/// An image: its bytes are those of its size.
pub(super) fn check_texture(t: &Texture) -> Result<(), InvalidScene> {
    let pixels = u64::from(t.width) * u64::from(t.height);
    if pixels == 0 || pixels > limits::TEXTURE_PIXELS || t.texels.len() as u64 != t.channels() as u64 * pixels {
        return Err(InvalidScene::Texture { name: t.name.clone(), width: t.width, height: t.height, bytes: t.texels.len() });
    }
    Ok(())
}
