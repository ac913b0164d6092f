//! The decoders of environments: Radiance HDR and OpenEXR, by their content, to linear pixels from the bottom row up.
//!
//! A map may have a hundred million pixels of twelve bytes, so there is never a second copy of them all.

use crate::import::{
    format::extension,
    guard::{Panicked, guarded},
};
use exr::{
    meta::{Headers, header::Header},
    prelude::{IntegerBounds, MetaData, ReadChannels, ReadLayers, ReadSpecificChannel, Vec2, read},
};
use image::{ImageDecoder, codecs::hdr::HdrDecoder};
use kiln_proto::limits;
use std::io::{Cursor, Read};

/// What an OpenEXR file begins with.
const EXR: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Why a picture was refused.
#[derive(Debug, thiserror::Error)]
pub(in crate::import) enum EnvironmentError {
    /// Neither format.
    #[error("is neither a Radiance HDR nor an OpenEXR picture")]
    Unknown,
    /// More pixels than an environment may have, or none.
    #[error("is {width}x{height} pixels; at most {max} pixels are allowed", max = limits::ENVIRONMENT_PIXELS)]
    Size {
        /// Pixels around.
        width: usize,
        /// Pixels from top to bottom.
        height: usize,
    },
    /// A header by which nothing can be divided.
    #[error("has a line EXPOSURE or COLORCORR that comes to the factor {0}; it must be a number above 0")]
    Factor(f32),
    /// No colours.
    #[error("has no layer with channels R, G and B, or Y alone")]
    NoColour,
    /// OpenEXR's own way to keep colours in less space.
    #[error("keeps its colours as luminance and chroma (Y with RY or BY), which is not read; save it with channels R, G and B")]
    Chroma,
    /// The words of the HDR decoder.
    #[error("cannot be decoded: {0}")]
    Hdr(#[from] image::ImageError),
    /// The words of the OpenEXR decoder.
    #[error("cannot be decoded: {0}")]
    Exr(#[from] exr::error::Error),
    /// A decoder that had none.
    #[error(transparent)]
    Panicked(#[from] Panicked),
}

/// Pixels from the bottom row up, linear.
#[derive(Debug)]
pub(in crate::import) struct Picture {
    /// Pixels around.
    pub(in crate::import) width: usize,
    /// Pixels from top to bottom.
    pub(in crate::import) height: usize,
    /// The pixels.
    pub(in crate::import) rgb: Vec<[f32; 3]>,
    /// Where pixels are given and where they are to be shown, in words, if that is not the same.
    pub(in crate::import) windows: Option<String>,
}

/// Whether a file is such a picture, by its content, and by its name where that says nothing.
pub(in crate::import) fn is_map(name: &str, bytes: &[u8]) -> bool {
    let is_called_so = || matches!(extension(name).as_str(), "hdr" | "pic" | "rgbe");
    bytes.starts_with(EXR) || bytes.starts_with(b"#?") || (image::guess_format(bytes).is_err() && is_called_so())
}

/// The width and the height of a picture, within the limits, before a pixel is decoded.
pub(in crate::import) fn size(name: &str, bytes: &[u8]) -> Result<[usize; 2], EnvironmentError> {
    guarded(|| {
        if bytes.starts_with(EXR) {
            let headers = exr_headers(bytes)?;
            let shown = headers.first().ok_or(EnvironmentError::NoColour)?.shared_attributes.display_window.size;
            Ok([shown.width(), shown.height()])
        } else if is_map(name, bytes) {
            hdr_head(&mut Cursor::new(bytes)).map(|head| head.size)
        } else {
            Err(EnvironmentError::Unknown)
        }
    })
}

/// Decodes a picture by its content, and by its name where that says nothing.
pub(in crate::import) fn decode(name: &str, bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    guarded(|| {
        if bytes.starts_with(EXR) {
            decode_exr(bytes).map(Picture::turned)
        } else if is_map(name, bytes) {
            decode_hdr(bytes)
        } else {
            Err(EnvironmentError::Unknown)
        }
    })
}

fn check_size(width: usize, height: usize) -> Result<(), EnvironmentError> {
    let pixels = (width as u64).checked_mul(height as u64);
    if pixels.is_some_and(|p| p > 0 && p <= limits::ENVIRONMENT_PIXELS) { Ok(()) } else { Err(EnvironmentError::Size { width, height }) }
}

/// What is said before the pixels of a Radiance picture.
struct Head {
    size: [usize; 2],
    /// What takes the pixels of each channel to radiance.
    scale: [f32; 3],
}

/// Reads what is before the pixels; programs that write such pictures disagree about the first line, so it is not insisted on.
fn hdr_head(bytes: &mut Cursor<&[u8]>) -> Result<Head, EnvironmentError> {
    let decoder = HdrDecoder::new_nonstrict(bytes)?;
    let (width, height) = decoder.dimensions();
    let size @ [width, height] = [width as usize, height as usize];
    check_size(width, height)?;
    // Pixels are radiance times what the lines EXPOSURE and COLORCORR of the header say.
    let metadata = decoder.metadata();
    let (red, green, blue) = metadata.color_correction.unwrap_or((1.0, 1.0, 1.0));
    let factors = [red, green, blue].map(|c| c * metadata.exposure.unwrap_or(1.0));
    let scale = factors.map(|factor| 1.0 / factor);
    let is_usable = |v: f32| v.is_finite() && v > 0.0;
    match factors.into_iter().zip(scale).find(|(factor, scale)| !(is_usable(*factor) && is_usable(*scale))) {
        Some((factor, _)) => Err(EnvironmentError::Factor(factor)),
        None => Ok(Head { size, scale }),
    }
}

/// Radiance pictures. The decoder writes into bytes: given one row at a time, it needs the bytes of one.
fn decode_hdr(bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    let mut rest = Cursor::new(bytes);
    let Head { size: [width, height], scale } = hdr_head(&mut rest)?;
    let row_head = format!("\n-Y 1 +X {width}\n");
    let mut raw = vec![0; width * 12];
    let mut rgb = vec![[0.0; 3]; width * height];
    for row in rgb.chunks_exact_mut(width).rev() {
        HdrDecoder::new_nonstrict(row_head.as_bytes().chain(&mut rest))?.read_image(&mut raw)?;
        for (pixel, p) in row.iter_mut().zip(raw.as_chunks::<12>().0) {
            *pixel = std::array::from_fn(|c| f32::from_ne_bytes([p[4 * c], p[4 * c + 1], p[4 * c + 2], p[4 * c + 3]]) * scale[c]);
        }
    }
    Ok(Picture { width, height, rgb, windows: None })
}

impl Picture {
    /// Upside down.
    fn turned(mut self) -> Self {
        let mut rows = self.rgb.chunks_exact_mut(self.width);
        while let (Some(low), Some(high)) = (rows.next(), rows.next_back()) {
            low.swap_with_slice(high);
        }
        self
    }
}

/// The heads of the layers of an OpenEXR picture, whose sizes are within the limits.
fn exr_headers(bytes: &[u8]) -> Result<Headers, EnvironmentError> {
    let headers = MetaData::read_from_buffered(Cursor::new(bytes), false)?.headers;
    for header in &headers {
        check_size(header.layer_size.width(), header.layer_size.height())?;
        let shown = header.shared_attributes.display_window.size;
        check_size(shown.width(), shown.height())?;
    }
    Ok(headers)
}

/// The first layer with colours, at full resolution, from the top row down; grey pictures have a channel Y alone.
fn decode_exr(bytes: &[u8]) -> Result<Picture, EnvironmentError> {
    let headers = exr_headers(bytes)?;
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|c| c.name == *name);
    let flat = || headers.iter().filter(|h| !h.deep);
    let data = |size: Vec2<usize>| Data { width: size.width(), rgb: vec![[0.0; 3]; size.area()] };
    let reader = || read().no_deep_data().largest_resolution_level();
    if flat().any(|h| ["R", "G", "B"].iter().all(|name| has(h, name))) {
        let set = |data: &mut Data, at: Vec2<usize>, (r, g, b): (f32, f32, f32)| data.rgb[at.y() * data.width + at.x()] = [r, g, b];
        let layer = reader().rgb_channels(move |size, _| data(size), set).first_valid_layer().all_attributes();
        let image = layer.non_parallel().from_buffered(Cursor::new(bytes))?;
        Ok(shown(image.layer_data.channel_data.pixels, image.layer_data.attributes.layer_position, image.attributes.display_window))
    } else if let Some(grey) = flat().find(|h| has(h, "Y")) {
        if ["RY", "BY"].iter().any(|name| has(grey, name)) {
            return Err(EnvironmentError::Chroma);
        }
        let set = |data: &mut Data, at: Vec2<usize>, (y,): (f32,)| data.rgb[at.y() * data.width + at.x()] = [y; 3];
        let layer = reader().specific_channels().required("Y").collect_pixels(move |size, _| data(size), set);
        let image = layer.first_valid_layer().all_attributes().non_parallel().from_buffered(Cursor::new(bytes))?;
        Ok(shown(image.layer_data.channel_data.pixels, image.layer_data.attributes.layer_position, image.attributes.display_window))
    } else {
        Err(EnvironmentError::NoColour)
    }
}

/// The pixels of a data window.
struct Data {
    width: usize,
    rgb: Vec<[f32; 3]>,
}

/// The picture in the display window, which is the whole sphere; renders of a part of it have pixels in a data window only.
fn shown(data: Data, position: Vec2<i32>, display: IntegerBounds) -> Picture {
    let (width, height) = (display.size.width(), display.size.height());
    let rows = data.rgb.len() / data.width.max(1);
    if position == display.position && (data.width, rows) == (width, height) {
        return Picture { width, height, rgb: data.rgb, windows: None };
    }
    let [x, y] = [0, 1].map(|axis| {
        let of = |v: Vec2<i32>| i64::from(if axis == 0 { v.x() } else { v.y() });
        of(position) - of(display.position)
    });
    let mut rgb = vec![[0.0; 3]; width * height];
    for (row, pixels) in data.rgb.chunks_exact(data.width.max(1)).enumerate() {
        let Some(to) = usize::try_from(y + row as i64).ok().filter(|to| *to < height) else { continue };
        let (from, skipped) = (x.clamp(0, width as i64) as usize, (-x).clamp(0, data.width as i64) as usize);
        let kept = (data.width - skipped).min(width - from);
        rgb[to * width + from..][..kept].copy_from_slice(&pixels[skipped..][..kept]);
    }
    let place = |p: Vec2<i32>| format!("({}, {})", p.x(), p.y());
    let (data_place, display_place) = (place(position), place(display.position));
    let windows = format!(
        "pixels in a data window of {}x{rows} at {data_place}, of a display window of {width}x{height} at {display_place}",
        data.width
    );
    Picture { width, height, rgb, windows: Some(windows) }
}
