//! The exposure of the 8-bit coding: found by the bake or given, written as `"auto"` or a number of stops.

use crate::units::Exposure;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// How the exposure of the 8-bit coding is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "ExposureText", into = "ExposureText")]
pub enum ExposureMode {
    /// The 98th percentile of the probed radiance becomes 1.0, rounded to 1/8 stop.
    #[default]
    Auto,
    /// Given in stops, rounded to 1/8.
    Fixed(Exposure),
}

/// `"auto"` or a number of stops: how JSON writes an [`ExposureMode`].
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
enum ExposureText {
    Stops(f32),
    Word(String),
}

impl TryFrom<ExposureText> for ExposureMode {
    type Error = String;
    fn try_from(text: ExposureText) -> Result<Self, String> {
        match text {
            ExposureText::Stops(ev) => Exposure::from_stops(ev).map(Self::Fixed).ok_or_else(|| bad_exposure(&ev.to_string())),
            ExposureText::Word(word) => word.parse(),
        }
    }
}

impl From<ExposureMode> for ExposureText {
    fn from(mode: ExposureMode) -> Self {
        match mode {
            ExposureMode::Auto => ExposureText::Word("auto".into()),
            ExposureMode::Fixed(e) => ExposureText::Stops(e.stops()),
        }
    }
}

impl FromStr for ExposureMode {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let stops = text.parse::<f32>().ok().and_then(Exposure::from_stops);
        stops.map(Self::Fixed).ok_or_else(|| bad_exposure(text))
    }
}

fn bad_exposure(text: &str) -> String {
    format!("exposure `{text}`: expected `auto` or stops (EV) from -64 to 64")
}
