//! What textures, vertex colours and opacities are at a point of a surface: one look-up for worker and preview.
//!
//! Bilinear in linear light, or nearest, v up. The bytes stay as they are coded and a table decodes them: a decoded copy would need four
//! times the memory for a table look-up less. There are no mipmaps: the worker averages samples over the footprint of a texel anyway.

use super::{AlphaMode, Coding, LayerMode, Mapping, Opacity, Scene, Texture, TextureLayer, TextureRef, Wrap};
use crate::{math, units::Rgb};
use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| math::srgb_eotf(byte as f32 / 255.0)));

/// A point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the surface.
    pub surface: u32,
    /// The triangle, counted within the surface.
    pub triangle: u32,
    /// Barycentric weights of its second and third corner.
    pub bary: [f32; 2],
    /// World position, metres: what projectors see.
    pub position: [f32; 3],
}

impl Scene {
    /// A texture's colour (linear) and opacity at a place, [0, 1] a channel; `None` where its projector does not reach.
    #[must_use]
    pub fn texture_at(&self, texture: &TextureRef, place: &Place) -> Option<[f32; 4]> {
        let uv = match texture.mapping {
            Mapping::Uv { set } => self.uv_at(set, place),
            Mapping::Projected { projector } => project(&self.projectors.get(projector as usize)?.matrix, place.position)?,
        };
        Some(texture.sample(self.textures.get(texture.texture as usize)?, uv))
    }

    /// The coordinates of a set at a place; (0, 0) where the surface has none.
    #[must_use]
    #[inline]
    pub fn uv_at(&self, set: u32, place: &Place) -> [f32; 2] {
        let corners = self.surfaces.get(place.surface as usize).and_then(|s| s.uv(set as usize, place.triangle as usize));
        corners.map_or([0.0; 2], |corners| interpolate(corners, place.bary))
    }

    /// The vertex colour (linear) and its opacity at a place; ones where the surface has none.
    #[must_use]
    #[inline]
    pub fn color_at(&self, place: &Place) -> [f32; 4] {
        let corners = self.surfaces.get(place.surface as usize).and_then(|s| s.colors.get(place.triangle as usize));
        corners.map_or([1.0; 4], |c| interpolate(c.map(|c| self.colors[c as usize]), place.bary))
    }

    /// A base colour with vertex colours and a stack of textures, each step clamped to [0, 1] as X3D's MultiTexture has it.
    #[must_use]
    pub fn layered(&self, base: Rgb, layers: &[TextureLayer], place: &Place) -> Rgb {
        let [r, g, b, _] = self.color_at(place);
        layers.iter().fold(base * Rgb::new(r, g, b), |c, layer| match self.texture_at(&layer.texture, place) {
            Some(texel) => layer.mode.apply(c, texel),
            None => c,
        })
    }

    /// How much of what lies behind a place is covered, by the author's numbers alone: factor x texture x vertex colour, [0, 1].
    #[must_use]
    pub fn alpha_at(&self, opacity: &Opacity, place: &Place) -> f32 {
        let texture = opacity.texture.as_ref().and_then(|t| self.texture_at(t, place)).map_or(1.0, |texel| texel[3]);
        (opacity.factor * texture * self.color_at(place)[3]).clamp(0.0, 1.0)
    }

    /// The share of light that meets the surface at a place instead of passing as if nothing were there: 0 or 1 but for blended surfaces.
    #[must_use]
    #[inline]
    pub fn coverage_at(&self, opacity: &Opacity, place: &Place) -> f32 {
        match opacity.mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(self.alpha_at(opacity, place) >= cutoff),
            AlphaMode::Blend => self.alpha_at(opacity, place),
        }
    }
}

impl LayerMode {
    /// The colour c under a texel (colour, alpha).
    #[must_use]
    pub fn apply(self, c: Rgb, [r, g, b, a]: [f32; 4]) -> Rgb {
        let t = Rgb::new(r, g, b);
        let colour = match self {
            LayerMode::Modulate { scale } => c * t * scale,
            LayerMode::Replace => t,
            LayerMode::Add => c + t,
            LayerMode::AddSigned => c + t + Rgb::splat(-0.5),
            LayerMode::Subtract => c + t * -1.0,
            LayerMode::Blend => t * a + c * (1.0 - a),
        };
        Rgb::from(colour.to_array().map(|v| v.clamp(0.0, 1.0)))
    }
}

impl TextureRef {
    /// Where it looks up coordinates of its set: they are moved by its transform.
    #[must_use]
    #[inline]
    pub fn moved(&self, uv: [f32; 2]) -> [f64; 2] {
        let [u, v] = uv.map(f64::from);
        self.transform.map(|row| f64::from(row[0]) * u + f64::from(row[1]) * v + f64::from(row[2]))
    }

    /// The texel at coordinates before the transform: linear colour and opacity. Texel centres lie at half-integers, row 0 at v = 0.
    #[must_use]
    pub fn sample(&self, texture: &Texture, uv: [f32; 2]) -> [f32; 4] {
        let [u, v] = self.moved(uv);
        let x = Steps::new(u, texture.width, self.wrap[0], self.nearest);
        let y = Steps::new(v, texture.height, self.wrap[1], self.nearest);
        let mix = |a: [f32; 4], b: [f32; 4], f: f32| std::array::from_fn(|k| a[k] * (1.0 - f) + b[k] * f);
        let row = |y: u32| {
            let low = texture.texel(x.low, y);
            if x.weight == 0.0 { low } else { mix(low, texture.texel(x.high, y), x.weight) }
        };
        if y.weight == 0.0 { row(y.low) } else { mix(row(y.low), row(y.high), y.weight) }
    }
}

impl Texture {
    /// One texel: linear colour and opacity (1 where the image has none).
    #[must_use]
    #[inline]
    pub fn texel(&self, x: u32, y: u32) -> [f32; 4] {
        self.decode(&self.texels[self.channels() * (y as usize * self.width as usize + x as usize)..])
    }

    /// The mean colour of the whole image, linear.
    #[must_use]
    pub fn mean(&self) -> Rgb {
        let mut sum = [0.0f64; 3];
        for pixel in self.texels.chunks_exact(self.channels()) {
            let texel = self.decode(pixel);
            (0..3).for_each(|c| sum[c] += f64::from(texel[c]));
        }
        let pixels = (self.texels.len() / self.channels()).max(1) as f64;
        Rgb::from(sum.map(|s| (s / pixels) as f32))
    }

    #[inline]
    fn decode(&self, pixel: &[u8]) -> [f32; 4] {
        let plain = |byte: u8| f32::from(byte) / 255.0;
        let colour = |byte: u8| if self.coding == Coding::Srgb { LINEAR[usize::from(byte)] } else { plain(byte) };
        [colour(pixel[0]), colour(pixel[1]), colour(pixel[2]), if self.has_alpha { plain(pixel[3]) } else { 1.0 }]
    }
}

/// The two texels on either side of a coordinate, and the weight of the second.
struct Steps {
    low: u32,
    high: u32,
    weight: f32,
}

impl Steps {
    fn new(coordinate: f64, count: u32, wrap: Wrap, nearest: bool) -> Self {
        // The fraction is taken first where the image repeats, so that far copies are as exact as the first. A transform may overflow.
        let n = f64::from(count);
        let within = match wrap {
            _ if !coordinate.is_finite() => 0.0,
            Wrap::Repeat => coordinate - coordinate.floor(),
            Wrap::Mirror => coordinate - 2.0 * (0.5 * coordinate).floor(),
            Wrap::Clamp => coordinate.clamp(-1.0, 2.0),
        };
        let at = if nearest { within * n } else { within * n - 0.5 };
        let low = at.floor();
        let weight = if nearest { 0.0 } else { (at - low) as f32 };
        Self { low: wrapped(low as i64, count, wrap), high: wrapped(low as i64 + 1, count, wrap), weight }
    }
}

fn wrapped(index: i64, count: u32, wrap: Wrap) -> u32 {
    let n = i64::from(count);
    let at = match wrap {
        Wrap::Repeat => index.rem_euclid(n),
        Wrap::Clamp => index.clamp(0, n - 1),
        Wrap::Mirror => {
            let turn = index.rem_euclid(2 * n);
            turn.min(2 * n - 1 - turn)
        }
    };
    at as u32
}

/// Where a projector's picture has a world position; `None` behind it and beside its picture.
fn project(matrix: &[[f32; 4]; 4], position: [f32; 3]) -> Option<[f32; 2]> {
    let row = |r: usize| -> f64 {
        let m = matrix[r].map(f64::from);
        m[0] * f64::from(position[0]) + m[1] * f64::from(position[1]) + m[2] * f64::from(position[2]) + m[3]
    };
    let q = row(3);
    let (s, t) = (row(0) / q, row(1) / q);
    (q > 0.0 && (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t)).then_some([s as f32, t as f32])
}

#[inline]
fn interpolate<const N: usize>(corners: [[f32; N]; 3], [b, c]: [f32; 2]) -> [f32; N] {
    std::array::from_fn(|k| corners[0][k] * (1.0 - b - c) + corners[1][k] * b + corners[2][k] * c)
}

#[cfg(test)]
mod tests {
    use super::super::{Projector, Surface, Triangle};
    use super::*;

    fn checker() -> Texture {
        let texels = [[0u8; 3], [255; 3], [255, 0, 0], [188; 3]].concat();
        Texture { name: "t".into(), width: 2, height: 2, coding: Coding::Srgb, has_alpha: false, texels }
    }

    fn rgb(t: &Texture, r: &TextureRef, uv: [f32; 2]) -> [f32; 3] {
        let [r, g, b, _] = r.sample(t, uv);
        [r, g, b]
    }

    const WHITE: [f32; 3] = [1.0; 3];
    const BLACK: [f32; 3] = [0.0; 3];
    const RED: [f32; 3] = [1.0, 0.0, 0.0];

    #[test]
    fn centres_are_exact_row_zero_is_below_and_the_plane_repeats() {
        let (t, plain) = (checker(), TextureRef::plain(0, 0));
        let at = |u, v| rgb(&t, &plain, [u, v]);
        assert_eq!([at(0.25, 0.25), at(0.75, 0.25), at(0.25, 0.75), at(-3.25, 7.25)], [BLACK, WHITE, RED, WHITE]);
    }

    #[test]
    fn interpolation_is_linear_in_light_and_wraps_around_the_edge() {
        let (t, plain) = (checker(), TextureRef::plain(0, 0));
        assert!((rgb(&t, &plain, [0.5, 0.25])[1] - 0.5).abs() < 1e-6, "half of white is 0.5 in light, not in sRGB");
        assert!((rgb(&t, &plain, [0.0, 0.25])[1] - 0.5).abs() < 1e-6);
        assert!((t.mean().r - (2.0 + math::srgb_eotf(188.0 / 255.0)) / 4.0).abs() < 1e-6);
        let numbers = Texture { coding: Coding::Linear, ..checker() };
        assert_eq!(rgb(&numbers, &plain, [0.75, 0.75]), [188.0 / 255.0; 3]);
    }

    #[test]
    fn nearest_clamped_and_mirrored_texels_are_those_of_opengl() {
        let t = checker();
        let nearest = TextureRef { nearest: true, ..TextureRef::plain(0, 0) };
        assert_eq!([rgb(&t, &nearest, [0.49, 0.1]), rgb(&t, &nearest, [0.51, 0.1])], [BLACK, WHITE]);
        let clamped = TextureRef { wrap: [Wrap::Clamp; 2], ..TextureRef::plain(0, 0) };
        assert_eq!(
            [rgb(&t, &clamped, [-5.0, 0.25]), rgb(&t, &clamped, [9.0, -1e30]), rgb(&t, &clamped, [0.0, 0.0])],
            [BLACK, WHITE, BLACK]
        );
        let mirrored = TextureRef { wrap: [Wrap::Mirror, Wrap::Repeat], nearest: true, ..TextureRef::plain(0, 0) };
        let row: Vec<[f32; 3]> = (-4..8).map(|k| rgb(&t, &mirrored, [0.25 + 0.5 * k as f32, 0.25])).collect();
        let expected: Vec<[f32; 3]> = [0, 1, 1, 0].repeat(3).iter().map(|w| if *w == 1 { WHITE } else { BLACK }).collect();
        assert_eq!(row, expected);
        let huge = TextureRef { transform: [[f32::MAX; 3]; 2], ..mirrored };
        assert!(rgb(&t, &huge, [f32::MAX, 3.0]).iter().all(|v| v.is_finite()));
    }

    #[test]
    fn the_transform_moves_coordinates() {
        // A quarter turn about the middle: u' = 1 - v, v' = u.
        let turned = TextureRef { transform: [[0.0, -1.0, 1.0], [1.0, 0.0, 0.0]], ..TextureRef::plain(0, 0) };
        assert_eq!(rgb(&checker(), &turned, [0.75, 0.75]), RED);
        assert_eq!(rgb(&checker(), &turned, [0.25, 0.25]), WHITE);
    }

    #[test]
    fn layers_do_their_arithmetic_within_one() {
        let (c, t) = (Rgb::new(0.5, 0.25, 1.0), [0.5, 1.0, 0.25, 0.5]);
        let apply = |mode: LayerMode| mode.apply(c, t).to_array();
        assert_eq!(apply(LayerMode::Modulate { scale: 2.0 }), [0.5, 0.5, 0.5]);
        assert_eq!(apply(LayerMode::Replace), [0.5, 1.0, 0.25]);
        assert_eq!(apply(LayerMode::Add), [1.0, 1.0, 1.0]);
        assert_eq!(apply(LayerMode::AddSigned), [0.5, 0.75, 0.75]);
        assert_eq!(apply(LayerMode::Subtract), [0.0, 0.0, 0.75]);
        assert_eq!(apply(LayerMode::Blend), [0.5, 0.625, 0.625]);
    }

    /// One triangle with the checker, a projector that looks down -Z at the unit square, and vertex colours.
    fn scene() -> Scene {
        let mut surface =
            Surface::plain("s", 0, vec![(Triangle { corners: [0, 1, 2], polygon: 0 }, Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))]);
        surface.colors = vec![[0, 1, 1]];
        let matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0; 4], [0.0, 0.0, -1.0, 1.0]];
        Scene {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            colors: vec![[1.0, 1.0, 1.0, 1.0], [0.0, 0.5, 1.0, 0.5]],
            surfaces: vec![surface],
            textures: vec![checker()],
            projectors: vec![Projector { name: "p".into(), light: None, matrix }],
            ..Scene::empty()
        }
    }

    fn place(b: f32, c: f32, z: f32) -> Place {
        Place { surface: 0, triangle: 0, bary: [b, c], position: [b, c, z] }
    }

    #[test]
    fn a_projector_reaches_what_lies_before_it_within_its_picture() {
        let scene = scene();
        let projected = TextureRef { mapping: Mapping::Projected { projector: 0 }, ..TextureRef::plain(0, 0) };
        let at = |place: &Place| scene.texture_at(&projected, place);
        assert_eq!(at(&place(0.75, 0.25, 0.0)), Some([1.0; 4]));
        assert_eq!((at(&place(1.25, 0.25, 0.0)), at(&place(0.75, 0.25, 1.5))), (None, None), "beside the picture, behind the projector");
        let layers = [TextureLayer { texture: projected, mode: LayerMode::Replace }];
        assert_eq!(
            scene.layered(Rgb::WHITE, &layers, &place(0.0, 0.25, 1.5)),
            Rgb::new(0.75, 0.875, 1.0),
            "untouched but for vertex colours"
        );
    }

    #[test]
    fn opacity_is_the_product_of_what_the_author_says() {
        let mut scene = scene();
        let texels = [[0u8, 0, 0, 255], [0, 0, 0, 51]].concat();
        scene.textures.push(Texture { name: "a".into(), width: 2, height: 1, coding: Coding::Srgb, has_alpha: true, texels });
        let opacity = |mode| Opacity { mode, factor: 0.5, texture: Some(TextureRef { nearest: true, ..TextureRef::plain(1, 0) }) };
        let at = |mode, b: f32| scene.coverage_at(&opacity(mode), &place(b, 0.0, 0.0));
        assert!((at(AlphaMode::Blend, 0.75) - 0.5 * 0.2 * 0.625).abs() < 1e-6);
        assert_eq!((at(AlphaMode::Mask { cutoff: 0.4 }, 0.25), at(AlphaMode::Mask { cutoff: 0.4 }, 0.75)), (1.0, 0.0));
        assert_eq!(at(AlphaMode::Opaque, 0.75), 1.0);
    }
}
