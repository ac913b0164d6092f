//! JSON Schemas of the bake settings, for the OpenAPI document.
//!
//! The settings' types live in `proto`, which knows nothing of OpenAPI, and several are written as text (`20x20`, `200x100`, `auto`) that a
//! derive would describe wrongly. So their schemas stand here as one table; a test holds it against the types: every field, every default,
//! every enum value.

use kiln_proto::limits;
use serde_json::{Map, Value, json};

/// Schema and description of every field that a patch may have, in the order in which a reader wants them. Defaults are the preview
/// preset's.
fn patch_fields() -> Vec<(&'static str, Value, &'static str)> {
    let text = |pattern: &str, example: &str, default: &str| json!({"type": "string", "pattern": pattern, "examples": [example], "default": default});
    let words = |words: &[&str]| json!({"type": "string", "enum": words, "default": words[0]});
    let whole = |low: u64, high: u64| json!({"type": "integer", "minimum": low, "maximum": high});
    vec![
        (
            "preset",
            json!({"type": "string", "enum": ["draft", "preview", "production"], "default": "preview"}),
            "Where defaults come from. `draft`: 64 samples, depth 3, half the texel density (seconds); `preview`: 256 samples, depth 5 (minutes); \
             `production`: 1,024 samples, depth 8 (as long as it takes).",
        ),
        (
            "samples",
            whole(1, limits::SAMPLES.into()),
            "Shared incident samples per texel; a quarter as many light samples are added. Default: the preset's.",
        ),
        (
            "max_depth",
            whole(1, limits::MAX_DEPTH.into()),
            "Longest path: 1 is emission, 2 direct light, k adds k - 2 bounces. Default: the preset's.",
        ),
        (
            "directions",
            text("^[0-9]+x[0-9]+$", "20x20", "20x20"),
            "Direction grid, INCLINATIONSxAZIMUTHS, each from 1 to 64, azimuths even.",
        ),
        ("footprint", words(&["area", "point"]), "Where on a texel light is gathered: over the covered part, or at its centre alone."),
        (
            "texel_scale",
            json!({"type": "number", "minimum": 0.001, "maximum": 64}),
            "Factor on both sides of every texture, explicit sizes included. Default: the preset's, 0.5 for draft and 1 otherwise.",
        ),
        (
            "texels_per_metre",
            json!({"type": "number", "minimum": 1e-6, "maximum": 1e6, "default": 20}),
            "Texel density of surfaces without an explicit size, 1/m.",
        ),
        (
            "texture_sizes",
            json!({"type": "object", "additionalProperties": {"type": "string", "pattern": "^[0-9]+x[0-9]+$"}, "default": {},
                "examples": [{"floor": "200x100"}]}),
            "Explicit texture sizes by surface name, WIDTHxHEIGHT, each from 1 to 8192.",
        ),
        ("codec", words(&["pwl"]), "How the package is compressed: `pwl`, piecewise linear segments along the directions of a texel."),
        (
            "rule",
            json!({"type": "string", "enum": ["thesis", "cumulative", "bounded"], "default": "bounded"}),
            "How `pwl` picks the samples it keeps: `thesis` bounds the change of slope, `cumulative` a segment's summed error, `bounded` each \
             sample's error.",
        ),
        (
            "eps",
            json!({"type": "integer", "minimum": 0, "maximum": 255, "default": 2}),
            "With the rule `bounded`: the largest error, in 8-bit levels.",
        ),
        (
            "threshold",
            json!({"type": "integer", "minimum": 0, "maximum": 765, "default": 6}),
            "With the rules `thesis` and `cumulative`: T.",
        ),
        (
            "exposure",
            json!({"oneOf": [{"type": "string", "const": "auto"}, {"type": "number", "minimum": -64, "maximum": 64}], "default": "auto"}),
            "Exposure of the 8-bit coding: `auto` (98th percentile of the probed radiance becomes 1) or stops, rounded to 1/8.",
        ),
        (
            "walk",
            words(&["auto", "theta", "phi"]),
            "Order in which `pwl` walks the directions; `auto` takes the smoother for each surface.",
        ),
        ("seed", json!({"type": "integer", "minimum": 0, "default": 0}), "Seed of every sample sequence."),
        (
            "raw",
            json!({"type": ["string", "null"], "enum": ["u8", "f32", null], "default": null}),
            "Uncompressed radiance to keep beside the compressed files.",
        ),
        (
            "frame",
            words(&["texture", "thesis"]),
            "How frames are oriented: the tangent follows the texture, or the thesis's rotation of +Y.",
        ),
    ]
}

fn object(fields: Vec<(&'static str, Value, &'static str)>, description: &str, required: bool) -> Value {
    let names: Vec<&str> = fields.iter().map(|(name, ..)| *name).collect();
    let mut schema = json!({"type": "object", "description": description, "additionalProperties": false});
    if required {
        schema["required"] = json!(names);
    }
    let described = fields.into_iter().map(|(name, mut field, what)| {
        field["description"] = what.into();
        (name.to_owned(), field)
    });
    schema["properties"] = Value::Object(described.collect::<Map<_, _>>());
    schema
}

/// What a request may say: every field optional.
#[must_use]
pub(super) fn settings_patch() -> Value {
    let mut schema = object(
        patch_fields(),
        "Settings that differ from the preset's. Every field is optional; unknown fields are refused by name.",
        false,
    );
    schema["examples"] =
        json!([{"preset": "draft"}, {"preset": "production", "rule": "bounded", "eps": 1, "texture_sizes": {"floor": "200x100"}}]);
    schema
}

/// Settings with every value decided.
#[must_use]
pub(super) fn bake_settings() -> Value {
    let rule = json!({"oneOf": [
        {"type": "object", "required": ["rule", "threshold"], "properties": {
            "rule": {"type": "string", "enum": ["thesis", "cumulative"]}, "threshold": {"type": "integer", "minimum": 0, "maximum": 765}}},
        {"type": "object", "required": ["rule", "eps"], "properties": {
            "rule": {"type": "string", "const": "bounded"}, "eps": {"type": "integer", "minimum": 0, "maximum": 255}}},
    ]});
    let decided = patch_fields().into_iter().filter(|(name, ..)| *name != "eps" && *name != "threshold");
    let fields = decided.map(|(name, mut schema, what)| {
        if name == "rule" {
            schema = rule.clone();
        }
        if let Some(schema) = schema.as_object_mut() {
            schema.remove("default");
        }
        (name, schema, what)
    });
    object(fields.collect(), "Settings with every value decided.", true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::settings::SettingsPatch;
    use std::collections::BTreeSet;

    fn names(schema: &Value) -> BTreeSet<String> {
        schema["properties"].as_object().unwrap().keys().cloned().collect()
    }

    fn parse(name: &str, value: &Value) -> Result<SettingsPatch, serde_json::Error> {
        serde_json::from_value(json!({ name: value }))
    }

    #[test]
    fn the_patch_has_exactly_the_fields_of_its_type() {
        // The message of an unknown field lists all that are known.
        let message = parse("?", &Value::Null).unwrap_err().to_string();
        let known: BTreeSet<String> = message.split('`').skip(3).step_by(2).map(str::to_owned).collect();
        assert_eq!(names(&settings_patch()), known);
    }

    #[test]
    fn the_decided_settings_have_exactly_the_fields_of_their_type() {
        let decided = serde_json::to_value(SettingsPatch::default().resolve().unwrap()).unwrap();
        assert_eq!(names(&bake_settings()), decided.as_object().unwrap().keys().cloned().collect());
    }

    #[test]
    fn documented_values_are_accepted_and_defaults_are_true() {
        let plain = SettingsPatch::default().resolve().unwrap();
        for (name, schema, _) in patch_fields() {
            for value in schema["enum"].as_array().into_iter().chain(schema["examples"].as_array()).flatten() {
                assert!(parse(name, value).is_ok(), "{name}: {value}");
            }
            if let Some(default) = schema.get("default").filter(|_| name != "threshold") {
                assert_eq!(parse(name, default).unwrap().resolve().unwrap(), plain, "{name}: {default}");
            }
            for bound in ["minimum", "maximum"] {
                let Some(limit) = schema.get(bound).filter(|_| name != "threshold") else { continue };
                assert!(parse(name, limit).unwrap().resolve().is_ok(), "{name}: {bound} {limit}");
                let beyond = if bound == "minimum" { limit.as_f64().unwrap() - 1.0 } else { limit.as_f64().unwrap() + 1.0 };
                let beyond = if limit.is_i64() || limit.is_u64() { json!(beyond as i64) } else { json!(beyond) };
                assert!(parse(name, &beyond).map_or(true, |patch| patch.resolve().is_err()), "{name}: {beyond} beyond its {bound}");
            }
        }
    }
}
