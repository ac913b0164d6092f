//! Import options: what a request may say of how a scene file is to be read. They act before the canonical scene exists, so a scene
//! imported with other options is another scene with another address. Every field is optional; unknown ones are refused by name.

use crate::limits;
use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};

/// How a scene file is read. The default reads it as its format means it, at rest.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImportOptions {
    /// The scene among the files, where several could be it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub main: Option<String>,
    /// Seconds at which animations are evaluated; absent: the rest pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The axis of the file that points up.
    pub up: UpAxis,
    /// The file of the bundle that is the environment: a lat-long map, Radiance HDR or OpenEXR.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment: Option<String>,
    /// Degrees by which the environment is turned about +Y.
    #[serde(skip_serializing_if = "is_zero")]
    pub environment_rotation: f32,
    /// Factor on the environment; absent: 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment_intensity: Option<f32>,
    /// What the numbers of X3D lights mean.
    pub light_units: LightUnits,
    /// Whether `receiveShadows` decides who receives shadows.
    pub x3d_shadows: ShadowMode,
    /// What a texture projected from a light does.
    pub x3d_projectors: ProjectorMode,
    /// What lies outside a directional shadow map.
    pub x3d_outside_map: OutsideMap,
}

/// The axis of a scene file that points up: it becomes +Y. glTF and X3D say that it is +Y, which not all of their files heed; OBJ says
/// nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// +X.
    X,
    /// +Y: the scene is taken as it is.
    #[default]
    Y,
    /// +Z.
    Z,
}

/// What the numbers of X3D lights mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LightUnits {
    /// X3D's lighting model: a Lambert surface at normal incidence has radiance Kd times intensity; attenuation by the light's own fields.
    #[default]
    X3d,
    /// W/sr with the inverse square (directional lights: W/m²).
    Physical,
}

/// Whether `receiveShadows` decides who receives shadows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShadowMode {
    /// Every light throws shadows on everything.
    #[default]
    Physical,
    /// Only where the file asks for them.
    Strict,
}

/// What a texture projected from a light does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProjectorMode {
    /// It textures the shape that carries it.
    #[default]
    Surface,
    /// It colours the light for every receiver.
    Light,
}

/// What lies outside a directional shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutsideMap {
    /// Light.
    #[default]
    Lit,
    /// Shadow (Kamburelis 5.2).
    Shadowed,
}

/// An option out of its range.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {reason}")]
pub struct BadOption {
    /// The field of [`ImportOptions`].
    pub field: &'static str,
    /// What is wrong and what is allowed.
    pub reason: String,
}

impl ImportOptions {
    /// Checks the ranges of numbers.
    ///
    /// # Errors
    /// A time, a rotation or an intensity that is not finite, negative where that means nothing, or beyond [`limits::BRIGHTEST`].
    pub fn check(&self) -> Result<(), BadOption> {
        let bad = |field, reason: String| Err(BadOption { field, reason });
        match self {
            Self { time: Some(t), .. } if !(t.is_finite() && *t >= 0.0) => bad("time", format!("{t} is not a number of seconds from 0 on")),
            Self { environment_rotation: r, .. } if !r.is_finite() => {
                bad("environment_rotation", format!("{r} is not a number of degrees"))
            }
            Self { environment_intensity: Some(i), .. } if !(0.0..=limits::BRIGHTEST).contains(i) => {
                bad("environment_intensity", format!("{i} is not a factor from 0 to {:e}", limits::BRIGHTEST))
            }
            Self { environment: None, environment_intensity: Some(_), .. } => {
                bad("environment_intensity", "there is no environment that it could act on".to_owned())
            }
            _ => Ok(()),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature.
fn is_zero(v: &f32) -> bool {
    *v == 0.0
}

macro_rules! words {
    ($type:ident, $what:literal, $($word:literal => $variant:ident),+) => {
        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$variant => $word),+ })
            }
        }
        impl FromStr for $type {
            type Err = String;
            fn from_str(text: &str) -> Result<Self, String> {
                match text {
                    $($word => Ok(Self::$variant),)+
                    other => Err(format!("{} `{other}`: expected {}", $what, [$($word),+].join(" or "))),
                }
            }
        }
    };
}
words!(UpAxis, "axis that points up", "x" => X, "y" => Y, "z" => Z);
words!(LightUnits, "light units", "x3d" => X3d, "physical" => Physical);
words!(ShadowMode, "X3D shadows", "physical" => Physical, "strict" => Strict);
words!(ProjectorMode, "X3D projectors", "surface" => Surface, "light" => Light);
words!(OutsideMap, "outside of a shadow map", "lit" => Lit, "shadowed" => Shadowed);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_said_is_the_default_and_unknown_words_are_refused() {
        assert_eq!(serde_json::from_str::<ImportOptions>("{}").unwrap(), ImportOptions::default());
        assert!(serde_json::from_str::<ImportOptions>(r#"{"tme": 1}"#).unwrap_err().to_string().contains("tme"));
        assert!("strickt".parse::<ShadowMode>().unwrap_err().contains("physical or strict"));
        assert_eq!("light".parse::<ProjectorMode>().unwrap().to_string(), "light");
    }

    #[test]
    fn numbers_out_of_range_are_refused_by_name() {
        let bad = |json: &str| serde_json::from_str::<ImportOptions>(json).unwrap().check().unwrap_err().field;
        assert_eq!(bad(r#"{"time": -1}"#), "time");
        assert_eq!(bad(r#"{"environment": "a.hdr", "environment_intensity": -1}"#), "environment_intensity");
        assert_eq!(bad(r#"{"environment_intensity": 2}"#), "environment_intensity");
        assert_eq!(bad(r#"{"environment": "a.hdr", "environment_intensity": 1.1e13}"#), "environment_intensity");
        ImportOptions::default().check().unwrap();
    }
}
