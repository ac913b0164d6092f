//! `kiln render`: a view of a package as a PNG, without a GPU.

use crate::{
    bake_settings::word,
    package::{Package, ToolError, io_fault},
};
use glam::Vec3;
use kiln_coordinator::preview::{
    Camera, Light, Mode, Origin, Picture, PictureSize, Stop, View,
    camera::{DEFAULT_ANTIALIAS, DEFAULT_FOV},
    draw, view,
};
use kiln_proto::format::stream::Trust;
use std::{
    fs::Permissions,
    io::Write,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    time::Instant,
};

/// A view of a package as a PNG. What is not said of the camera is as in the default view, which shows the whole scene.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The package's folder.
    pub(crate) package: PathBuf,
    /// The PNG file to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// A camera of the scene, by its name, in the place of --eye, --target and --fov; `kiln inspect` lists them.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["eye", "target", "up", "fov"])]
    pub(crate) camera: Option<String>,
    /// Where the eye is, x,y,z in metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = view::point, allow_hyphen_values = true)]
    pub(crate) eye: Option<Vec3>,
    /// What it looks at, x,y,z in metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = view::point, allow_hyphen_values = true)]
    pub(crate) target: Option<Vec3>,
    /// What points up in the picture, x,y,z; +Y unless it is given.
    #[arg(long, value_name = "X,Y,Z", value_parser = view::point, allow_hyphen_values = true)]
    pub(crate) up: Option<Vec3>,
    /// Vertical field of view, degrees.
    #[arg(long, value_name = "DEGREES", value_parser = view::number, default_value_t = DEFAULT_FOV, allow_hyphen_values = true)]
    pub(crate) fov: f32,
    /// Size of the picture in pixels.
    #[arg(long, value_name = "WxH", default_value_t = PictureSize::default())]
    pub(crate) size: PictureSize,
    /// Stops on top of the exposure of the bake.
    #[arg(long, value_name = "EV", value_parser = view::exposure, default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) exposure: f32,
    /// What light it shows: light-field, or diffuse for what a lightmap would show.
    #[arg(long, default_value = "light-field")]
    pub(crate) mode: Mode,
    /// Rays along each side of a pixel, 1 to 4; a pixel shows their mean.
    #[arg(long, value_name = "N", value_parser = view::antialias, default_value_t = DEFAULT_ANTIALIAS)]
    pub(crate) antialias: u32,
    /// A plain colour behind the scene, though it has an environment.
    #[arg(long)]
    pub(crate) hide_environment: bool,
    /// Where radiance comes from: codec for the encoded files, raw for the kept samples.
    #[arg(long, value_parser = word::<Origin>, default_value = "codec")]
    pub(crate) from: Origin,
}

/// Renders the view, writes the file and tells on `out` what it shows.
///
/// # Errors
/// A package that cannot be read, raw radiance that it did not keep, a camera that cannot see, a file that cannot be written.
pub(crate) fn run(args: &Args, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    // Asked first: a picture that takes seconds and has nowhere to go helps nobody.
    let folder = folder_of(&args.output)?;
    let package = Package::open(&args.package)?;
    if args.from == Origin::Raw && package.plan.settings.raw.is_none() {
        return Err(ToolError::NoRaw { path: package.dir });
    }
    let &Args { eye, target, up, fov, size, exposure, mode, antialias, hide_environment, from, .. } = args;
    let asked = View { camera: args.camera.clone(), eye, target, up, fov, size, exposure, mode, antialias, hide_environment };
    let camera = asked.camera(&package.scene).map_err(|e| ToolError::Usage(e.to_string()))?;
    let begun = Instant::now();
    let mut light = Light::new(&package, &package.scene, &package.plan, from, Trust::Checksum);
    let picture = draw(&package.scene, &package.plan, &mut light, &camera, &asked, &Stop::default())?;
    let milliseconds = begun.elapsed().as_secs_f64() * 1e3;
    write(&args.output, folder, &picture)?;
    tell(args, &camera, &picture, milliseconds, json, out)
}

/// The folder that the file is to be in.
fn folder_of(output: &Path) -> Result<&Path, ToolError> {
    let folder = output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if output.file_name().is_none() || output.is_dir() {
        return Err(ToolError::Usage(format!("{} is a folder; name a file for the picture", output.display())));
    }
    if folder.is_dir() {
        Ok(folder)
    } else {
        Err(ToolError::Usage(format!("the folder {} does not exist; create it first", folder.display())))
    }
}

/// Writes beside the file and renames: whoever watches it never sees half a picture.
fn write(output: &Path, folder: &Path, picture: &Picture) -> Result<(), ToolError> {
    let png = picture.to_png().map_err(std::io::Error::other).map_err(io_fault(output))?;
    let mut builder = tempfile::Builder::new();
    // As any new file: the umask is taken off, where the usual temporary file would be for its owner alone.
    builder.prefix(".kiln-render-").permissions(Permissions::from_mode(0o666));
    let mut staged = builder.tempfile_in(folder).map_err(io_fault(folder))?;
    staged.write_all(&png).map_err(io_fault(output))?;
    kiln_coordinator::blob::publish(staged.into_temp_path(), output).map_err(io_fault(output))
}

fn tell(args: &Args, camera: &Camera, picture: &Picture, milliseconds: f64, json: bool, out: &mut dyn Write) -> Result<(), ToolError> {
    let (eye, target) = (camera.eye(), camera.target());
    let (size, dark) = (picture.size(), picture.without_light());
    if json {
        let report = serde_json::json!({
            "file": args.output,
            "camera": { "name": args.camera, "eye": eye.to_array(), "target": target.to_array(), "fov": camera.fov() },
            "width": size.width,
            "height": size.height,
            "milliseconds": milliseconds,
            "pixels_without_light": dark,
        });
        writeln!(out, "{report}")?;
        return Ok(());
    }
    let point = |p: Vec3| format!("{},{},{}", p.x, p.y, p.z);
    let from = match &args.camera {
        Some(name) => format!("--camera {name}"),
        None => format!("--eye {} --target {}", point(eye), point(target)),
    };
    writeln!(out, "{}: {size}, {from}, {milliseconds:.0} ms", args.output.display())?;
    if dark > 0 {
        writeln!(out, "{dark} pixels see a surface where the light field has nothing; they are black")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
