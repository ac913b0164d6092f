//! What files declare: pictures, which decode to more than they are, and what a gzip stream unpacks to. Memory for these is not counted
//! against a parser.
//!
//! Pictures are looked for as readers find them: by their magic numbers wherever they stand (buffers hold them too), by the names of files
//! where they have none, and in data URIs. What is declared and refused, since it is more than a picture may have, allows nothing.

use base64::{Engine as _, engine::general_purpose::STANDARD_NO_PAD};
use exr::meta::MetaData;
use flate2::read::MultiGzDecoder;
use image::{ImageDecoder as _, ImageFormat, ImageReader, codecs::hdr::HdrDecoder};
use kiln_proto::limits;
use percent_encoding::percent_decode;
use std::{
    borrow::Cow,
    io::{Cursor, Read as _},
};

/// Bytes for each byte of an unpacked text: the nodes of X3D, empty ones, take 45 times what they are written in.
const TEXT: u64 = 48;
/// How often the light from all around may hold a picture: a face of a cube is half of the map around it that has eight times its pixels,
/// and four maps of three floats are held while two of them are added up.
const MAPS: u64 = 25;
/// Most that is unpacked to be looked at.
const UNPACKED: u64 = 64 << 20;

/// Bytes that importing these files, each with its name, may take for what they declare.
pub(super) fn files(files: &[(&str, &[u8])]) -> u64 {
    let plain: Vec<(&str, Cow<'_, [u8]>)> = files.iter().map(|(name, bytes)| (*name, plain(bytes))).collect();
    let unpacked = plain.iter().filter(|(_, bytes)| matches!(bytes, Cow::Owned(_))).map(|(_, bytes)| TEXT * bytes.len() as u64).sum();
    let pictures = plain.iter().map(|(name, bytes)| file(name, bytes)).fold(0, u64::saturating_add);
    let has_lights = plain.iter().any(|(_, bytes)| bytes.windows(16).any(|w| w == b"EnvironmentLight"));
    pictures.saturating_mul(if has_lights { MAPS } else { 1 }).saturating_add(unpacked)
}

/// What bytes declare that are decoded as a picture whatever their name is.
pub(super) fn picture(bytes: &[u8]) -> u64 {
    images(bytes).max(tga(bytes))
}

/// Two pictures of three floats each: what is decoded, and what is made of it.
pub(super) fn hdr(bytes: &[u8]) -> u64 {
    let size = HdrDecoder::new_nonstrict(Cursor::new(bytes)).map(|decoder| decoder.dimensions());
    size.map_or(0, |size| 2 * pixels(size, limits::ENVIRONMENT_PIXELS))
}

/// The same for every layer of the file and for its display window, and its own samples.
pub(super) fn exr(bytes: &[u8]) -> u64 {
    let Ok(meta) = MetaData::read_from_buffered(Cursor::new(bytes), false) else { return 0 };
    let picture = |size: exr::prelude::Vec2<usize>| pixels((size.width() as u32, size.height() as u32), limits::ENVIRONMENT_PIXELS);
    let layer = |header: &exr::meta::header::Header| {
        let data = picture(header.layer_size).saturating_mul(2 + header.channels.list.len() as u64);
        data.saturating_add(2 * picture(header.shared_attributes.display_window.size))
    };
    meta.headers.iter().map(layer).fold(0, u64::saturating_add)
}

/// What a text is once it is unpacked, and without the zeros of UTF-16: as much of it as there is of a stream that breaks off.
fn plain(bytes: &[u8]) -> Cow<'_, [u8]> {
    if bytes.starts_with(b"\x1f\x8b") {
        let mut unpacked = vec![];
        // A broken stream was read up to where it breaks.
        let _ = MultiGzDecoder::new(bytes).take(UNPACKED).read_to_end(&mut unpacked);
        Cow::Owned(unpacked)
    } else if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        Cow::Owned(bytes.iter().copied().filter(|b| *b != 0).collect())
    } else {
        Cow::Borrowed(bytes)
    }
}

/// The pictures of a file of this name, or of data without one.
fn file(name: &str, bytes: &[u8]) -> u64 {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_lowercase()).unwrap_or_default();
    let by_name = match ending.as_str() {
        "tga" => tga(bytes),
        "hdr" | "pic" | "rgbe" => hdr(bytes),
        _ if bytes.starts_with(b"#?") => hdr(bytes),
        _ => exr(bytes),
    };
    let inside = data(bytes).map(|data| file("", &data)).fold(by_name, u64::saturating_add);
    inside.saturating_add(images(bytes))
}

/// Eight bytes a pixel while an image is decoded (four channels of 16 bits), eight more for what is made of it; those of all images that
/// begin anywhere.
fn images(bytes: &[u8]) -> u64 {
    let starts = (0..bytes.len()).filter(|at| begins_image(&bytes[*at..]));
    let sizes = starts.filter_map(|at| ImageReader::new(Cursor::new(&bytes[at..])).with_guessed_format().ok()?.into_dimensions().ok());
    sizes.map(|size| pixels(size, limits::TEXTURE_PIXELS)).fold(0, u64::saturating_add)
}

/// Two letters are too little of a BMP: chance writes them, and what follows would declare gigabytes. So the length of its second header,
/// of which there are six, is looked at as well.
fn begins_image(bytes: &[u8]) -> bool {
    let length = || bytes.get(14..18).and_then(|length| length.first_chunk()).map(|length| u32::from_le_bytes(*length));
    let is_bmp = || bytes.starts_with(b"BM") && matches!(length(), Some(12 | 40 | 52 | 56 | 108 | 124));
    bytes.starts_with(b"\x89PNG") || bytes.starts_with(b"\xff\xd8\xff") || is_bmp()
}

/// What the bytes declare if they are a TGA, which no magic number tells.
fn tga(bytes: &[u8]) -> u64 {
    ImageReader::with_format(Cursor::new(bytes), ImageFormat::Tga).into_dimensions().map_or(0, |size| pixels(size, limits::TEXTURE_PIXELS))
}

/// Sixteen bytes each; nothing for more of them than any picture may have.
fn pixels((width, height): (u32, u32), most: u64) -> u64 {
    let pixels = u64::from(width) * u64::from(height);
    if pixels > most { 0 } else { 16 * pixels }
}

/// The bytes of all data URIs of a text. Its own escapes end a URI or leave it (`\/` in JSON): a picture says its size in front.
fn data(text: &[u8]) -> impl Iterator<Item = Vec<u8>> {
    let marks = text.windows(5).enumerate().filter(|(_, word)| word.eq_ignore_ascii_case(b"data:"));
    marks.filter_map(|(at, _)| {
        let rest = &text[at + 5..];
        let ends = |b: &u8| b.is_ascii_whitespace() || b"\"'<>&:".contains(b);
        let uri = &rest[..rest.iter().position(ends).unwrap_or(rest.len())];
        let comma = uri.iter().position(|b| *b == b',')?;
        let (head, body) = (uri[..comma].to_ascii_lowercase(), &uri[comma + 1..]);
        let body: Vec<u8> = body.iter().copied().filter(|b| *b != b'\\').collect();
        let body: Vec<u8> = percent_decode(&body).collect();
        Some(if head.ends_with(b"base64") { from_base64(&body) } else { body })
    })
}

/// The bytes of as much as is base64.
fn from_base64(text: &[u8]) -> Vec<u8> {
    let is_digit = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'/');
    let length = text.iter().position(|b| !is_digit(b)).unwrap_or(text.len());
    STANDARD_NO_PAD.decode(&text[..length / 4 * 4]).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::find;
    use super::*;
    use base64::engine::general_purpose::STANDARD;
    use flate2::{Compression, write::GzEncoder};
    use image::RgbImage;
    use std::io::Write as _;

    /// Bytes that are declared by an image of 20 x 10 pixels.
    const IMAGE: u64 = 20 * 10 * 16;

    fn image(format: ImageFormat) -> Vec<u8> {
        let mut out = Cursor::new(vec![]);
        RgbImage::new(20, 10).write_to(&mut out, format).unwrap();
        out.into_inner()
    }

    fn declared(target: &str, bytes: &[u8]) -> u64 {
        (find(target).unwrap().images)(bytes)
    }

    #[test]
    fn images_in_scenes_are_found_as_they_are_and_in_data_uris() {
        let png = image(ImageFormat::Png);
        let coded = STANDARD.encode(&png);
        let escaped: String = png.iter().map(|b| format!("%{b:02x}")).collect();
        for uri in
            [format!("data:image/png;base64,{coded}"), format!("DATA:;Base64,{}", coded.replace('/', "\\/")), format!("data:,{escaped}")]
        {
            for target in ["gltf", "x3d_xml", "x3d_classic", "x3d_json", "obj"] {
                assert_eq!(declared(target, format!("'{uri}' \"{uri}\"").as_bytes()), 2 * IMAGE, "{target} {uri}");
            }
        }
        assert_eq!(declared("glb", &[b"glTF".to_vec(), png].concat()), IMAGE);
        assert_eq!(declared("x3d_xml", format!("<EnvironmentLight url='data:;base64,{coded}'/>").as_bytes()), MAPS * IMAGE);
    }

    /// No reader looks at the reserved bytes of a BMP.
    #[test]
    fn a_bmp_is_known_by_its_second_header() {
        let mut bmp = image(ImageFormat::Bmp);
        bmp[6..10].fill(7);
        assert_eq!(declared("image", &bmp), IMAGE);
        bmp[14..18].copy_from_slice(&[40, 0, 0, 1]);
        assert_eq!(images(&bmp), 0);
        assert_eq!(pixels((1 << 16, 1 << 16), limits::TEXTURE_PIXELS), 0, "what is refused is not decoded");
        let sky = |side: u32| hdr(format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {side} +X {side}\n").as_bytes());
        assert_eq!((sky(16), sky(16_384)), (2 * 16 * 256, 0));
    }

    #[test]
    fn a_gzip_stream_declares_what_is_in_it() {
        let text = format!("<X3D url='data:image/jpeg;base64,{}'/>", STANDARD.encode(image(ImageFormat::Jpeg)));
        let mut packed = GzEncoder::new(vec![], Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        let packed = packed.finish().unwrap();
        assert_eq!(declared("x3d_gzip", &packed), IMAGE + TEXT * text.len() as u64);
        assert!(declared("x3d_gzip", &packed[..packed.len() - 8]) >= IMAGE, "broken off");
        assert_eq!(declared("x3d_rewrite", &packed), declared("x3d_gzip", &packed));
    }

    #[test]
    fn files_of_a_bundle_are_known_by_their_names_too() {
        let bundle = |name: &str, bytes: &[u8]| declared("bundle", &[b"\n#### ", name.as_bytes(), b"\n", bytes].concat());
        let (hdr, exr) = (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 10 +X 20\n".as_slice(), image_exr());
        assert_eq!([bundle("a.TGA", &image(ImageFormat::Tga)), bundle("a", hdr), bundle("a.pic", hdr)], [IMAGE, 2 * IMAGE, 2 * IMAGE]);
        assert_eq!((bundle("a", &exr) / IMAGE, bundle("a.png", &image(ImageFormat::Png))), (7, IMAGE));
    }

    fn image_exr() -> Vec<u8> {
        use exr::prelude::{Image, SpecificChannels, WritableImage as _};
        let mut out = Cursor::new(vec![]);
        let channels = SpecificChannels::rgb(|_: exr::prelude::Vec2<usize>| (0f32, 0f32, 0f32));
        Image::from_channels((20, 10), channels).write().non_parallel().to_buffered(&mut out).unwrap();
        out.into_inner()
    }
}
