//! What a layout must keep: no texel of two places, charts two gutters apart, no triangle turned over.
//!
//! The texture is gone through in bands of rows, so that memory does not depend on its height. Within a band every texel knows its chart; a
//! sweep along rows and then columns finds charts that come within two gutters of each other. Cost: linear in texels and triangles.

use super::{Charts, pack::GAP, raster};
use glam::DVec2;
use kiln_proto::settings::TextureSize;
use std::collections::BTreeSet;

/// Rows of a band, without those that it shares with the next.
const BAND: u32 = 256;
/// Texels that a turned-over triangle must have to count: below, rounding decides which way it turns.
const TURNED: f64 = 0.01;

/// A place where a layout is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fault {
    /// Two triangles share a texel; their charts, which may be one.
    Overlap { x: u32, y: u32, charts: (u32, u32) },
    /// Two charts have fewer than two gutters between them.
    Close { x: u32, y: u32, charts: (u32, u32) },
}

/// The first fault: an overlap, if there is any, else charts that are too close.
pub(super) fn first_fault(layout: &Charts) -> Option<Fault> {
    let mut close = None;
    let mut overlap = None;
    bands(layout, |band| {
        overlap = band.overlaps.first().copied();
        close = close.or_else(|| band.close());
        overlap.is_none()
    });
    overlap.or(close)
}

/// The charts that cover some texel twice, or have a triangle turned over.
pub(super) fn faulty_charts(layout: &Charts) -> BTreeSet<u32> {
    let mut faulty: BTreeSet<u32> = (0..layout.uv.len()).filter(|t| turned(layout, *t)).map(|t| layout.charts[t]).collect();
    bands(layout, |band| {
        for fault in &band.overlaps {
            if let Fault::Overlap { charts: (a, b), .. } = fault {
                faulty.extend([*a, *b]);
            }
        }
        true
    });
    faulty
}

/// Whether a triangle's front is seen from behind in the texture.
fn turned(layout: &Charts, triangle: usize) -> bool {
    let [a, b, c] = texels(&layout.uv[triangle], layout.size);
    (b - a).perp_dot(c - a) / 2.0 < -TURNED
}

fn texels(uv: &[[f32; 2]; 3], size: TextureSize) -> [DVec2; 3] {
    uv.map(|[u, v]| DVec2::new(f64::from(u) * f64::from(size.width), f64::from(v) * f64::from(size.height)))
}

/// Some rows of a texture.
struct Band {
    width: u32,
    /// Its first row.
    from: u32,
    /// The chart of each texel, plus one; 0 where there is none.
    charts: Vec<u32>,
    /// One for each pair of charts and triangle.
    overlaps: Vec<Fault>,
}

/// Hands over one band after the other until `go_on` answers false. Each begins with the last rows of the one before.
fn bands(layout: &Charts, mut go_on: impl FnMut(&Band) -> bool) {
    let TextureSize { width, height } = layout.size;
    let corners: Vec<[DVec2; 3]> = layout.uv.iter().map(|uv| texels(uv, layout.size)).collect();
    // The rows of each triangle, so that a band passes over those of others.
    let rows: Vec<(f64, f64)> = corners.iter().map(|[a, b, c]| (a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y))).collect();
    let mut from = 0;
    while from < height {
        let until = (from + BAND + GAP as u32).min(height);
        let mut band = Band { width, from, charts: vec![0; (width * (until - from)) as usize], overlaps: vec![] };
        for (t, (low, high)) in rows.iter().enumerate() {
            if *high >= f64::from(from) && *low <= f64::from(until) {
                band.draw(corners[t], layout.charts[t], until - from);
            }
        }
        if !go_on(&band) {
            return;
        }
        from += BAND;
    }
}

impl Band {
    fn draw(&mut self, corners: [DVec2; 3], chart: u32, rows: u32) {
        let moved = corners.map(|c| c - DVec2::new(0.0, f64::from(self.from)));
        let mut said = None;
        raster::inside(moved, self.width, rows, |x, y| {
            let texel = &mut self.charts[(y * self.width + x) as usize];
            if *texel != 0 && said != Some(*texel) {
                said = Some(*texel);
                self.overlaps.push(Fault::Overlap { x, y: y + self.from, charts: (*texel - 1, chart) });
            }
            *texel = chart + 1;
            true
        });
    }

    /// The first pair of charts with fewer than two gutters between them. Two texels are that close when each reaches, within its row and
    /// half a gap to both sides, a common column in which their rows are.
    fn close(&self) -> Option<Fault> {
        let (width, gap) = (self.width as usize, GAP as usize);
        // Chart and row of what was last seen in each column.
        let mut columns: Vec<(u32, usize)> = vec![(0, 0); width];
        let mut reach = vec![0u32; width];
        for (y, row) in self.charts.chunks(width).enumerate() {
            reach.fill(0);
            let fault = |x: usize, a: u32, b: u32| Fault::Close { x: x as u32, y: y as u32 + self.from, charts: (a - 1, b - 1) };
            let mut last: Option<(usize, u32)> = None;
            for (x, chart) in row.iter().enumerate().filter(|(_, chart)| **chart != 0) {
                if let Some((at, other)) = last
                    && other != *chart
                    && x - at <= gap
                {
                    return Some(fault(x, other, *chart));
                }
                last = Some((x, *chart));
                reach[x.saturating_sub(gap / 2)..(x + gap / 2 + 1).min(width)].fill(*chart);
            }
            for (x, chart) in reach.iter().enumerate().filter(|(_, chart)| **chart != 0) {
                let (other, seen) = columns[x];
                if other != 0 && other != *chart && y - seen <= gap {
                    return Some(fault(x, other, *chart));
                }
                columns[x] = (*chart, y);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares of whole texels, two triangles each, as charts of their own in a texture of 600 x 600.
    fn squares(boxes: &[[f32; 4]]) -> Charts {
        let size = TextureSize { width: 600, height: 600 };
        let mut layout = Charts { size, uv: vec![], charts: vec![] };
        for (id, b) in boxes.iter().enumerate() {
            let [x0, y0, x1, y1] = b.map(|v| v / 600.0);
            layout.uv.extend([[[x0, y0], [x1, y0], [x1, y1]], [[x0, y0], [x1, y1], [x0, y1]]]);
            layout.charts.extend([id as u32; 2]);
        }
        layout
    }

    #[test]
    fn two_gutters_are_enough_and_less_is_too_close_in_every_direction() {
        let beside =
            |dx: f32, dy: f32| first_fault(&squares(&[[300.0, 250.0, 310.0, 258.0], [300.0 + dx, 250.0 + dy, 310.0 + dx, 258.0 + dy]]));
        for (dx, dy) in [(14.0, 0.0), (-14.0, 0.0), (0.0, 12.0), (14.0, 12.0), (-14.0, -12.0), (14.0, 3.0), (0.0, -12.0)] {
            assert_eq!(beside(dx, dy), None, "{dx} {dy}");
        }
        for (dx, dy) in [(13.0, 0.0), (-13.0, 0.0), (0.0, 11.0), (13.0, 11.0), (-13.0, 11.0), (13.0, 12.0 - 1.0), (0.0, -11.0), (10.0, 8.0)]
        {
            assert!(matches!(beside(dx, dy), Some(Fault::Close { charts, .. }) if charts == (0, 1) || charts == (1, 0)), "{dx} {dy}");
        }
        assert!(matches!(beside(9.0, 7.0), Some(Fault::Overlap { x: 309, y: 257, .. })));
    }

    #[test]
    fn overlaps_within_a_chart_and_turned_triangles_are_found() {
        let mut layout = squares(&[[0.0, 0.0, 20.0, 20.0], [100.0, 500.0, 120.0, 520.0], [200.0, 0.0, 220.0, 20.0]]);
        assert!(faulty_charts(&layout).is_empty());
        layout.uv[3] = layout.uv[2];
        layout.uv[4].swap(0, 1);
        assert_eq!(faulty_charts(&layout), BTreeSet::from([1, 2]));
    }
}
