//! PixelTexture: an image written out as numbers (ISO/IEC 19775-1: 5.3.7 and 18.4.6).

use crate::import::{findings::Findings, x3d::NodeRef};
use kiln_proto::{
    limits,
    scene::{Coding, Texture},
};

/// Whether a node is a PixelTexture without a pixel.
pub(super) fn is_empty(node: NodeRef<'_>) -> bool {
    node.kind() == "PixelTexture" && !matches!(node.mf_int("image"), [width, height, ..] if *width > 0 && *height > 0)
}

/// Whether a node is what stands in a list for another one that was skipped, which has been said.
pub(super) fn is_stand_in(node: NodeRef<'_>) -> bool {
    node.kind() == "PixelTexture" && !node.is_set("image")
}

/// The texture of an SFImage: width, height, components, then a number per pixel from the lower left; `None` for an empty one, and for one
/// that is none, which is then an error.
pub(super) fn pixels(node: NodeRef<'_>, coding: Coding, name: String, findings: &mut Findings) -> Option<Texture> {
    let numbers = node.mf_int("image");
    let &[w, h, components, ref rest @ ..] = numbers else { return None };
    let (width, height) = (u32::try_from(w).ok()?, u32::try_from(h).ok()?);
    let count = u64::from(width) * u64::from(height);
    if count == 0 {
        return None;
    }
    if !(1..=4).contains(&components) || count > limits::TEXTURE_PIXELS || rest.len() as u64 != count {
        let message = format!("PixelTexture is {width}x{height} with {components} components but has {} pixels", rest.len());
        findings.error(node.at_field("image"), message);
        return None;
    }
    let has_alpha = components % 2 == 0;
    let mut texels = Vec::with_capacity(rest.len() * if has_alpha { 4 } else { 3 });
    for pixel in rest {
        let [a, b, c, d] = pixel.to_be_bytes();
        match components {
            1 => texels.extend([d, d, d]),
            2 => texels.extend([c, c, c, d]),
            3 => texels.extend([b, c, d]),
            _ => texels.extend([a, b, c, d]),
        }
    }
    Some(Texture { name, width, height, coding, has_alpha, texels })
}
