//! Which extensions are read, which are skipped by name, and which a file may not require.

use super::{json::Json, report::Report};

/// Read where they occur.
const READ: [&str; 18] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];
/// Skipped with a word where they occur: the rest of the file means the same without them, or nearly.
const SKIPPED: [&str; 8] = [
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_materials_anisotropy",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "EXT_meshopt_compression",
];
/// What a file that requires one of these is told to do.
const COMPRESSED: [(&str, &str); 8] = [
    ("EXT_meshopt_compression", "export it without mesh compression"),
    ("KHR_meshopt_compression", "export it without mesh compression"),
    ("KHR_draco_mesh_compression", "export it without mesh compression"),
    ("EXT_texture_avif", "export its images as PNG or JPEG"),
    ("EXT_texture_webp", "export its images as PNG or JPEG"),
    ("KHR_gaussian_splatting", "only triangles are baked"),
    ("KHR_texture_basisu", "export its images as PNG or JPEG"),
    ("MSFT_texture_dds", "export its images as PNG or JPEG"),
];

/// Checks what a file says that it needs and uses.
pub(super) fn check(root: Json<'_>, report: &mut Report<'_>) {
    for at in report.list(root, "extensionsRequired") {
        let Some(name) = at.string() else {
            report.error(at, "the name of an extension must be a string");
            continue;
        };
        if let Some((_, advice)) = COMPRESSED.iter().find(|(known, _)| *known == name) {
            report.error(at, format!("the file requires {name}, which is not decoded; {advice}"));
        } else if !READ.contains(&name.as_ref()) && !SKIPPED.contains(&name.as_ref()) {
            report.error(at, format!("the file requires the extension {name}, which is not read; export it without"));
        }
    }
    for at in report.list(root, "extensionsUsed") {
        let name = at.string().unwrap_or_default();
        let known = |list: &[&str]| list.contains(&name.as_ref());
        if !known(&READ) && !known(&SKIPPED) && !COMPRESSED.iter().any(|(c, _)| *c == name) {
            report.warn_once(at, &format!("used {name}"), format!("the extension {name} is not read; what it says was ignored"));
        }
    }
}
