//! Import options on the command line: the same fields as the query of the API's uploads, for `bake`, `submit`, `eval` and `convert`.

use crate::error::CommandError;
use clap::Args;
use kiln_coordinator::import::Bundle;
use kiln_proto::options::{ImportOptions, LightUnits, OutsideMap, ProjectorMode, ShadowMode, UpAxis};
use std::path::{Path, PathBuf};

/// How scene files are read.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Import options")]
pub struct ImportArgs {
    /// The folder whose files a scene may use; the scene must lie in it [default: the scene's own folder]
    #[arg(long, value_name = "FOLDER")]
    root: Option<PathBuf>,
    /// Light from all around: a lat-long map, Radiance HDR or OpenEXR; it need not lie in the scene's folder
    #[arg(long, value_name = "FILE.hdr|.exr")]
    environment: Option<PathBuf>,
    /// Degrees by which the environment is turned about +Y
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, requires = "environment")]
    environment_rotation: Option<f32>,
    /// Factor on the environment [default: 1]
    #[arg(long, value_name = "F", requires = "environment")]
    environment_intensity: Option<f32>,
    /// Seconds at which animations are evaluated; the rest pose unless it is given
    #[arg(long, value_name = "SECONDS")]
    time: Option<f64>,
    /// The axis of the file that points up; the scene is turned so that it is +Y: x, y (the default) or z
    #[arg(long, value_name = "AXIS")]
    up: Option<UpAxis>,
    /// What the numbers of X3D lights mean: x3d (the default) or physical
    #[arg(long, value_name = "UNITS")]
    light_units: Option<LightUnits>,
    /// Whether X3D's receiveShadows decides who receives shadows: physical (no, the default) or strict
    #[arg(long, value_name = "MODE")]
    x3d_shadows: Option<ShadowMode>,
    /// What an X3D texture projected from a light does: surface (it textures its shape, the default) or light
    #[arg(long, value_name = "MODE")]
    x3d_projectors: Option<ProjectorMode>,
    /// What lies outside an X3D shadow map: lit (the default) or shadowed
    #[arg(long, value_name = "WHAT")]
    x3d_outside_map: Option<OutsideMap>,
}

impl ImportArgs {
    /// The folder whose files a scene may use, where that is not its own.
    pub fn root(&self) -> Option<&Path> {
        self.root.as_deref()
    }

    /// The options given that say what a scene is to look like, and so nothing to a file that is written as its author has it.
    pub fn of_the_scene(&self) -> Vec<&'static str> {
        // By name, so that no option can be forgotten. The root names files and the time is asked for by itself; rotation and intensity
        // need an environment.
        let Self {
            root: _,
            time: _,
            environment,
            environment_rotation: _,
            environment_intensity: _,
            up,
            light_units,
            x3d_shadows,
            x3d_projectors,
            x3d_outside_map,
        } = self;
        let given = [
            ("--up", up.is_some()),
            ("--environment", environment.is_some()),
            ("--light-units", light_units.is_some()),
            ("--x3d-shadows", x3d_shadows.is_some()),
            ("--x3d-projectors", x3d_projectors.is_some()),
            ("--x3d-outside-map", x3d_outside_map.is_some()),
        ];
        given.into_iter().filter(|(_, given)| *given).map(|(flag, _)| flag).collect()
    }

    /// Puts the environment into the bundle of a scene and returns the options of its import.
    pub fn pack(&self, bundle: &mut Bundle) -> Result<ImportOptions, CommandError> {
        let main = Some(bundle.main().to_string());
        let add = |file: &PathBuf| bundle.add(file).map_err(|p| CommandError::work(p.to_string()));
        let options = ImportOptions {
            main,
            time: self.time,
            up: self.up.unwrap_or_default(),
            environment: self.environment.as_ref().map(add).transpose()?,
            environment_rotation: self.environment_rotation.unwrap_or_default(),
            environment_intensity: self.environment_intensity,
            light_units: self.light_units.unwrap_or_default(),
            x3d_shadows: self.x3d_shadows.unwrap_or_default(),
            x3d_projectors: self.x3d_projectors.unwrap_or_default(),
            x3d_outside_map: self.x3d_outside_map.unwrap_or_default(),
        };
        options.check().map_err(|bad| CommandError::usage(format!("--{}: {}", bad.field.replace('_', "-"), bad.reason)))?;
        Ok(options)
    }
}
