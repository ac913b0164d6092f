//! Which extensions are known, and which of them a file may not require.

use super::{json::Json, report::Report};

/// What is said of compressed meshes and images.
const NO_MESHES: Option<&str> = Some("export it without mesh compression");
const NO_IMAGES: Option<&str> = Some("export its images as PNG or JPEG");

/// The extensions that are known, and what a file is told to do that requires one which is not decoded. The others are read, or skipped
/// with a word where they occur: the rest of the file means the same without them, or nearly.
const KNOWN: [(&str, Option<&str>); 29] = [
    ("EXT_mesh_gpu_instancing", None),
    ("EXT_meshopt_compression", NO_MESHES),
    ("EXT_texture_avif", NO_IMAGES),
    ("EXT_texture_webp", NO_IMAGES),
    ("KHR_animation_pointer", None),
    ("KHR_draco_mesh_compression", NO_MESHES),
    ("KHR_gaussian_splatting", Some("only triangles are baked")),
    ("KHR_lights_punctual", None),
    ("KHR_materials_anisotropy", None),
    ("KHR_materials_clearcoat", None),
    ("KHR_materials_diffuse_transmission", None),
    ("KHR_materials_dispersion", None),
    ("KHR_materials_emissive_strength", None),
    ("KHR_materials_ior", None),
    ("KHR_materials_iridescence", None),
    ("KHR_materials_pbrSpecularGlossiness", None),
    ("KHR_materials_sheen", None),
    ("KHR_materials_specular", None),
    ("KHR_materials_transmission", None),
    ("KHR_materials_unlit", None),
    ("KHR_materials_variants", None),
    ("KHR_materials_volume", None),
    ("KHR_mesh_quantization", None),
    ("KHR_meshopt_compression", NO_MESHES),
    ("KHR_node_visibility", None),
    ("KHR_texture_basisu", NO_IMAGES),
    ("KHR_texture_transform", None),
    ("KHR_xmp_json_ld", None),
    ("MSFT_texture_dds", NO_IMAGES),
];

/// Checks what a file says that it needs and uses.
pub(super) fn check(root: Json<'_>, report: &mut Report<'_>) {
    for at in report.list(root, "extensionsRequired") {
        let Some(name) = at.string() else {
            report.error(at, "the name of an extension must be a string");
            continue;
        };
        match KNOWN.iter().find(|(known, _)| *known == name) {
            Some((_, None)) => {}
            Some((_, Some(advice))) => report.error(at, format!("the file requires {name}, which is not decoded; {advice}")),
            None => report.error(at, format!("the file requires the extension {name}, which is not read; export it without")),
        }
    }
    for at in report.list(root, "extensionsUsed") {
        let name = at.string().unwrap_or_default();
        if !KNOWN.iter().any(|(known, _)| *known == name) {
            report.warn_once(at, &format!("used {name}"), format!("the extension {name} is not read; what it says was ignored"));
        }
    }
}
