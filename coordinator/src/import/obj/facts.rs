//! Single numbers in pictures: planes of them, and what a decoded picture is worth knowing for once it is gone.
//!
//! A picture of 16,384 pixels a side takes a gigabyte and seconds to decode, and an MTL line that names it thirty bytes. So each is decoded
//! once to count its values; what a material wants to know of it afterwards (is it transparent, in colour, a normal map, what is its mean)
//! is answered by the counts, and it is decoded again only to become a texture of the scene, which has a bound of its own.

use super::map::Channel;
use crate::import::texture::Decoded;
use kiln_proto::scene::Texture;

/// All channels, in the order of [`Channel`].
const CHANNELS: [Channel; 5] = [Channel::Red, Channel::Green, Channel::Blue, Channel::Matte, Channel::Luminance];

/// Single numbers in [0, 255], from the lower left.
pub(super) struct Plane {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) values: Vec<u8>,
}

/// What is known of a picture.
pub(super) struct Facts {
    /// Whether some pixel is not opaque.
    pub(super) transparent: bool,
    /// Whether some pixels are no greys.
    pub(super) colourful: bool,
    /// Whether nine of ten pixels are unit vectors that look out of the surface.
    pub(super) holds_normals: bool,
    /// How many pixels have each value, by channel.
    counts: [[u64; 256]; 5],
}

impl Facts {
    /// Looks at every pixel once.
    pub(super) fn of(decoded: &Decoded) -> Self {
        let texture = &decoded.texture;
        let (mut counts, mut colourful, mut normals, mut pixels) = ([[0; 256]; 5], false, 0, 0);
        for p in texture.texels.chunks_exact(texture.channels()) {
            CHANNELS.iter().zip(&mut counts).for_each(|(channel, of)| of[usize::from(pick(p, *channel))] += 1);
            colourful |= p[0].abs_diff(p[1]).max(p[1].abs_diff(p[2])) > 8;
            normals += u64::from(is_normal(p));
            pixels += 1;
        }
        Self { transparent: decoded.transparent, colourful, holds_normals: normals * 10 >= pixels * 9, counts }
    }

    /// The mean of a channel in [0, 1], after the change of `-mm`.
    pub(super) fn mean(&self, channel: Channel, range: Option<[f32; 2]>) -> f32 {
        let counts = CHANNELS.iter().zip(&self.counts).find(|(c, _)| **c == channel).map_or(&self.counts[0], |(_, counts)| counts);
        let sum: u64 = counts.iter().zip(0..=255).map(|(n, v)| n * u64::from(change(v, range))).sum();
        (sum as f64 / (255.0 * counts.iter().sum::<u64>().max(1) as f64)) as f32
    }
}

impl Plane {
    /// A channel of a picture, after the change of `-mm`.
    pub(super) fn of(texture: &Texture, channel: Channel, range: Option<[f32; 2]>) -> Self {
        let values = texture.texels.chunks_exact(texture.channels()).map(|p| change(pick(p, channel), range)).collect();
        Self { width: texture.width, height: texture.height, values }
    }

    /// The number at a place of a plane of another size.
    pub(super) fn near(&self, (x, y): (u32, u32), [width, height]: [u32; 2]) -> u8 {
        let scaled = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(from)) as usize;
        self.values[scaled(y, height, self.height) * self.width as usize + scaled(x, width, self.width)]
    }
}

fn pick(p: &[u8], channel: Channel) -> u8 {
    match channel {
        Channel::Red => p[0],
        Channel::Green => p[1],
        Channel::Blue => p[2],
        Channel::Matte => p.get(3).copied().unwrap_or(255),
        // Rec. 709 in 256ths.
        Channel::Luminance => ((54 * u32::from(p[0]) + 183 * u32::from(p[1]) + 19 * u32::from(p[2]) + 128) >> 8).min(255) as u8,
    }
}

fn change(v: u8, range: Option<[f32; 2]>) -> u8 {
    range.map_or(v, |[base, gain]| (255.0 * base + gain * f32::from(v)).clamp(0.0, 255.0).round() as u8)
}

fn is_normal(p: &[u8]) -> bool {
    let [x, y, z] = [p[0], p[1], p[2]].map(|c| (f32::from(c) - 128.0) / 127.0);
    z > 0.0 && (x * x + y * y + z * z - 1.0).abs() < 0.2
}
