//! Which format a file is: by its content where that is unmistakable, else by its name.

use crate::records::Problem;

/// What a file turned out to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ, or a text that may be one.
    Obj,
    /// glTF 2.0, text or binary.
    Gltf,
    /// X3D or VRML97, in any encoding, gzip or not.
    X3d,
    /// A ZIP archive.
    Zip,
    /// A scene in a format that this version does not read.
    Unsupported(&'static str),
}

/// Endings of the names of scenes that are read.
const SCENES: [&str; 11] = ["obj", "gltf", "glb", "x3d", "x3dv", "x3dj", "x3dz", "x3dvz", "wrl", "wrz", "vrml"];

const LATER: [(&str, &str); 10] = [
    ("fbx", "FBX"),
    ("dae", "COLLADA"),
    ("blend", "Blender"),
    ("usd", "USD"),
    ("usda", "USD"),
    ("usdz", "USD"),
    ("ply", "PLY"),
    ("stl", "STL"),
    ("3ds", "3DS"),
    ("abc", "Alembic"),
];

/// The part of a name behind its last dot, in lower case; empty where there is none.
#[must_use]
pub fn extension(name: &str) -> String {
    let file = name.rsplit('/').next().unwrap_or(name);
    file.rsplit_once('.').map(|(_, e)| e.to_lowercase()).unwrap_or_default()
}

/// The scene format that a file's name promises, if it is one that this version does not read.
#[must_use]
pub fn unsupported_by_name(name: &str) -> Option<&'static str> {
    let ext = extension(name);
    LATER.iter().find(|(e, _)| *e == ext).map(|(_, what)| *what)
}

/// Whether a file's name promises a scene that is read.
#[must_use]
pub fn is_scene(name: &str) -> bool {
    SCENES.contains(&extension(name).as_str())
}

/// Decides what `bytes` (the beginning is enough) under `name` are.
#[must_use]
pub fn detect(name: &str, bytes: &[u8]) -> Format {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let starts = |magic: &[u8]| text.get(..magic.len()).is_some_and(|head| head.eq_ignore_ascii_case(magic));
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06") {
        return Format::Zip;
    }
    if starts(b"glTF") {
        return Format::Gltf;
    }
    if let Some(inside) = text.strip_prefix(b"{") {
        return if inside.trim_ascii_start().starts_with(b"\"X3D\"") { Format::X3d } else { Format::Gltf };
    }
    if starts(b"<") {
        let is_collada = text.windows(8).any(|w| w == b"<COLLADA");
        return if is_collada { Format::Unsupported("COLLADA") } else { Format::X3d };
    }
    if starts(b"#X3D") || starts(b"#VRML") || bytes.starts_with(b"\x1f\x8b") {
        return Format::X3d;
    }
    let by_content = [(b"Kaydara FBX".as_slice(), "FBX"), (b"BLENDER", "Blender"), (b"ply\n", "PLY"), (b"ply\r", "PLY")];
    let found = by_content.iter().find(|(magic, _)| starts(magic)).map(|(_, what)| *what);
    found.or_else(|| unsupported_by_name(name)).map_or_else(|| by_name(name), Format::Unsupported)
}

fn by_name(name: &str) -> Format {
    match extension(name).as_str() {
        "gltf" | "glb" => Format::Gltf,
        ending if is_scene(name) && ending != "obj" => Format::X3d,
        _ => Format::Obj,
    }
}

/// Why a scene of an unread format is refused.
#[must_use]
pub fn refusal(file: &str, what: &str) -> Problem {
    let message = format!(
        "this is {what}, which this version does not import; it imports Wavefront OBJ with MTL, glTF 2.0, X3D and VRML97, as a file, several files or a ZIP"
    );
    Problem { message, file: Some(file.to_owned()), line: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_decides_before_the_name() {
        assert_eq!(detect("a.obj", b"v 0 0 0\n"), Format::Obj);
        assert_eq!(detect("a.obj", b"PK\x03\x04rest"), Format::Zip);
        assert_eq!(detect("a.obj", b"glTF\x02\0\0\0"), Format::Gltf);
        assert_eq!(detect("a.obj", b"\xef\xbb\xbf  {\"asset\": {}}"), Format::Gltf);
        assert_eq!(detect("a.glb", b"\0\0"), Format::Gltf);
        assert_eq!(detect("a.obj", b"#VRML V2.0 utf8\n"), Format::X3d);
        assert_eq!(detect("a.json", b"{ \"X3D\": {}}"), Format::X3d);
        assert_eq!(detect("a.xml", b"<?xml version='1.0'?><X3D/>"), Format::X3d);
        assert_eq!(detect("a.dae", b"<?xml version='1.0'?><COLLADA/>"), Format::Unsupported("COLLADA"));
        assert_eq!(detect("a.x3dz", b"\x1f\x8b\x08"), Format::X3d);
        assert_eq!(detect("dir.x/scene.STL", b"solid"), Format::Unsupported("STL"));
        assert_eq!(detect("dir.stl/scene", b""), Format::Obj);
    }
}
