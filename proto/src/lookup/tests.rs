//! Golden values, worked out by hand: a surface of 3 x 2 texels and 2 x 4 directions whose files are written byte by byte.

use super::*;
use crate::{
    codec::pwl::{Order, sample_at},
    format::{Header, Kind, surface::SurfaceFiles},
    grid::Walk,
    units::byte_to_radiance,
};

const WIDTH: u32 = 3;

fn grid() -> SphericalGrid {
    SphericalGrid::new(2, 4).unwrap()
}

fn size() -> TextureSize {
    TextureSize::new(WIDTH, 2).unwrap()
}

fn file(kind: Kind, bits: u16, count: u64, payload: &[u8]) -> Vec<u8> {
    [&Header { kind, bits, size: size(), depth: 8, count, crc: crc32c::crc32c(payload) }.to_bytes()[..], payload].concat()
}

/// Texel 0 rises from black at depth 0 by 10 a depth; texel 1 is 200 all over; texels 2 and 5 hold nothing; 3 is 40 and 4 is 80 all over.
fn files() -> [Vec<u8>; 4] {
    let starts: Vec<u8> = [0u32, 2, 4, 4, 6, 8, 8].iter().flat_map(|s| s.to_le_bytes()).collect();
    let depths: Vec<u8> = [0u16, 7, 0, 7, 0, 7, 0, 7].iter().flat_map(|d| d.to_le_bytes()).collect();
    let colours = [0, 70, 200, 200, 40, 40, 80, 80].map(|v: u8| [v; 3]).concat();
    [file(Kind::Mtsp, 32, 7, &starts), file(Kind::Mti, 16, 8, &depths), file(Kind::Mtnc, 24, 8, &colours), file(Kind::Mtm, 8, 0, &[])]
}

/// The exposure factor of the files.
const FACTOR: f32 = 0.5;

fn linear(byte: u8) -> f32 {
    byte_to_radiance(byte, FACTOR)
}

/// The red channel at a point in texels, (0.5, 0.5) being the centre of texel 0. The files are grey.
fn look(x: f32, y: f32, view: Vec3) -> Option<f32> {
    let files = files();
    let surface = SurfaceFiles::parse(&files[0], &files[1], &files[2], &files[3]).unwrap();
    let order = Order::new(grid(), Walk::Phi);
    let sample = |texel: u64, depth: u32| {
        let value = sample_at(&surface.kept(texel as usize), &order, depth as u16)?;
        Some(Rgb::from(value.map(linear)))
    };
    let found = radiance([x / WIDTH as f32, y / 2.0], view, size(), grid(), sample)?;
    assert!(found.r == found.g && found.g == found.b, "{found:?}");
    Some(found.r)
}

fn close(found: Option<f32>, expected: f32) {
    let found = found.expect("there is light");
    assert!((found - expected).abs() <= 2e-6 * expected.max(0.01), "{found} is not {expected}");
}

#[test]
fn a_texel_s_centre_and_a_grid_direction_give_the_stored_value() {
    for depth in 0..8u32 {
        close(look(0.5, 0.5, grid().direction(depth)), linear(10 * depth as u8));
    }
    close(look(1.5, 0.5, grid().direction(6)), linear(200));
    close(look(0.5, 1.5, grid().direction(1)), linear(40));
}

#[test]
fn halfway_is_the_mean_of_linear_values() {
    let view = grid().direction(5); // texel 0 holds 50 there
    close(look(1.0, 0.5, view), (linear(50) + linear(200)) / 2.0);
    close(look(0.5, 1.0, view), (linear(50) + linear(40)) / 2.0);
    close(look(1.0, 1.0, view), (linear(50) + linear(200) + linear(40) + linear(80)) / 4.0);
    close(look(0.75, 0.5, view), 0.75 * linear(50) + 0.25 * linear(200));
    // Between the two rings at azimuth 90 degrees: depths 1 and 5. Rings are at 22.5 and 67.5 degrees.
    let (s, c) = math::sin_cos_degrees(45.0);
    close(look(0.5, 0.5, Vec3::new(0.0, s as f32, c as f32)), (linear(10) + linear(50)) / 2.0);
    // Between azimuths 270 and 360 on the lower ring: depths 7 and 4.
    let (s, c) = math::sin_cos_degrees(67.5);
    let (x, y) = (s as f32 * std::f32::consts::FRAC_1_SQRT_2, -s as f32 * std::f32::consts::FRAC_1_SQRT_2);
    close(look(0.5, 0.5, Vec3::new(x, y, c as f32)), (linear(70) + linear(40)) / 2.0);
}

#[test]
fn texels_without_samples_take_no_part() {
    let view = grid().direction(2);
    // Halfway to texel 2, which is empty: texel 1 alone. At the corner of four with two empty: the mean of the other two.
    close(look(2.0, 0.5, view), linear(200));
    close(look(2.0, 1.0, view), (linear(200) + linear(80)) / 2.0);
    close(look(2.25, 1.25, view), (linear(200) * 0.25 * 0.25 + linear(80) * 0.25 * 0.75) / 0.25);
    assert_eq!(look(2.5, 0.5, view), None, "the centre of an empty texel gives its neighbours no weight");
    assert_eq!(look(3.0, 2.0, view), None);
}

#[test]
fn the_border_of_the_texture_is_its_last_texel() {
    let view = grid().direction(3);
    for (x, y) in [(0.0, 0.0), (-5.0, 0.5), (0.5, -0.1)] {
        close(look(x, y, view), linear(30));
    }
    close(look(0.0, 9.0, view), linear(40));
}

#[test]
fn the_pole_is_the_mean_across_it() {
    // Straight up, azimuth 0: half depth 0, half depth 2 across the pole.
    close(look(0.5, 0.5, Vec3::Z), (linear(0) + linear(20)) / 2.0);
    // A little to the side it is still continuous.
    let near = look(0.5, 0.5, Vec3::new(-1e-4, 0.0, 1.0).normalize()).unwrap();
    assert!((near - (linear(0) + linear(20)) / 2.0).abs() < 1e-3);
}

#[test]
fn below_the_last_ring_and_below_the_horizon_the_last_ring_counts() {
    close(look(0.5, 0.5, Vec3::X), linear(40));
    close(look(0.5, 0.5, Vec3::new(0.8, 0.0, -0.6)), linear(40));
    close(look(0.5, 0.5, Vec3::new(0.0, -0.8, -0.6)), linear(70));
}

#[test]
fn weights_sum_to_one_and_stay_inside_any_texture() {
    for (width, height) in [(1, 1), (1, 7), (8192, 8192)] {
        let size = TextureSize::new(width, height).unwrap();
        for k in 0..200 {
            let uv = [k as f32 * 0.013 - 0.8, 1.7 - k as f32 * 0.017];
            let found = footprint(uv, size);
            let sum: f32 = found.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-6 && found.iter().all(|(t, w)| *t < size.texels() && *w >= 0.0), "{uv:?} {found:?}");
        }
    }
}

#[test]
fn the_diffuse_mean_of_equal_radiance_is_that_radiance_and_of_a_cosine_two_thirds() {
    let grid = SphericalGrid::default();
    let mean = DiffuseMean::new(grid);
    let rgb = Rgb::new(0.1, 3.7, 1e-5);
    assert_eq!(mean.of((0..grid.len()).map(|_| rgb)), rgb);
    // The integral of cos^2 over that of cos is 2/3; the midpoint rule over 20 rings is right to a thousandth.
    let cosine = mean.of(grid.directions().iter().map(|d| Rgb::splat(d.z)));
    assert!((cosine.r - 2.0 / 3.0).abs() < 1e-3, "{cosine:?}");
}
