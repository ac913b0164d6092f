//! The preview without a GPU: a picture of a finished package, ray cast and decoded by the reference of `proto`.
//!
//! One renderer for `kiln render`, for `GET /v1/jobs/{id}/preview.png` and for whoever checks the page: they differ only in where a
//! package's files lie ([`PackageFiles`]). It goes through the picture in bands: first what every pixel sees ([`visibility`]), then all
//! texels that the band needs in the order of the files ([`shade`]), so that memory depends on the picture and not on the package. Looking
//! texels up pixel by pixel would need no sorting and, on files that are not in memory, a read for each of four texels of each pixel.

pub mod camera;
mod frame;
mod light;
mod picture;
mod shade;
mod stop;
pub mod view;
mod visibility;

pub use camera::{BadCamera, Camera, PictureSize};
pub use frame::{BACKGROUND, Frame, Pixel};
pub use light::{Light, Origin, PackageFiles};
pub use picture::Picture;
pub use stop::{Stop, Stopped};
pub use view::{BadView, Mode, View};

#[cfg(test)]
mod tests;

use self::{
    picture::Display,
    visibility::{GOES, Stage, Walk},
};
use kiln_proto::{
    format::stream::ReadError,
    plan::Plan,
    scene::{Environment, Scene},
    units::Rgb,
};
use std::ops::Range;

/// A number that changes whenever pictures of the same package and view may change: part of every entity tag.
pub const RENDERER_VERSION: u32 = 3;

/// Rays of one band, at least one row of pixels, and layers whose light is looked up at once: some 380 bytes each for what they see, need
/// and find, so about 50 MiB; up to 80 more for each of 16 layers where much is seen through.
const BAND_PIXELS: usize = 1 << 17;

/// Behind layers that leave less than this nothing is looked for, and there is no sky: not even what is as bright as a surface may be
/// ([`BRIGHTEST`](kiln_proto::limits::BRIGHTEST)) would reach a hundredth there.
const UNSEEN: f32 = 1e-15;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A file of the package cannot be read or is damaged.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It was given up.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Finds what `camera` sees, one ray a pixel, in linear radiance, before the environment where the scene has one. Threads: rayon's pool.
/// Memory: 32 bytes a pixel, and that of a band.
///
/// # Errors
/// Files of the package that cannot be read or are damaged.
pub fn render(scene: &Scene, plan: &Plan, light: &mut Light<'_>, camera: &Camera, mode: Mode) -> Result<Frame, RenderError> {
    let mut frame = Frame::new(camera.size());
    let bands = Bands { scene, plan, mode, environment: scene.environment.as_ref(), stop: &Stop::default() };
    bands.each(light, camera, 1, |pixels| frame.extend(pixels))?;
    Ok(frame)
}

/// Draws a view for the eye: `camera` is that of `view` in this scene. Threads: rayon's pool. Memory: 3 bytes a pixel, and that of a band.
///
/// # Errors
/// As [`render`], and a picture that was given up.
pub fn draw(scene: &Scene, plan: &Plan, light: &mut Light<'_>, camera: &Camera, view: &View, stop: &Stop) -> Result<Picture, RenderError> {
    let mut picture = Picture::new(camera.size());
    let display = Display::new(plan.exposure(), view.exposure, view.antialias);
    let environment = scene.environment.as_ref().filter(|_| !view.hide_environment);
    let bands = Bands { scene, plan, mode: view.mode, environment, stop };
    bands.each(light, &camera.finer(view.antialias), view.antialias, |rays| picture.extend(rays, display))?;
    Ok(picture)
}

/// What is gone through in bands.
struct Bands<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    mode: Mode,
    /// What is seen behind everything.
    environment: Option<&'a Environment>,
    stop: &'a Stop,
}

impl Bands<'_> {
    /// Hands over the rays of `camera`, some rows at a time, their number a multiple of `step`.
    fn each(&self, light: &mut Light<'_>, camera: &Camera, step: u32, mut take: impl FnMut(&[Pixel])) -> Result<(), RenderError> {
        self.stop.check()?;
        let stage = Stage::new(self.scene, self.plan, camera);
        let PictureSize { width, height } = camera.size();
        let rows = (BAND_PIXELS / (width * step) as usize).max(1) as u32 * step;
        for first in (0..height).step_by(rows as usize) {
            take(&self.band(light, camera, &stage, first..(first + rows).min(height))?);
        }
        Ok(())
    }

    /// The rays of some rows, some layers at a time.
    fn band(&self, light: &mut Light<'_>, camera: &Camera, stage: &Stage<'_>, rows: Range<u32>) -> Result<Vec<Pixel>, RenderError> {
        let rays = rows.len() * camera.size().width as usize;
        let (mut pixels, mut walks) = (vec![Pixel::UNSEEN; rays], vec![Walk::Eye; rays]);
        for _ in 0..GOES {
            let looked = stage.look(camera, rows.clone(), &walks, self.stop)?;
            let mut radiance = Vec::with_capacity(looked.layers.len());
            for layers in looked.layers.chunks(BAND_PIXELS) {
                radiance.extend(shade::shade(self.plan, light, layers, self.mode, self.stop)?);
            }
            frame::add(&mut pixels, &looked, &radiance);
            walks = looked.walks;
            let rest = pixels.iter_mut().zip(&mut walks).filter(|(pixel, _)| pixel.background.max_channel() < UNSEEN);
            rest.for_each(|(pixel, walk)| (pixel.background, *walk) = (Rgb::BLACK, Walk::Done));
            if walks.iter().all(|walk| *walk == Walk::Done) {
                break;
            }
        }
        // What lies behind the last layer that is followed is not seen, and no sky either.
        for (pixel, _) in pixels.iter_mut().zip(&walks).filter(|(_, walk)| **walk != Walk::Done) {
            (pixel.background, pixel.found) = (Rgb::BLACK, false);
        }
        let width = camera.size().width;
        let direction = |ray: u32| camera.direction(ray % width, rows.start + ray / width);
        frame::finish(&mut pixels, |ray| self.environment.map(|e| e.radiance(direction(ray as u32))));
        Ok(pixels)
    }
}
