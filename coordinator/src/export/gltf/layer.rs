//! The textures of a material: the one of its base colour, opacity in the alpha channel of it, and how each is looked up.

use super::{
    ExportError,
    material::Maker,
    number, numbers,
    texture::{self, Source},
};
use kiln_proto::{
    scene::{AlphaMode, LayerMode, Opacity, TextureLayer, TextureRef},
    units::Rgb,
};
use serde_json::{Map, Value, json};

impl Maker<'_, '_, '_> {
    /// The one texture that glTF's base colour may have, and the colour that it multiplies. What lies below a texture that replaces it is
    /// never seen.
    pub(super) fn base_layer(&mut self, color: Rgb, layers: &[TextureLayer]) -> (Rgb, Option<TextureRef>) {
        let lies_on = |l: &&TextureLayer| texture::set_of(&l.texture).is_some();
        let lowest = layers.iter().rposition(|l| l.mode == LayerMode::Replace).unwrap_or(0);
        let seen = &layers[lowest..];
        let (first, taken) = match seen.iter().find(lies_on) {
            Some(TextureLayer { texture, mode: LayerMode::Modulate { scale } }) if (color * *scale).max_channel() <= 1.0 => {
                ((color * *scale, Some(*texture)), 1)
            }
            Some(TextureLayer { texture, mode: LayerMode::Replace }) => ((Rgb::WHITE, Some(*texture)), 1),
            _ => ((color, None), 0),
        };
        if seen.len() > taken {
            self.note(
                "materials have more textures on their colour, or others than glTF can say (it has one that multiplies); the first that \
                 fits is kept",
            );
        }
        first
    }

    /// `pbrMetallicRoughness`, with the opacity in the alpha channel of the base colour.
    pub(super) fn base(
        &mut self,
        color: Rgb,
        layer: Option<TextureRef>,
        [metallic, roughness]: [f32; 2],
        texture: Option<TextureRef>,
    ) -> Result<(), ExportError> {
        let Opacity { mode, factor, texture: alpha } = self.material.opacity;
        let is_opaque = mode == AlphaMode::Opaque;
        let [r, g, b] = color.to_array().map(|c| c.min(1.0));
        let mut pbr = Map::new();
        pbr.insert("baseColorFactor".into(), numbers(&[r, g, b, if is_opaque { 1.0 } else { factor }]));
        pbr.insert("metallicFactor".into(), number(metallic));
        pbr.insert("roughnessFactor".into(), number(roughness));
        if let Some(info) = self.base_texture(layer, alpha.filter(|_| !is_opaque))? {
            pbr.insert("baseColorTexture".into(), info);
        }
        if let Some(texture) = texture
            && let Some(info) = self.texture(&texture, None, true)?
        {
            pbr.insert("metallicRoughnessTexture".into(), info);
        }
        self.json.insert("pbrMetallicRoughness".into(), Value::Object(pbr));
        Ok(())
    }

    fn base_texture(&mut self, layer: Option<TextureRef>, alpha: Option<TextureRef>) -> Result<Option<Value>, ExportError> {
        let alike = |a: &TextureRef, b: &TextureRef| TextureRef { texture: a.texture, ..*b } == *a;
        match (layer, alpha) {
            (None, None) => Ok(None),
            (Some(color), None) => self.texture(&color, None, false),
            (None, Some(alpha)) => self.alpha_only(&alpha),
            (Some(color), Some(alpha)) => {
                if alike(&color, &alpha)
                    && let Some(info) = self.texture(&color, Some(alpha.texture), false)?
                {
                    return Ok(Some(info));
                }
                self.note("textures of opacity that lie on the surface otherwise than the colour's were left out");
                self.texture(&color, None, false)
            }
        }
    }

    fn alpha_only(&mut self, alpha: &TextureRef) -> Result<Option<Value>, ExportError> {
        if !self.all.scene.textures[alpha.texture as usize].has_alpha {
            return Ok(None);
        }
        self.info(alpha, Source { color: None, alpha: Some(alpha.texture), linear: false })
    }

    /// A `textureInfo`; `None` where the texture is projected or does not go together with `alpha`.
    pub(super) fn texture(&mut self, reference: &TextureRef, alpha: Option<u32>, linear: bool) -> Result<Option<Value>, ExportError> {
        // The image's own alpha needs no second source.
        let alpha = alpha.filter(|a| *a != reference.texture);
        self.info(reference, Source { color: Some(reference.texture), alpha, linear })
    }

    fn info(&mut self, reference: &TextureRef, source: Source) -> Result<Option<Value>, ExportError> {
        let Some(set) = texture::set_of(reference) else {
            self.note("projected textures, which glTF has no words for, were left out");
            return Ok(None);
        };
        let buffers = &mut self.writer.buffers;
        let Some(index) = self.all.textures.index(source, reference, |png| buffers.view(png, None))? else { return Ok(None) };
        let mut info = json!({"index": index});
        let set = match texture::transform(reference.transform) {
            Some(transform) => {
                if let Some(transform) = transform.to_json() {
                    info["extensions"] = json!({"KHR_texture_transform": transform});
                    self.writer.extensions.insert("KHR_texture_transform");
                }
                self.coordinates.sets = self.coordinates.sets.max(set as usize + 1);
                set as usize
            }
            None => self.extra_set((set, reference.transform)),
        };
        if set > 0 {
            info["texCoord"] = json!(set);
        }
        Ok(Some(info))
    }

    /// A set of coordinates that are transformed already.
    fn extra_set(&mut self, wanted: (u32, [[f32; 3]; 2])) -> usize {
        let extra = &mut self.coordinates.extra;
        let place = extra.iter().position(|known| *known == wanted).unwrap_or_else(|| {
            extra.push(wanted);
            extra.len() - 1
        });
        self.all.most_sets + place
    }
}
