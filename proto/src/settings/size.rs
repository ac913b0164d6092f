//! The size of a texture, written as `200x100`.

use crate::limits;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// Texels of a surface's texture: width along u, height along v.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TextureSize {
    /// Texels along u, 1 to [`limits::TEXTURE_SIDE`].
    pub width: u32,
    /// Texels along v, 1 to [`limits::TEXTURE_SIDE`].
    pub height: u32,
}

/// Why a texture size was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("texture size `{text}`: expected WIDTHxHEIGHT such as 200x100, each from 1 to {max}", max = limits::TEXTURE_SIDE)]
pub struct BadTextureSize {
    text: String,
}

impl TextureSize {
    /// A size within the limits.
    ///
    /// # Errors
    /// Sides of zero or above [`limits::TEXTURE_SIDE`].
    pub fn new(width: u32, height: u32) -> Result<Self, BadTextureSize> {
        let side = 1..=limits::TEXTURE_SIDE;
        if side.contains(&width) && side.contains(&height) {
            Ok(Self { width, height })
        } else {
            Err(BadTextureSize { text: format!("{width}x{height}") })
        }
    }

    /// Texels, covered or not.
    #[must_use]
    pub fn texels(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

impl fmt::Display for TextureSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for TextureSize {
    type Err = BadTextureSize;
    fn from_str(text: &str) -> Result<Self, BadTextureSize> {
        let bad = || BadTextureSize { text: text.chars().take(40).collect() };
        let (w, h) = text.split_once('x').ok_or_else(bad)?;
        Self::new(w.parse().map_err(|_| bad())?, h.parse().map_err(|_| bad())?)
    }
}

crate::written_as_text!(TextureSize);
