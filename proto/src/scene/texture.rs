//! Images: 8 bits a channel, with or without alpha, coded for the eye or linear.

use crate::math;
use serde::{Deserialize, Serialize};

/// An image, row 0 at v = 0 (the bottom).
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Texture {
    /// The file it came from, for messages.
    pub name: String,
    /// Texels along u.
    pub width: u32,
    /// Texels along v.
    pub height: u32,
    /// What the colour bytes mean.
    pub coding: Coding,
    /// Whether a fourth channel, linear opacity, follows red, green and blue.
    pub has_alpha: bool,
    /// (3 or 4) x width x height bytes.
    pub texels: Vec<u8>,
}

/// What the bytes of an image mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Coding {
    /// Colour, coded by the sRGB transfer function (IEC 61966-2-1).
    Srgb,
    /// Numbers: byte / 255.
    Linear,
}

impl Texture {
    /// Bytes of one texel.
    #[must_use]
    #[inline]
    pub fn channels(&self) -> usize {
        if self.has_alpha { 4 } else { 3 }
    }

    /// The least and the greatest linear value of a channel, 1 of an alpha that is not there; what is interpolated lies between. Cost:
    /// linear in texels.
    #[must_use]
    pub fn range(&self, channel: usize) -> (f32, f32) {
        if channel >= self.channels() {
            return (1.0, 1.0);
        }
        let values = self.texels.iter().skip(channel).step_by(self.channels());
        let (low, high) = values.fold((u8::MAX, 0), |(low, high), v| (low.min(*v), high.max(*v)));
        let linear = |byte: u8| {
            let coded = f32::from(byte) / 255.0;
            if self.coding == Coding::Srgb && channel < 3 { math::srgb_eotf(coded) } else { coded }
        };
        (linear(low), linear(high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_of_a_channel_is_linear_and_its_own() {
        let texels = vec![0, 51, 255, 102, 0, 255, 188, 204];
        let t = Texture { name: "t".into(), width: 2, height: 1, coding: Coding::Linear, has_alpha: true, texels };
        assert_eq!([t.range(0), t.range(1), t.range(3)], [(0.0, 0.0), (0.2, 1.0), (0.4, 0.8)]);
        let colour = Texture { coding: Coding::Srgb, ..t };
        assert_eq!((colour.range(1), colour.range(3)), ((math::srgb_eotf(0.2), 1.0), (0.4, 0.8)));
    }
}
