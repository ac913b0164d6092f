//! The camera: from eye, target and field of view to one ray per pixel, and the view that is taken where nobody says one.

use glam::{DVec3, Vec3};
use kiln_proto::{
    math,
    scene::{self, Lens, Scene},
};
use serde::Serialize;
use std::{fmt, str::FromStr};

/// Pixels along one side of a picture, at most.
pub const SIDE: u32 = 4_096;
/// Pixels of a picture, at most.
pub const PIXELS: u64 = 8_388_608;
/// Rays along each side of a pixel, at most.
pub const ANTIALIAS: u32 = 4;
/// Rays along each side of a pixel where nobody says how many.
pub const DEFAULT_ANTIALIAS: u32 = 2;
/// The vertical field of view where none is said, degrees.
pub const DEFAULT_FOV: f32 = 45.0;
/// The smallest and the largest vertical field of view, degrees.
const FOV: std::ops::RangeInclusive<f32> = 1.0..=170.0;
/// The largest coordinate, metres: its cube is still a number in every product.
const FARTHEST: f32 = 1e15;
/// A view this close to vertical (the sine of the angle) has -Z up instead of +Y.
const VERTICAL: f64 = 1e-3;
/// Azimuths and elevations that the default view is chosen among, degrees; all azimuths at the first elevation come first.
const AZIMUTHS: [f64; 8] = [0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0];
const ELEVATIONS: [f64; 2] = [20.0, 40.0];

/// The size of a picture, pixels, within the limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
pub struct PictureSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl PictureSize {
    /// A size within the limits.
    ///
    /// # Errors
    /// Sides of zero or above [`SIDE`], more than [`PIXELS`] pixels.
    pub fn new(width: u32, height: u32) -> Result<Self, BadCamera> {
        let side = 1..=SIDE;
        if side.contains(&width) && side.contains(&height) && u64::from(width) * u64::from(height) <= PIXELS {
            Ok(Self { width, height })
        } else {
            Err(BadCamera::Size { width, height })
        }
    }

    /// Pixels.
    #[must_use]
    pub fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl Default for PictureSize {
    fn default() -> Self {
        Self { width: 640, height: 480 }
    }
}

impl fmt::Display for PictureSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for PictureSize {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        let (width, height) = sides.ok_or("expected WIDTHxHEIGHT in pixels, such as 640x480")?;
        Self::new(width, height).map_err(|e| e.to_string())
    }
}

/// Why a camera was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BadCamera {
    /// Too large, or no picture at all.
    #[error("a picture of {width} x {height} pixels: each side must be from 1 to {SIDE}, and the whole at most {PIXELS} pixels")]
    Size {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
    /// A coordinate that is no number, or so large that nothing can be computed with it.
    #[error("{what} {}", not_finite(*.at))]
    NotFinite {
        /// `eye` or `target`.
        what: &'static str,
        /// Where.
        at: Vec3,
    },
    /// Nothing to look along.
    #[error("the eye and the target are both at {at}; the camera needs a direction to look in")]
    NoDirection {
        /// Where.
        at: Vec3,
    },
    /// A default view from farther away than anything can be computed from.
    #[error(
        "in a picture of {size} pixels with a field of view of {fov} degrees, the whole scene is seen only from farther than {FARTHEST:e} m; \
             widen the field of view, make the picture less narrow, or say where the eye is"
    )]
    TooFar {
        /// Degrees.
        fov: f32,
        /// The picture's size.
        size: PictureSize,
    },
    /// A camera that the author did not make.
    #[error("the scene has no camera `{name}`; it has {known}")]
    NoSuchCamera {
        /// As asked.
        name: String,
        /// What there are.
        known: String,
    },
    /// An upward direction that says nothing.
    #[error("up {up}: it must be a direction, and not along the line of sight")]
    Up {
        /// As asked, unit.
        up: Vec3,
    },
    /// An angle out of range.
    #[error("a vertical field of view of {fov} degrees; from {} to {} are possible", FOV.start(), FOV.end())]
    Fov {
        /// Degrees.
        fov: f32,
    },
}

/// A camera that can see: checked when it is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    target: Vec3,
    fov: f32,
    size: PictureSize,
    /// Right, up and forward; right and up are as long as half the picture at distance 1, or as half the picture where rays are parallel.
    axes: [DVec3; 3],
    parallel: bool,
}

impl Camera {
    /// A camera at `eye` that looks at `target`, metres, with a vertical field of view in degrees.
    ///
    /// # Errors
    /// Coordinates that are not finite, an eye at the target, a field of view out of range.
    pub fn new(eye: Vec3, target: Vec3, fov: f32, size: PictureSize) -> Result<Self, BadCamera> {
        check(Some(eye), Some(target), fov)?;
        let along = target.as_dvec3() - eye.as_dvec3();
        let forward = along / along.length();
        let up = if forward.cross(DVec3::Y).length() < VERTICAL { DVec3::NEG_Z } else { DVec3::Y };
        Ok(Self { eye, target, fov, size, axes: axes(forward, up, half_sides(fov, size)), parallel: false })
    }

    /// The same camera turned about its axis until `up` points up in the picture, as it does in scenes whose +Z is up.
    ///
    /// # Errors
    /// A direction that is no direction, or along the line of sight.
    pub fn upright(self, up: Vec3) -> Result<Self, BadCamera> {
        let forward = self.axes[2];
        let up = up.as_dvec3().normalize_or_zero();
        if forward.cross(up).length() < VERTICAL {
            return Err(BadCamera::Up { up: up.as_vec3() });
        }
        Ok(Self { axes: axes(forward, up, half_sides(self.fov, self.size)), ..self })
    }

    /// A camera of the author's, for a picture of this size. Where its field of view is out of range it is the nearest that is not.
    ///
    /// # Errors
    /// Directions or a place that nothing can be computed with.
    pub fn of_author(camera: &scene::Camera, size: PictureSize) -> Result<Self, BadCamera> {
        let vector = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
        let (forward, up) = (vector(camera.forward).normalize_or_zero(), vector(camera.up));
        let eye = Vec3::from_array(camera.eye);
        let target = (eye.as_dvec3() + forward).as_vec3();
        check(Some(eye), Some(target), DEFAULT_FOV)?;
        let up =
            if forward.cross(up).length() < VERTICAL * up.length().max(f64::MIN_POSITIVE) { forward.any_orthonormal_vector() } else { up };
        let aspect = f64::from(size.width) / f64::from(size.height);
        let (fov, sides, parallel) = match camera.lens {
            Lens::Perspective { fov, of_smaller } => {
                let fov = fov.to_degrees().clamp(*FOV.start(), *FOV.end());
                let [width, height] = half_sides(fov, size);
                // Of an upright picture the smaller side is the width.
                if of_smaller && aspect < 1.0 { (fov, [height, height / aspect], false) } else { (fov, [width, height], false) }
            }
            Lens::Orthographic { half_height } => {
                let half_height = f64::from(half_height.abs().clamp(f32::MIN_POSITIVE, FARTHEST));
                (DEFAULT_FOV, [half_height * aspect, half_height], true)
            }
        };
        Ok(Self { eye, target, fov, size, axes: axes(forward, up, sides), parallel })
    }

    /// Where the eye is, metres.
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        self.eye
    }

    /// What it looks at, metres.
    #[must_use]
    pub fn target(&self) -> Vec3 {
        self.target
    }

    /// The vertical field of view, degrees.
    #[must_use]
    pub fn fov(&self) -> f32 {
        self.fov
    }

    /// The size of the picture.
    #[must_use]
    pub fn size(&self) -> PictureSize {
        self.size
    }

    /// The same view through `rays` x `rays` pixels in the place of each: its size is that of no picture, and beyond the limits.
    pub(super) fn finer(&self, rays: u32) -> Self {
        Self { size: PictureSize { width: self.size.width * rays, height: self.size.height * rays }, ..*self }
    }

    /// The unit direction of the ray through the middle of a pixel; (0, 0) is the upper left one.
    #[must_use]
    pub fn direction(&self, x: u32, y: u32) -> Vec3 {
        let [.., forward] = self.axes;
        let aside = if self.parallel { DVec3::ZERO } else { self.aside(x, y) };
        (aside + forward).normalize().as_vec3()
    }

    /// Where that ray begins, metres.
    pub(super) fn origin(&self, x: u32, y: u32) -> DVec3 {
        self.eye.as_dvec3() + if self.parallel { self.aside(x, y) } else { DVec3::ZERO }
    }

    /// The largest coordinate that a ray may begin at, metres.
    pub(super) fn farthest(&self) -> f32 {
        let [right, up, _] = self.axes;
        let aside = if self.parallel { (right.abs() + up.abs()).max_element() as f32 } else { 0.0 };
        self.eye.abs().max_element() + aside
    }

    fn aside(&self, x: u32, y: u32) -> DVec3 {
        let across = (f64::from(x) + 0.5) / f64::from(self.size.width) * 2.0 - 1.0;
        let upward = 1.0 - (f64::from(y) + 0.5) / f64::from(self.size.height) * 2.0;
        let [right, up, _] = self.axes;
        right * across + up * upward
    }
}

/// Right, up and forward of a camera whose picture is twice `sides` wide and high.
fn axes(forward: DVec3, up: DVec3, [half_width, half_height]: [f64; 2]) -> [DVec3; 3] {
    let right = forward.cross(up);
    let right = right / right.length();
    [right * half_width, right.cross(forward) * half_height, forward]
}

/// What can be said against a camera before it is known where it stands when nobody says so.
pub(super) fn check(eye: Option<Vec3>, target: Option<Vec3>, fov: f32) -> Result<(), BadCamera> {
    for (what, at) in [("eye", eye), ("target", target)] {
        if let Some(at) = at.filter(|at| !is_near(*at)) {
            return Err(BadCamera::NotFinite { what, at });
        }
    }
    match (eye, target) {
        _ if !FOV.contains(&fov) => Err(BadCamera::Fov { fov }),
        (Some(eye), Some(target)) if eye == target => Err(BadCamera::NoDirection { at: eye }),
        _ => Ok(()),
    }
}

/// Whether a point is one that can be computed with; NaN compares false.
pub(super) fn is_near(at: Vec3) -> bool {
    at.abs().to_array().iter().all(|c| *c <= FARTHEST)
}

/// What is wrong with a point that is not, without the name that it was given under.
pub(super) fn not_finite(at: Vec3) -> String {
    format!("{at}: coordinates must be finite and at most {FARTHEST:e} m from 0")
}

/// Half the width and height of the picture at distance 1.
fn half_sides(fov: f32, size: PictureSize) -> [f64; 2] {
    let (sin, cos) = math::sin_cos_degrees(f64::from(fov) / 2.0);
    let height = sin / cos;
    [height * f64::from(size.width) / f64::from(size.height), height]
}

/// The eye and the target of the view that is taken where nobody says one: the whole scene from the side from which the most of its fronts
/// is seen.
///
/// # Errors
/// A field of view out of range.
pub(super) fn default_view(scene: &Scene, fov: f32, size: PictureSize) -> Result<(Vec3, Vec3), BadCamera> {
    check(None, None, fov)?;
    let (low, high) = scene.bounds();
    let (low, high) = (Vec3::from_array(low).as_dvec3(), Vec3::from_array(high).as_dvec3());
    let (centre, radius) = ((low + high) / 2.0, (high - low).length() / 2.0);
    let candidates = ELEVATIONS.iter().flat_map(|e| AZIMUTHS.map(|a| direction(a, *e)));
    let mut best = (f64::NEG_INFINITY, DVec3::Z);
    for d in candidates {
        let score = score(scene, d);
        if score > best.0 {
            best = (score, d);
        }
    }
    let [half_width, half_height] = half_sides(fov, size);
    let tangent = half_width.min(half_height);
    let sine = tangent / (1.0 + tangent * tangent).sqrt();
    Ok(((centre + best.1 * (radius / sine)).as_vec3(), centre.as_vec3()))
}

/// The unit direction from the target to an eye at this azimuth (from +Z toward +X) and elevation, degrees.
fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (math::sin_cos_degrees(azimuth), math::sin_cos_degrees(elevation));
    DVec3::new(cos_e * sin_a, sin_e, cos_e * cos_a)
}

/// The area of all fronts as seen from far away along `d`.
fn score(scene: &Scene, d: DVec3) -> f64 {
    let triangles = scene.surfaces.iter().flat_map(|s| &s.triangles);
    triangles
        .map(|t| {
            let [a, b, c] = scene.corners(t);
            0.5 * (b - a).cross(c - a).dot(d).max(0.0)
        })
        .sum()
}
