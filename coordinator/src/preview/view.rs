//! What someone asks to see, as text and as values: one set of checks for the command line and for HTTP.

use super::camera::{
    ANTIALIAS, BadCamera, Camera, DEFAULT_ANTIALIAS, DEFAULT_FOV, PIXELS, PictureSize, check, default_view, is_near, not_finite,
};
use glam::Vec3;
use kiln_proto::scene::Scene;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// The largest exposure correction either way, stops.
const EXPOSURE: f32 = 20.0;

/// What light a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Each point as it looks from the eye.
    #[default]
    LightField,
    /// Each point's radiosity over pi, the same from everywhere: what a lightmap would show.
    Diffuse,
}

/// What someone asks to see.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct View {
    /// The author's camera to look through, by its name; without it, as the next three say.
    pub camera: Option<String>,
    /// Where the eye is, metres; without it, as in the default view.
    pub eye: Option<Vec3>,
    /// What it looks at, metres; without it, as in the default view.
    pub target: Option<Vec3>,
    /// What points up in the picture; without it +Y, or -Z where the view is vertical.
    pub up: Option<Vec3>,
    /// Vertical field of view, degrees.
    pub fov: f32,
    /// The picture's size.
    pub size: PictureSize,
    /// Stops on top of the job's exposure.
    pub exposure: f32,
    /// What light it shows.
    pub mode: Mode,
    /// Rays along each side of a pixel, 1 to [`ANTIALIAS`]; a pixel is their mean.
    pub antialias: u32,
    /// Whether a plain colour lies behind the scene though it has an environment.
    pub hide_environment: bool,
}

impl Default for View {
    fn default() -> Self {
        Self {
            camera: None,
            eye: None,
            target: None,
            up: None,
            fov: DEFAULT_FOV,
            size: PictureSize::default(),
            exposure: 0.0,
            mode: Mode::default(),
            antialias: DEFAULT_ANTIALIAS,
            hide_environment: false,
        }
    }
}

/// Why a view was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct BadView {
    /// The parameter to blame.
    pub field: &'static str,
    /// What is wrong with it and what would not be, as a clause.
    pub message: String,
}

impl From<BadCamera> for BadView {
    fn from(error: BadCamera) -> Self {
        let field = match error {
            BadCamera::Size { width, .. } if PictureSize::new(width, 1).is_err() => "w",
            BadCamera::Size { .. } => "h",
            BadCamera::NotFinite { what, .. } => what,
            BadCamera::NoDirection { .. } => "eye",
            BadCamera::Up { .. } => "up",
            BadCamera::NoSuchCamera { .. } => "camera",
            BadCamera::Fov { .. } | BadCamera::TooFar { .. } => "fov",
        };
        let message = match error {
            // The field says which.
            BadCamera::NotFinite { at, .. } => not_finite(at),
            _ => error.to_string(),
        };
        Self { field, message }
    }
}

impl View {
    /// The view that the parameters of a query ask for. `None` stands for a parameter that was not given.
    ///
    /// # Errors
    /// The first parameter that is not understood or out of its range. What depends on the scene is left to [`View::camera`].
    pub fn from_query(text: impl Fn(&str) -> Option<String>) -> Result<Self, BadView> {
        fn read<T>(field: &'static str, text: Option<String>, read: impl Fn(&str) -> Result<T, String>) -> Result<Option<T>, BadView> {
            text.map(|text| read(&text).map_err(|message| BadView { field, message })).transpose()
        }
        let default = View::default();
        let (width, height) = (read("w", text("w"), side)?, read("h", text("h"), side)?);
        let camera = text("camera");
        if let (Some(_), Some(other)) = (&camera, ["eye", "target", "up", "fov"].into_iter().find(|name| text(name).is_some())) {
            let message = format!("a camera of the scene says where the eye is; leave out `{other}`, or the camera");
            return Err(BadView { field: "camera", message });
        }
        let view = Self {
            camera,
            eye: read("eye", text("eye"), point)?,
            target: read("target", text("target"), point)?,
            up: read("up", text("up"), point)?,
            fov: read("fov", text("fov"), number)?.unwrap_or(default.fov),
            size: PictureSize::new(width.unwrap_or(default.size.width), height.unwrap_or(default.size.height))?,
            exposure: read("exposure", text("exposure"), exposure)?.unwrap_or(default.exposure),
            mode: read("mode", text("mode"), str::parse)?.unwrap_or(default.mode),
            antialias: 1,
            hide_environment: read("hide_environment", text("hide_environment"), truth)?.unwrap_or(default.hide_environment),
        };
        check(view.eye, view.target, view.fov)?;
        let antialias = match read("antialias", text("antialias"), antialias)? {
            Some(rays) => rays,
            // What nobody asked for makes no large picture four times as dear.
            None if view.size.pixels() > default.size.pixels() => 1,
            None => default.antialias,
        };
        let rays = view.size.pixels() as u64 * u64::from(antialias * antialias);
        if rays > PIXELS {
            let message = format!("{} pixels of {antialias} x {antialias} rays are {rays} rays; at most {PIXELS} are possible", view.size);
            return Err(BadView { field: "antialias", message });
        }
        Ok(Self { antialias, ..view })
    }

    /// The camera of this view in a scene: what is not said is as in the default view.
    ///
    /// # Errors
    /// Values out of their ranges, an eye that is where the target is, a default eye that would be too far away, a camera that is not there.
    pub fn camera(&self, scene: &Scene) -> Result<Camera, BadCamera> {
        if let Some(name) = &self.camera {
            let found = scene.cameras.iter().find(|c| c.name == *name);
            let missing = || BadCamera::NoSuchCamera { name: short(name), known: known(scene) };
            return Camera::of_author(found.ok_or_else(missing)?, self.size);
        }
        let (eye, target) = default_view(scene, self.fov, self.size)?;
        if self.eye.is_none() && !is_near(eye) {
            return Err(BadCamera::TooFar { fov: self.fov, size: self.size });
        }
        let camera = Camera::new(self.eye.unwrap_or(eye), self.target.unwrap_or(target), self.fov, self.size)?;
        self.up.map_or(Ok(camera), |up| camera.upright(up))
    }
}

/// The names of a scene's cameras, as a list.
fn known(scene: &Scene) -> String {
    const SHOWN: usize = 20;
    let mut names: Vec<&str> = scene.cameras.iter().take(SHOWN).map(|c| c.name.as_str()).collect();
    if scene.cameras.len() > SHOWN {
        names.push("…");
    }
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A point `x,y,z` in metres.
///
/// # Errors
/// A sentence that says what is expected.
pub fn point(text: &str) -> Result<Vec3, String> {
    let parts: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f32| v.is_finite())).collect();
    match parts.as_deref() {
        Some(&[x, y, z]) => Ok(Vec3::new(x, y, z)),
        _ => Err(format!("`{}`: expected three finite coordinates in metres, x,y,z, such as -1,1.6,3.5", short(text))),
    }
}

/// A number.
///
/// # Errors
/// A sentence that says what is expected.
pub fn number(text: &str) -> Result<f32, String> {
    let finite = text.parse().ok().filter(|v: &f32| v.is_finite());
    finite.ok_or_else(|| format!("`{}`: expected a finite number", short(text)))
}

/// An exposure correction in stops.
///
/// # Errors
/// A sentence that says what is expected.
pub fn exposure(text: &str) -> Result<f32, String> {
    let stops = number(text)?;
    if stops.abs() <= EXPOSURE { Ok(stops) } else { Err(format!("`{}`: expected -{EXPOSURE} to {EXPOSURE} stops", short(text))) }
}

/// A number of rays along each side of a pixel.
///
/// # Errors
/// A sentence that says what is expected.
pub fn antialias(text: &str) -> Result<u32, String> {
    let rays = text.parse().ok().filter(|rays| (1..=ANTIALIAS).contains(rays));
    rays.ok_or_else(|| format!("`{}`: expected 1 to {ANTIALIAS} rays along each side of a pixel", short(text)))
}

fn truth(text: &str) -> Result<bool, String> {
    text.parse().map_err(|_| format!("`{}`: expected true or false", short(text)))
}

fn side(text: &str) -> Result<u32, String> {
    text.parse().map_err(|_| format!("`{}`: expected a whole number of pixels", short(text)))
}

impl FromStr for Mode {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "light-field" => Ok(Mode::LightField),
            "diffuse" => Ok(Mode::Diffuse),
            _ => Err(format!("`{}`: expected light-field or diffuse", short(text))),
        }
    }
}

/// As much of a text as a message repeats.
fn short(text: &str) -> String {
    text.chars().take(60).collect()
}
