//! Looking up material textures: bilinear in linear light, repeating, v up.
//!
//! The bytes stay sRGB-coded and a table decodes them: a decoded copy would need four times the memory for a table lookup less.

use kiln_proto::{math, scene::Texture, units::Rgb};
use std::sync::LazyLock;

static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| std::array::from_fn(|byte| math::srgb_eotf(byte as f32 / 255.0)));

/// The texture's colour at (u, v), linear, [0, 1] a channel. Texel centres lie at half-integers, row 0 at v = 0.
#[must_use]
pub fn lookup(texture: &Texture, uv: [f32; 2]) -> Rgb {
    let (x0, x1, fx) = neighbours(uv[0], texture.width);
    let (y0, y1, fy) = neighbours(uv[1], texture.height);
    let texel = |x: u32, y: u32| {
        let at = texture.channels() * (y as usize * texture.width as usize + x as usize);
        Rgb::new(linear(texture.texels[at]), linear(texture.texels[at + 1]), linear(texture.texels[at + 2]))
    };
    let low = texel(x0, y0) * (1.0 - fx) + texel(x1, y0) * fx;
    let high = texel(x0, y1) * (1.0 - fx) + texel(x1, y1) * fx;
    low * (1.0 - fy) + high * fy
}

/// The mean colour of the whole texture, linear.
#[must_use]
pub fn mean(texture: &Texture) -> Rgb {
    let mut sum = [0.0f64; 3];
    for pixel in texture.texels.chunks_exact(texture.channels()) {
        for c in 0..3 {
            sum[c] += f64::from(linear(pixel[c]));
        }
    }
    let pixels = (texture.texels.len() / texture.channels()).max(1) as f64;
    Rgb::from(sum.map(|s| (s / pixels) as f32))
}

fn linear(byte: u8) -> f32 {
    LINEAR[usize::from(byte)]
}

/// The two texels on either side of a coordinate, wrapped, and the weight of the second.
fn neighbours(coordinate: f32, count: u32) -> (u32, u32, f32) {
    let at = (f64::from(coordinate) - f64::from(coordinate).floor()) * f64::from(count) - 0.5;
    let low = at.floor();
    let wrap = |i: i64| i.rem_euclid(i64::from(count)) as u32;
    (wrap(low as i64), wrap(low as i64 + 1), (at - low) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::scene::Coding;

    fn checker() -> Texture {
        let texels = [[0u8; 3], [255; 3], [255, 0, 0], [188; 3]].concat();
        Texture { name: "t".into(), width: 2, height: 2, coding: Coding::Srgb, has_alpha: false, texels }
    }

    #[test]
    fn centres_are_exact_row_zero_is_below_and_the_plane_repeats() {
        let t = checker();
        assert_eq!(lookup(&t, [0.25, 0.25]), Rgb::BLACK);
        assert_eq!(lookup(&t, [0.75, 0.25]), Rgb::WHITE);
        assert_eq!(lookup(&t, [0.25, 0.75]), Rgb::new(1.0, 0.0, 0.0));
        assert_eq!(lookup(&t, [-3.25, 7.25]), Rgb::WHITE);
    }

    #[test]
    fn interpolation_is_linear_in_light_and_wraps_around_the_edge() {
        let t = checker();
        assert!((lookup(&t, [0.5, 0.25]).g - 0.5).abs() < 1e-6, "half of white is 0.5 in light, not in sRGB");
        assert!((lookup(&t, [0.0, 0.25]).g - 0.5).abs() < 1e-6);
        let mean = mean(&t);
        assert!((mean.r - (2.0 + math::srgb_eotf(188.0 / 255.0)) / 4.0).abs() < 1e-6);
    }
}
