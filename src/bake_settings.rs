//! Bake settings on the command line: the same fields as the API's, for `bake`, `submit` and `eval`.

use crate::error::CommandError;
use clap::Args;
use kiln_proto::{
    frame::FrameRule,
    grid::SphericalGrid,
    settings::{Codec, ExposureMode, Footprint, Preset, RawFormat, RuleName, SettingsPatch, TextureSize, WalkMode},
};
use serde::de::DeserializeOwned;
use std::path::PathBuf;

/// What a bake should be like. Flags override `--settings`, which overrides the preset.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Bake settings")]
pub struct SettingsArgs {
    /// A JSON file with the fields of the API's `settings`
    #[arg(long, value_name = "FILE.json")]
    settings: Option<PathBuf>,
    /// draft (seconds), preview (minutes, the default) or production
    #[arg(long, value_parser = word::<Preset>)]
    preset: Option<Preset>,
    /// Shared incident samples per texel
    #[arg(long, value_name = "N")]
    samples: Option<u32>,
    /// Longest light path: 1 emission, 2 direct light, each more one bounce
    #[arg(long, value_name = "N")]
    max_depth: Option<u32>,
    /// Direction grid, inclinations x azimuths [default: 20x20]
    #[arg(long, value_name = "TxP")]
    directions: Option<SphericalGrid>,
    /// Gather over the texel's area (the default) or at its centre point
    #[arg(long, value_parser = word::<Footprint>)]
    footprint: Option<Footprint>,
    /// Factor on every texture's sides
    #[arg(long, value_name = "F")]
    texel_scale: Option<f32>,
    /// Texel density of surfaces without an explicit size [default: 20]
    #[arg(long, value_name = "F")]
    texels_per_metre: Option<f32>,
    /// Texture size of one surface; may be repeated
    #[arg(long, value_name = "NAME=WxH", value_parser = named_size)]
    texture_size: Vec<(String, TextureSize)>,
    /// The package's codec [default: pwl]
    #[arg(long, value_parser = word::<Codec>)]
    codec: Option<Codec>,
    #[command(flatten)]
    rule: RuleArgs,
    /// `auto`, or stops (EV)
    #[arg(long, value_name = "auto|EV", allow_hyphen_values = true)]
    exposure: Option<ExposureMode>,
    /// Seed of every sample sequence [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Keep uncompressed radiance too: u8 or f32
    #[arg(long, value_parser = word::<RawFormat>)]
    raw: Option<RawFormat>,
    /// Orient frames by the texture (the default) or as the thesis does
    #[arg(long, value_parser = word::<FrameRule>)]
    frame: Option<FrameRule>,
}

/// How `pwl` picks the samples that it keeps.
#[derive(Debug, Clone, Args)]
pub struct RuleArgs {
    /// bounded (the default), cumulative or thesis
    #[arg(long, value_parser = word::<RuleName>)]
    pub rule: Option<RuleName>,
    /// Largest error of the bounded rule, in 8-bit levels [default: 2]
    #[arg(long, value_name = "N")]
    pub eps: Option<u8>,
    /// Threshold T of the cumulative and thesis rules [default: 6]
    #[arg(long, value_name = "T")]
    pub threshold: Option<u16>,
    /// Order along the directions: auto (the default), theta or phi
    #[arg(long, value_parser = word::<WalkMode>)]
    pub walk: Option<WalkMode>,
}

impl SettingsArgs {
    /// The patch that file and flags come to, checked.
    ///
    /// # Errors
    /// An unreadable file, unknown fields, values out of range: all usage errors that name the field.
    pub fn patch(&self) -> Result<SettingsPatch, CommandError> {
        let file = match &self.settings {
            None => SettingsPatch::default(),
            Some(path) => {
                let name = path.display();
                let text = std::fs::read_to_string(path).map_err(|e| CommandError::usage(format!("settings file {name}: {e}")))?;
                serde_json::from_str(&text).map_err(|e| CommandError::usage(format!("settings file {name}: {e}")))?
            }
        };
        let flags = SettingsPatch {
            preset: self.preset,
            samples: self.samples,
            max_depth: self.max_depth,
            directions: self.directions,
            footprint: self.footprint,
            texel_scale: self.texel_scale,
            texels_per_metre: self.texels_per_metre,
            texture_sizes: self.texture_size.iter().cloned().collect(),
            codec: self.codec,
            rule: self.rule.rule,
            eps: self.rule.eps,
            threshold: self.rule.threshold,
            exposure: self.exposure,
            walk: self.rule.walk,
            seed: self.seed,
            raw: self.raw,
            frame: self.frame,
        };
        let patch = file.overridden_by(flags);
        patch.resolve().map_err(|e| CommandError::usage(format!("settings: {e}")))?;
        Ok(patch)
    }
}

/// Parses a word by the names that JSON uses, so that flag and API never differ.
pub(crate) fn word<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    serde_json::from_value(serde_json::Value::String(text.to_owned())).map_err(|e| e.to_string())
}

fn named_size(text: &str) -> Result<(String, TextureSize), String> {
    // The last `=`, because a surface's name may hold one.
    let (name, size) = text.rsplit_once('=').ok_or_else(|| format!("`{text}`: expected NAME=WIDTHxHEIGHT such as floor=200x200"))?;
    Ok((name.to_owned(), size.parse::<TextureSize>().map_err(|e| e.to_string())?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        settings: SettingsArgs,
    }

    fn patch(args: &[&str]) -> Result<SettingsPatch, String> {
        let cli = Cli::try_parse_from(std::iter::once("kiln").chain(args.iter().copied())).map_err(|e| e.to_string())?;
        cli.settings.patch().map_err(|e| e.to_string())
    }

    #[test]
    fn every_flag_reaches_its_field() {
        let all = "--preset draft --samples 9 --max-depth 4 --directions 8x10 --footprint point --texel-scale 0.5 --texels-per-metre 7 \
                   --texture-size a=b=3x4 --codec pwl --rule thesis --threshold 9 --walk theta --exposure -1.5 --seed 5 --raw f32 --frame thesis";
        let patch = patch(&all.split_whitespace().collect::<Vec<_>>()).unwrap();
        let json = serde_json::to_value(&patch).unwrap();
        let expected = serde_json::json!({
            "preset": "draft", "samples": 9, "max_depth": 4, "directions": "8x10", "footprint": "point", "texel_scale": 0.5,
            "texels_per_metre": 7.0, "texture_sizes": {"a=b": "3x4"}, "codec": "pwl", "rule": "thesis", "threshold": 9,
            "walk": "theta", "exposure": -1.5, "seed": 5, "raw": "f32", "frame": "thesis"
        });
        assert_eq!(json, expected);
    }

    #[test]
    fn a_settings_file_is_overridden_by_flags_and_its_errors_name_it() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("s.json");
        std::fs::write(&file, r#"{"samples": 3, "seed": 1}"#).unwrap();
        let name = file.to_str().unwrap();
        let both = patch(&["--settings", name, "--samples", "8"]).unwrap();
        assert_eq!((both.samples, both.seed), (Some(8), Some(1)));
        std::fs::write(&file, r#"{"sample": 3}"#).unwrap();
        let error = patch(&["--settings", name]).unwrap_err();
        assert!(error.contains("s.json") && error.contains("sample"), "{error}");
    }

    #[test]
    fn values_out_of_range_are_refused() {
        for (args, word) in [
            (&["--texture-size", "floor=0x0"][..], "0x0"),
            (&["--samples", "0"], "samples"),
            (&["--directions", "20x7"], "even"),
            (&["--eps", "3", "--rule", "thesis"], "eps"),
            (&["--exposure", "bright"], "auto"),
            (&["--preset", "fast"], "draft"),
        ] {
            let error = patch(args).unwrap_err();
            assert!(error.contains(word), "{args:?}: {error}");
        }
    }
}
