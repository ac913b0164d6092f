//! What a picture of the page and one of the renderer differ by, in levels of 1/255 as displayed.

use super::SIZE;
use kiln_proto::math;
use std::{fs, path::Path};

/// What two pictures of one view differ by.
#[derive(Debug, Default)]
pub(super) struct Difference {
    pub(super) compared: usize,
    /// Pixels that are edges, which are not compared.
    pub(super) edges: usize,
    /// The largest difference of a channel, levels.
    pub(super) max: f32,
    sum: f64,
    /// Pixels that are off by more than is allowed.
    pub(super) off: usize,
}

impl Difference {
    /// Adds a pixel: by how many levels each channel is off.
    pub(super) fn add(&mut self, channels: impl Iterator<Item = f32>, allowed: f32) {
        self.compared += 1;
        let mut worst = 0.0f32;
        for d in channels {
            worst = worst.max(d);
            self.sum += f64::from(d);
        }
        self.max = self.max.max(worst);
        self.off += usize::from(worst > allowed);
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / (3 * self.compared.max(1)) as f64
    }
}

/// What a pixel may show: the span of each channel, levels, and the charts that are seen in it.
#[derive(Debug, Clone, Default)]
pub(super) struct Expected {
    pub(super) charts: Vec<u32>,
    pub(super) span: [Option<(f32, f32)>; 3],
}

impl Expected {
    pub(super) fn add(&mut self, chart: u32, levels: [f32; 3]) {
        if !self.charts.contains(&chart) {
            self.charts.push(chart);
        }
        for (span, v) in self.span.iter_mut().zip(levels) {
            let (low, high) = span.unwrap_or((v, v));
            *span = Some((low.min(v), high.max(v)));
        }
    }
}

/// Compares a picture of the page with what its pixels may show. A pixel in which several charts are seen, or another than the page sees,
/// is an edge.
pub(super) fn compare_pictures(expected: &[Expected], page: &[[f32; 4]]) -> Difference {
    compare(expected, page, 1.0, |pixel, shown| pixel.charts != [shown[3] as u32])
}

/// The same where surfaces are seen through others: a pixel in which the reference itself varies by more than `steep` levels is an edge,
/// for which charts are no measure: the border of a mask, of a tint, of what is clear. `allowed` levels are not off.
pub(super) fn compare_through(expected: &[Expected], page: &[[f32; 4]], steep: f32, allowed: f32) -> Difference {
    compare(expected, page, allowed, |pixel, _| pixel.span.iter().flatten().any(|(low, high)| high - low > steep))
}

fn compare(expected: &[Expected], page: &[[f32; 4]], allowed: f32, is_edge: impl Fn(&Expected, &[f32; 4]) -> bool) -> Difference {
    let mut difference = Difference::default();
    for (k, pixel) in expected.iter().enumerate() {
        let (x, y) = (k % SIZE.0 as usize, k / SIZE.0 as usize);
        let shown = &page[(SIZE.1 as usize - 1 - y) * SIZE.0 as usize + x];
        if is_edge(pixel, shown) {
            difference.edges += 1;
        } else if shown[3] > 0.0 || !pixel.charts.contains(&0) {
            // Where the reference sees surfaces and the page nothing opaque, its light tells glass before nothing from a surface that is
            // not drawn.
            let outside =
                |(v, span): (&f32, &Option<(f32, f32)>)| span.map_or(0.0, |(low, high)| (low - level(*v)).max(level(*v) - high).max(0.0));
            difference.add(shown.iter().zip(&pixel.span).map(outside), allowed);
        }
    }
    difference
}

/// As displayed, 0 to 255.
pub(super) fn level(linear: f32) -> f32 {
    math::srgb_oetf(linear.clamp(0.0, 1.0)) * 255.0
}

/// A file of float32 RGBA pixels.
pub(super) fn floats(path: &Path) -> Vec<[f32; 4]> {
    let bytes = fs::read(path).unwrap();
    bytes.as_chunks::<16>().0.iter().map(|p| std::array::from_fn(|c| f32::from_le_bytes(p.as_chunks::<4>().0[c]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: usize = (SIZE.0 * SIZE.1) as usize;

    fn everywhere(chart: u32, levels: f32) -> Vec<Expected> {
        let mut pixel = Expected::default();
        pixel.add(chart, [levels; 3]);
        vec![pixel; PIXELS]
    }

    #[test]
    fn a_page_that_draws_nothing_is_off_where_the_reference_sees_a_surface() {
        let nothing = vec![[0.0; 4]; PIXELS];
        let missing = compare_through(&everywhere(3, 120.0), &nothing, 6.0, 1.0);
        assert_eq!((missing.off, missing.compared, missing.edges), (PIXELS, PIXELS, 0));
        let empty = compare_through(&everywhere(0, 0.0), &nothing, 6.0, 1.0);
        assert_eq!((empty.off, empty.compared), (0, 0), "both see nothing");
    }

    #[test]
    fn glass_before_nothing_is_compared_by_its_light() {
        // The page's chart is that of what is opaque: none.
        let glass = vec![[0.2, 0.2, 0.2, 0.0]; PIXELS];
        let found = compare_through(&everywhere(3, level(0.2)), &glass, 6.0, 1.0);
        assert_eq!((found.off, found.compared), (0, PIXELS));
    }
}
