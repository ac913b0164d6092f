//! Images of materials: decoded within the limits to 8 bits a channel, row 0 at the bottom.
//!
//! The size is read and checked before a pixel is decoded, so a file of a kilobyte that promises a terabyte costs a kilobyte.

use super::{
    format::extension,
    guard::{Panicked, guarded},
};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, imageops::flip_vertical_in_place};
use kiln_proto::{
    limits,
    scene::{Coding, Texture},
};
use std::io::Cursor;

/// Bytes that decoding one image may take beside its pixels in the scene.
const DECODE_BYTES: u64 = 2 << 30;

/// Bytes that the coefficients of a progressive JPEG take for a pixel until its last scan: two for each of four channels.
const COEFFICIENTS: u64 = 8;

/// Pixels of a JPEG for each of its bytes, at most. In its first scan every block of 64 pixels takes one bit at least, so that 512 is the most
/// there can be of a whole file; twice that leaves room for channels that are sampled at half.
const JPEG_PIXELS: u64 = 1024;

/// Why an image was refused.
#[derive(Debug, thiserror::Error)]
pub(super) enum TextureError {
    /// More pixels than one texture may have.
    #[error("is {width}x{height} pixels; at most {max} pixels are allowed", max = limits::TEXTURE_PIXELS)]
    TooLarge {
        /// Pixels along u.
        width: u32,
        /// Pixels along v.
        height: u32,
    },
    /// More memory than a decoder may take.
    #[error("takes {needed} bytes to decode; at most {DECODE_BYTES} are allowed")]
    TooDear {
        /// What the decoder would hold at once.
        needed: u64,
    },
    /// Fewer bytes than such a picture can have: its decoder would fill gigabytes with grey.
    #[error("is cut off: {width}x{height} pixels take {needed} bytes or more, and it has {found}")]
    CutOff {
        /// Pixels along u.
        width: u32,
        /// Pixels along v.
        height: u32,
        /// The fewest bytes of a whole one.
        needed: u64,
        /// Its bytes.
        found: u64,
    },
    /// Neither content nor name is of a format that this program reads.
    #[error("is not an image that this program reads (PNG, JPEG, BMP, TGA)")]
    Unknown,
    /// The decoder's own words.
    #[error("cannot be decoded: {0}")]
    Decode(#[from] image::ImageError),
    /// The decoder had none.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

/// An image and whether it has transparent pixels.
pub(super) struct Decoded {
    /// The image, with an alpha channel where one was asked for and there are transparent pixels.
    pub(super) texture: Texture,
    /// Whether some pixel is not opaque.
    pub(super) transparent: bool,
}

/// The format of an image file called `name`, and its size in pixels, within the limits.
fn head(name: &str, bytes: &[u8]) -> Result<(ImageFormat, u32, u32), TextureError> {
    // TGA has no magic number: only its name tells it.
    let format = image::guess_format(bytes).ok().or_else(|| ImageFormat::from_extension(extension(name))).ok_or(TextureError::Unknown)?;
    if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Bmp | ImageFormat::Tga) {
        return Err(TextureError::Unknown);
    }
    let (width, height) = ImageReader::with_format(Cursor::new(bytes), format).into_dimensions()?;
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > limits::TEXTURE_PIXELS {
        return Err(TextureError::TooLarge { width, height });
    }
    let (needed, found) = (pixels.div_ceil(JPEG_PIXELS), bytes.len() as u64);
    if format == ImageFormat::Jpeg && found < needed {
        return Err(TextureError::CutOff { width, height, needed, found });
    }
    Ok((format, width, height))
}

/// Whether an image file looks whole, without decoding its pixels: its width and height.
pub(super) fn size(name: &str, bytes: &[u8]) -> Result<(u32, u32), TextureError> {
    guarded(|| head(name, bytes)).map(|(_, width, height)| (width, height))
}

/// Decodes an image file called `name`, whose bytes mean what `coding` says; `alpha`: whether transparency is kept.
pub(super) fn decode(name: &str, bytes: &[u8], coding: Coding, alpha: bool) -> Result<Decoded, TextureError> {
    let image = guarded(|| pixels(name, bytes))?;
    let (width, height) = (image.width(), image.height());
    let transparent = is_transparent(&image);
    let has_alpha = alpha && transparent;
    // The scene's row 0 is v = 0, the bottom; an image's first row is its top.
    let texels = if has_alpha {
        let mut rgba = image.into_rgba8();
        flip_vertical_in_place(&mut rgba);
        rgba.into_raw()
    } else {
        let mut rgb = image.into_rgb8();
        flip_vertical_in_place(&mut rgb);
        rgb.into_raw()
    };
    Ok(Decoded { texture: Texture { name: name.to_owned(), width, height, coding, has_alpha, texels }, transparent })
}

/// The pixels of an image file, within the limits.
fn pixels(name: &str, bytes: &[u8]) -> Result<DynamicImage, TextureError> {
    let (format, width, height) = head(name, bytes)?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut bounds = Limits::default();
    bounds.max_alloc = Some(DECODE_BYTES);
    reader.limits(bounds);
    let decoder = reader.into_decoder()?;
    // The decoder's own bound counts what it hands out; what a progressive JPEG keeps of itself meanwhile is counted here.
    let kept = if is_progressive(bytes) { COEFFICIENTS * u64::from(width) * u64::from(height) } else { 0 };
    let needed = decoder.total_bytes().saturating_add(kept);
    if needed > DECODE_BYTES {
        return Err(TextureError::TooDear { needed });
    }
    Ok(DynamicImage::from_decoder(decoder)?)
}

/// Whether these are the bytes of a JPEG whose frame is progressive (ITU-T T.81, B.1.1.3: SOF2, SOF6, SOF10, SOF14).
fn is_progressive(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.strip_prefix(b"\xff\xd8") else { return false };
    while let [0xff, marker, tail @ ..] = rest {
        match marker {
            0xc2 | 0xc6 | 0xca | 0xce => return true,
            0xc0..=0xcf if !matches!(marker, 0xc4 | 0xc8 | 0xcc) => return false,
            0xff => rest = &rest[1..],
            0x01 | 0xd0..=0xd8 => rest = tail,
            _ => {
                let Some([high, low]) = tail.first_chunk() else { return false };
                rest = tail.get(usize::from(u16::from_be_bytes([*high, *low]))..).unwrap_or_default();
            }
        }
    }
    false
}

fn is_transparent(image: &DynamicImage) -> bool {
    match image {
        DynamicImage::ImageRgba8(pixels) => pixels.pixels().any(|p| p.0[3] < 255),
        other => other.color().has_alpha() && other.to_rgba8().pixels().any(|p| p.0[3] < 255),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgba, RgbaImage};

    fn png(image: RgbaImage) -> Vec<u8> {
        let mut out = Cursor::new(vec![]);
        DynamicImage::from(image).write_to(&mut out, ImageFormat::Png).unwrap();
        out.into_inner()
    }

    fn srgb(name: &str, bytes: &[u8]) -> Result<Decoded, TextureError> {
        decode(name, bytes, Coding::Srgb, false)
    }

    #[test]
    fn row_zero_is_the_bottom_and_alpha_is_noticed() {
        let mut image = RgbaImage::from_pixel(1, 2, Rgba([1, 2, 3, 255]));
        image.put_pixel(0, 1, Rgba([9, 8, 7, 255]));
        let opaque = srgb("t.png", &png(image.clone())).unwrap();
        assert_eq!((opaque.texture.texels, opaque.transparent), (vec![9, 8, 7, 1, 2, 3], false));
        image.put_pixel(0, 0, Rgba([1, 2, 3, 254]));
        let see_through = png(image);
        let (plain, kept) = (srgb("t.png", &see_through).unwrap(), decode("t.png", &see_through, Coding::Linear, true).unwrap());
        assert_eq!((plain.texture.texels.len(), plain.transparent), (6, true));
        assert_eq!((kept.texture.texels, kept.texture.has_alpha), (vec![9, 8, 7, 255, 1, 2, 3, 254], true));
    }

    #[test]
    fn content_decides_the_format_and_nonsense_is_refused() {
        let bytes = png(RgbaImage::new(3, 2));
        assert_eq!(srgb("wrong.jpg", &bytes).unwrap().texture.width, 3);
        assert!(matches!(srgb("t.png", &bytes[..bytes.len() / 2]), Err(TextureError::Decode(_))));
        assert!(matches!(srgb("t.txt", b"hello"), Err(TextureError::Unknown)));
        assert!(srgb("t.tga", b"hello").is_err());
    }

    #[test]
    fn a_small_file_that_promises_a_huge_image_is_refused_before_decoding() {
        let mut bytes = png(RgbaImage::new(1, 1));
        // IHDR: width at 16..20, height at 20..24, its CRC over "IHDR" and 13 bytes at 29..33.
        bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
        let crc = !bytes[12..29]
            .iter()
            .fold(u32::MAX, |crc, b| (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xedb8_8320 } else { c >> 1 }));
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(matches!(srgb("t.png", &bytes), Err(TextureError::TooLarge { width: 65_536, .. })));
    }

    /// A frame header is all that such a file needs to have: 16,384 pixels a side, for which its decoder would take 3 GB.
    #[test]
    fn a_progressive_jpeg_counts_what_it_keeps_while_it_is_decoded() {
        let frame = |marker: u8, side: u16| {
            let [high, low] = side.to_be_bytes();
            let mut bytes = vec![0xff, 0xd8, 0xff, 0xfe, 0, 4, 0xff, 0xc0, 0xff, 0xff, marker, 0, 17, 8, high, low, high, low, 3];
            bytes.extend([1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0, 0xff, 0xda, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 63, 0, 0xff, 0xd9]);
            bytes
        };
        assert!(is_progressive(&frame(0xc2, 8)) && !is_progressive(&frame(0xc0, 8)) && !is_progressive(&png(RgbaImage::new(1, 1))));
        let padded = |length| [frame(0xc2, 16_384), vec![0; length]].concat();
        assert!(matches!(srgb("t.jpg", &padded(1 << 18)), Err(TextureError::TooDear { needed }) if needed > 2 << 30));
        assert!(!matches!(srgb("t.jpg", &frame(0xc2, 8)), Err(TextureError::TooDear { .. } | TextureError::CutOff { .. })));
        let cut_off = srgb("t.jpg", &padded(1000)).err().unwrap();
        assert!(matches!(cut_off, TextureError::CutOff { needed: 262_144, .. }), "{cut_off}");
    }
}
