//! Which textures a material uses: the one place that knows all fields that hold one, to look at them and to renumber them.

use super::{Material, Reflection, TextureLayer, TextureRef};

impl Reflection {
    /// Every texture that it uses.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let (layers, single): (&[TextureLayer], [Option<&TextureRef>; 4]) = match self {
            Reflection::None => (&[], [None; 4]),
            Reflection::Phong(p) => (&p.layers, [p.specular_texture.as_ref(), None, None, None]),
            Reflection::MetallicRoughness(m) => {
                let single = [&m.metallic_roughness_texture, &m.specular_texture, &m.specular_color_texture, &m.transmission_texture];
                (&m.layers, single.map(Option::as_ref))
            }
        };
        layers.iter().map(|l| &l.texture).chain(single.into_iter().flatten())
    }
}

impl Material {
    /// Every texture it uses.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let own = [self.emission_texture.as_ref(), self.opacity.texture.as_ref(), self.normal_map.as_ref().map(|n| &n.texture)];
        self.reflection.textures().chain(own.into_iter().flatten())
    }

    /// The same to be changed: a new field of a texture belongs into both.
    pub fn textures_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        let (layers, single): (&mut [TextureLayer], [Option<&mut TextureRef>; 4]) = match &mut self.reflection {
            Reflection::None => (&mut [], [None, None, None, None]),
            Reflection::Phong(p) => (&mut p.layers, [p.specular_texture.as_mut(), None, None, None]),
            Reflection::MetallicRoughness(m) => {
                let single = [
                    &mut m.metallic_roughness_texture,
                    &mut m.specular_texture,
                    &mut m.specular_color_texture,
                    &mut m.transmission_texture,
                ];
                (&mut m.layers, single.map(Option::as_mut))
            }
        };
        let own = [self.emission_texture.as_mut(), self.opacity.texture.as_mut(), self.normal_map.as_mut().map(|n| &mut n.texture)];
        layers.iter_mut().map(|l| &mut l.texture).chain(single.into_iter().flatten()).chain(own.into_iter().flatten())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{MetallicRoughness, NormalMap, Opacity, Phong};
    use super::*;
    use crate::units::Rgb;

    /// Every field that holds a texture, found by the numbers of the serialised form, which nobody can forget a field of.
    #[test]
    fn every_texture_is_seen_and_can_be_renumbered() {
        let texture = |number| TextureRef::plain(number, 0);
        let layers = || vec![TextureLayer { texture: texture(100), mode: super::super::LayerMode::Replace }; 2];
        let phong = Phong { layers: layers(), specular_texture: Some(texture(101)), ..Phong::matt(Rgb::WHITE) };
        let metal = MetallicRoughness {
            layers: layers(),
            metallic_roughness_texture: Some(texture(102)),
            specular_texture: Some(texture(103)),
            specular_color_texture: Some(texture(104)),
            transmission_texture: Some(texture(105)),
            ..MetallicRoughness::plain(Rgb::WHITE, 1.0, 1.0)
        };
        for (reflection, wanted) in [(Reflection::None, 3), (Reflection::Phong(phong), 6), (Reflection::MetallicRoughness(metal), 9)] {
            let mut material = Material {
                emission_texture: Some(texture(106)),
                opacity: Opacity { texture: Some(texture(107)), ..Opacity::OPAQUE },
                normal_map: Some(NormalMap { texture: texture(108), scale: 1.0 }),
                ..Material::new("m", reflection)
            };
            let named = serde_json::to_string(&material).unwrap().matches("\"mapping\"").count();
            let seen: Vec<u32> = material.textures().map(|t| t.texture).collect();
            assert_eq!((seen.len(), named), (wanted, wanted));
            material.textures_mut().for_each(|t| t.texture += 1000);
            assert_eq!(material.textures().map(|t| t.texture - 1000).collect::<Vec<_>>(), seen);
        }
    }
}
