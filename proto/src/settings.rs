//! Bake settings: what the API, the command line and settings files say ([`SettingsPatch`]), and what it comes to ([`BakeSettings`]).
//!
//! A preset gives every value a default that suits its purpose; a patch overrides single fields. Unknown fields are refused by name, so
//! that a typing error never silently bakes with a default.

mod codec;
mod exposure;
mod size;

pub use codec::{Codec, RawFormat, Rule, RuleName};
pub use exposure::ExposureMode;
pub use size::{BadTextureSize, TextureSize};

use crate::{
    frame::FrameRule,
    grid::{SphericalGrid, Walk},
    limits,
};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, fmt, ops::RangeInclusive};

/// Names that a user understands over bags of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Preset {
    /// Seconds: 64 samples, depth 3, half the texel density.
    Draft,
    /// Minutes: 256 samples, depth 5.
    #[default]
    Preview,
    /// As long as it takes: 1,024 samples, depth 8.
    Production,
}

/// Where on a texel light is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Footprint {
    /// Over the part of the texel that the chart covers: antialiased.
    #[default]
    Area,
    /// At the texel's centre alone: for comparison with other renderers.
    Point,
}

/// Which order `pwl` walks the directions in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WalkMode {
    /// The smoother of the two for each surface, from the Probe phase.
    #[default]
    Auto,
    /// Inclination fastest.
    Theta,
    /// Azimuth fastest.
    Phi,
}

impl WalkMode {
    /// The walk this mode fixes, if it fixes one.
    #[must_use]
    pub fn fixed(self) -> Option<Walk> {
        match self {
            WalkMode::Auto => None,
            WalkMode::Theta => Some(Walk::Theta),
            WalkMode::Phi => Some(Walk::Phi),
        }
    }
}

/// What a request may say: every field optional, unknown fields refused.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(missing_docs)] // The fields are those of `BakeSettings`, documented there.
pub struct SettingsPatch {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub samples: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_depth: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<SphericalGrid>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub footprint: Option<Footprint>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texel_scale: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub texels_per_metre: Option<f32>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub texture_sizes: BTreeMap<String, TextureSize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub codec: Option<Codec>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rule: Option<RuleName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eps: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exposure: Option<ExposureMode>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub walk: Option<WalkMode>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub raw: Option<RawFormat>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<FrameRule>,
}

/// Settings with every value decided and checked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BakeSettings {
    /// Where the defaults came from.
    pub preset: Preset,
    /// Shared incident samples per texel; a quarter as many light samples are added.
    pub samples: u32,
    /// Longest path, counted as in Mitsuba: 1 emission, 2 direct light, k adds k - 2 bounces.
    pub max_depth: u32,
    /// The direction grid.
    pub directions: SphericalGrid,
    /// Where on a texel light is gathered.
    pub footprint: Footprint,
    /// Factor on both sides of every texture, explicit sizes included.
    pub texel_scale: f32,
    /// Texel density of surfaces without an explicit size, 1/m.
    pub texels_per_metre: f32,
    /// Explicit sizes by surface name.
    pub texture_sizes: BTreeMap<String, TextureSize>,
    /// The codec of the package.
    pub codec: Codec,
    /// How `pwl` picks samples.
    pub rule: Rule,
    /// How exposure is found.
    pub exposure: ExposureMode,
    /// Which order `pwl` walks directions in.
    pub walk: WalkMode,
    /// Seed of every sample sequence.
    pub seed: u64,
    /// Uncompressed radiance to keep.
    pub raw: Option<RawFormat>,
    /// How frames are oriented.
    pub frame: FrameRule,
}

/// A setting out of its range, or two that contradict each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {reason}")]
pub struct BadSetting {
    /// The field of [`SettingsPatch`].
    pub field: &'static str,
    /// What is wrong and what is allowed.
    pub reason: String,
}

impl SettingsPatch {
    /// Fields of `over` replace those of `self`; texture sizes are merged by name.
    #[must_use]
    pub fn overridden_by(mut self, over: SettingsPatch) -> Self {
        macro_rules! take { ($($field:ident),*) => { $( if over.$field.is_some() { self.$field = over.$field; } )* } }
        take!(
            preset,
            samples,
            max_depth,
            directions,
            footprint,
            texel_scale,
            texels_per_metre,
            codec,
            rule,
            eps,
            threshold,
            exposure,
            walk,
            seed,
            raw,
            frame
        );
        self.texture_sizes.extend(over.texture_sizes);
        self
    }

    /// The settings this patch comes to.
    ///
    /// # Errors
    /// The first field out of its range; `threshold` with the bounded rule or `eps` with another.
    pub fn resolve(&self) -> Result<BakeSettings, BadSetting> {
        let preset = self.preset.unwrap_or_default();
        let (samples, max_depth, texel_scale) = match preset {
            Preset::Draft => (64, 3, 0.5),
            Preset::Preview => (256, 5, 1.0),
            Preset::Production => (1_024, 8, 1.0),
        };
        Ok(BakeSettings {
            preset,
            samples: ranged("samples", self.samples.unwrap_or(samples), &(1..=limits::SAMPLES))?,
            max_depth: ranged("max_depth", self.max_depth.unwrap_or(max_depth), &(1..=limits::MAX_DEPTH))?,
            directions: self.directions.unwrap_or_default(),
            footprint: self.footprint.unwrap_or_default(),
            texel_scale: ranged("texel_scale", self.texel_scale.unwrap_or(texel_scale), &(1e-3..=64.0))?,
            texels_per_metre: ranged("texels_per_metre", self.texels_per_metre.unwrap_or(20.0), &(1e-6..=1e6))?,
            texture_sizes: self.texture_sizes.clone(),
            codec: self.codec.unwrap_or_default(),
            rule: self.rule()?,
            exposure: self.exposure.unwrap_or_default(),
            walk: self.walk.unwrap_or_default(),
            seed: self.seed.unwrap_or(0),
            raw: self.raw,
            frame: self.frame.unwrap_or_default(),
        })
    }

    /// The rule and its parameter. Thesis and cumulative default to T = 6, bounded to eps = 2.
    ///
    /// # Errors
    /// A parameter that belongs to another rule, or is out of range.
    pub fn rule(&self) -> Result<Rule, BadSetting> {
        let name = self.rule.unwrap_or_default();
        let misplaced = |field, fits: &str| BadSetting {
            field,
            reason: format!("belongs to the rule {fits}, but the rule is {name:?}").to_lowercase(),
        };
        if name == RuleName::Bounded {
            if self.threshold.is_some() {
                return Err(misplaced("threshold", "thesis or cumulative"));
            }
            return Ok(Rule::Bounded { eps: self.eps.unwrap_or(2) });
        }
        if self.eps.is_some() {
            return Err(misplaced("eps", "bounded"));
        }
        let threshold = ranged("threshold", self.threshold.unwrap_or(6), &(0..=765))?;
        Ok(if name == RuleName::Thesis { Rule::Thesis { threshold } } else { Rule::Cumulative { threshold } })
    }
}

fn ranged<T: PartialOrd + fmt::Display>(field: &'static str, value: T, range: &RangeInclusive<T>) -> Result<T, BadSetting> {
    if range.contains(&value) {
        return Ok(value); // NaN is in no range.
    }
    Err(BadSetting { field, reason: format!("{value} is not between {} and {}", range.start(), range.end()) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Exposure;

    fn parse(json: &str) -> Result<BakeSettings, String> {
        let patch: SettingsPatch = serde_json::from_str(json).map_err(|e| e.to_string())?;
        patch.resolve().map_err(|e| e.to_string())
    }

    #[test]
    fn nothing_said_means_the_preview_preset() {
        let s = parse("{}").unwrap();
        assert_eq!((s.samples, s.max_depth, s.directions.len(), s.rule), (256, 5, 400, Rule::Bounded { eps: 2 }));
        assert_eq!(parse(r#"{"preset":"production","samples":2000}"#).unwrap().samples, 2000);
    }

    #[test]
    fn settings_survive_their_json() {
        let json = r#"{"texture_sizes":{"floor":"200x100"},"exposure":-1.5,"rule":"cumulative","threshold":9,"raw":"f32","walk":"theta"}"#;
        let s = parse(json).unwrap();
        assert_eq!(s.exposure, ExposureMode::Fixed(Exposure { eighths: -12 }));
        assert_eq!(serde_json::from_str::<BakeSettings>(&serde_json::to_string(&s).unwrap()).unwrap(), s);
    }

    #[test]
    fn wrong_settings_are_refused_by_name() {
        for (json, word) in [
            (r#"{"sampels":3}"#, "sampels"),
            (r#"{"samples":0}"#, "samples"),
            (r#"{"texel_scale":-1}"#, "texel_scale"),
            (r#"{"texture_sizes":{"floor":"0x0"}}"#, "0x0"),
            (r#"{"eps":2,"rule":"thesis"}"#, "eps"),
            (r#"{"threshold":2}"#, "threshold"),
            (r#"{"exposure":"bright"}"#, "auto"),
            (r#"{"directions":"20x21"}"#, "even"),
        ] {
            let error = parse(json).unwrap_err();
            assert!(error.contains(word), "{json}: {error}");
        }
        assert!(SettingsPatch { texel_scale: Some(f32::NAN), ..Default::default() }.resolve().is_err());
    }

    #[test]
    fn a_patch_overrides_field_by_field() {
        let file: SettingsPatch = serde_json::from_str(r#"{"samples":10,"texture_sizes":{"a":"1x1","b":"2x2"}}"#).unwrap();
        let flags: SettingsPatch = serde_json::from_str(r#"{"seed":7,"texture_sizes":{"b":"3x3"}}"#).unwrap();
        let s = file.overridden_by(flags).resolve().unwrap();
        assert_eq!((s.samples, s.seed, s.texture_sizes["a"].width, s.texture_sizes["b"].width), (10, 7, 1, 3));
    }
}
