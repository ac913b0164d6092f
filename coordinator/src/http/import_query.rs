//! The import options as query parameters, for every call that uploads a scene.
//!
//! Each call lists its own parameters and these in one flat structure: a query with unknown names is refused, which the form encoding
//! cannot combine with nested structures.

use super::{
    catalogue::Kind,
    problem::{Answer, Failure},
};
use kiln_proto::options::ImportOptions;

/// Declares the query of an upload: its own fields, then those of [`ImportOptions`].
macro_rules! upload_query {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        #[derive(Debug, serde::Deserialize, utoipa::IntoParams)]
        #[serde(deny_unknown_fields)]
        #[into_params(parameter_in = Query)]
        pub(super) struct $name {
            $($(#[$field_meta])* pub $field: $type,)*
            /// The scene among the files, where several could be it.
            main: Option<String>,
            /// Seconds at which animations are evaluated; absent: the rest pose.
            time: Option<f64>,
            /// The axis of the file that points up; the scene is turned so that it is +Y: `x`, `y` (the default) or `z`.
            #[param(value_type = Option<String>)]
            up: Option<kiln_proto::options::UpAxis>,
            /// The file of the upload that is the environment: a lat-long map, Radiance HDR or OpenEXR.
            environment: Option<String>,
            /// Degrees by which the environment is turned about +Y.
            environment_rotation: Option<f32>,
            /// Factor on the environment; absent: 1.
            environment_intensity: Option<f32>,
            /// What the numbers of X3D lights mean: `x3d` (the default) or `physical`.
            #[param(value_type = Option<String>)]
            light_units: Option<kiln_proto::options::LightUnits>,
            /// Whether X3D's `receiveShadows` decides who receives shadows: `physical` (no, the default) or `strict`.
            #[param(value_type = Option<String>)]
            x3d_shadows: Option<kiln_proto::options::ShadowMode>,
            /// What an X3D texture projected from a light does: `surface` (it textures its shape, the default) or `light`.
            #[param(value_type = Option<String>)]
            x3d_projectors: Option<kiln_proto::options::ProjectorMode>,
            /// What lies outside an X3D shadow map: `lit` (the default) or `shadowed`.
            #[param(value_type = Option<String>)]
            x3d_outside_map: Option<kiln_proto::options::OutsideMap>,
        }

        impl $name {
            /// The import options that the query says.
            ///
            /// # Errors
            /// Numbers out of range.
            pub(super) fn options(&self) -> $crate::http::problem::Answer<kiln_proto::options::ImportOptions> {
                $crate::http::import_query::checked(kiln_proto::options::ImportOptions {
                    main: self.main.clone(),
                    time: self.time,
                    up: self.up.unwrap_or_default(),
                    environment: self.environment.clone(),
                    environment_rotation: self.environment_rotation.unwrap_or_default(),
                    environment_intensity: self.environment_intensity,
                    light_units: self.light_units.unwrap_or_default(),
                    x3d_shadows: self.x3d_shadows.unwrap_or_default(),
                    x3d_projectors: self.x3d_projectors.unwrap_or_default(),
                    x3d_outside_map: self.x3d_outside_map.unwrap_or_default(),
                })
            }
        }
    };
}
pub(super) use upload_query;

/// Options within their ranges.
///
/// # Errors
/// The first that is not.
pub(super) fn checked(options: ImportOptions) -> Answer<ImportOptions> {
    match options.check() {
        Ok(()) => Ok(options),
        Err(bad) => Err(Failure::new(Kind::InvalidRequest, bad.to_string()).field(bad.field)),
    }
}

/// The schema of the options as scenes record them.
pub(super) fn schema() -> serde_json::Value {
    let word = |words: &[&str]| serde_json::json!({"type": "string", "enum": words});
    serde_json::json!({
        "type": "object",
        "description": "How a scene was read: the query parameters of its upload.",
        "properties": {
            "main": {"type": "string"}, "time": {"type": "number"}, "up": word(&["x", "y", "z"]), "environment": {"type": "string"}, "environment_rotation": {"type": "number"},
            "environment_intensity": {"type": "number"}, "light_units": word(&["x3d", "physical"]), "x3d_shadows": word(&["physical", "strict"]),
            "x3d_projectors": word(&["surface", "light"]), "x3d_outside_map": word(&["lit", "shadowed"]),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_schema_has_every_option() {
        let all = ImportOptions {
            main: Some("a.obj".into()),
            time: Some(1.0),
            environment: Some("a.hdr".into()),
            environment_rotation: 1.0,
            environment_intensity: Some(1.0),
            ..ImportOptions::default()
        };
        let fields = serde_json::to_value(all).unwrap();
        let described = schema();
        for (name, value) in fields.as_object().unwrap() {
            let property = &described["properties"][name];
            assert!(property["enum"].as_array().is_none_or(|words| words.contains(value)) && !property.is_null(), "{name}");
        }
        assert_eq!(described["properties"].as_object().unwrap().len(), fields.as_object().unwrap().len());
    }
}
