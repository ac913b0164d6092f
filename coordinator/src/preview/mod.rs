//! The preview without a GPU: a picture of a finished package, ray cast and decoded by the reference of `proto`.
//!
//! One renderer for `kiln render`, for `GET /v1/jobs/{id}/preview.png` and for whoever checks the page: they differ only in where a package's
//! files lie ([`PackageFiles`]). It goes through the picture in bands: first what every pixel sees ([`visibility`]), then all texels that the
//! band needs in the order of the files ([`shade`]), so that memory depends on the picture and not on the package. Looking texels up pixel
//! by pixel would need no sorting and, on files that are not in memory, a read for each of four texels of each pixel.

pub mod camera;
mod frame;
mod light;
mod shade;
pub mod view;
mod visibility;

pub use camera::{BadCamera, Camera, PictureSize};
pub use frame::{BACKGROUND, Frame, Pixel};
pub use light::{Light, Origin, PackageFiles};
pub use view::{BadView, Mode, View};

#[cfg(test)]
mod tests;

use kiln_proto::{format::stream::ReadError, plan::Plan, scene::Scene};

/// A number that changes whenever pictures of the same package and view may change: part of every entity tag.
pub const RENDERER_VERSION: u32 = 1;

/// Pixels of one band: some 260 bytes each for what they see, need and find, so about 32 MiB.
const BAND_PIXELS: usize = 1 << 17;

/// Renders what `camera` sees. Threads: rayon's pool.
///
/// # Errors
/// Files of the package that cannot be read or are damaged.
pub fn render(scene: &Scene, plan: &Plan, light: &mut Light<'_>, camera: &Camera, mode: Mode) -> Result<Frame, ReadError> {
    let stage = visibility::Stage::new(scene, plan, camera.eye());
    let mut frame = Frame::new(camera.size(), plan.exposure());
    let rows = (BAND_PIXELS / camera.size().width as usize).max(1) as u32;
    for first in (0..camera.size().height).step_by(rows as usize) {
        let seen = stage.look(camera, first..(first + rows).min(camera.size().height));
        let radiance = shade::shade(plan, light, &seen, mode)?;
        frame.extend(&seen, &radiance);
    }
    Ok(frame)
}
