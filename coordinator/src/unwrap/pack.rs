//! Shelf packing: rectangles sorted by height stand side by side on shelves (Coffman et al. 1980, first-fit on the last shelf).
//!
//! Between two charts lie two gutters of [`GUTTER`] texels; at the border of the texture none is needed, because samplers clamp there.
//! Skyline and guillotine packers save a few per cent more on mixed sizes; shelves are simple to check and good on sorted rectangles.

use kiln_proto::{texel::GUTTER, tile::TILE_SIDE};

/// Texels between two charts: a gutter for each.
pub(super) const GAP: u64 = 2 * GUTTER as u64;

/// Where rectangles were put.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Packed {
    /// Lower corner of each rectangle, in the order given.
    pub(super) origins: Vec<(u32, u32)>,
    /// Columns in use.
    pub(super) width: u32,
    /// Rows in use.
    pub(super) height: u32,
}

/// The order in which rectangles (width, height) are put on shelves: tallest first, then widest, then first.
fn order(sizes: &[(u32, u32)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_unstable_by_key(|i| (std::cmp::Reverse(sizes[*i].1), std::cmp::Reverse(sizes[*i].0), *i));
    order
}

/// Packs rectangles into `width` columns and at most `height` rows; `None` where they do not fit.
pub(super) fn pack(sizes: &[(u32, u32)], width: u32, height: u32) -> Option<Packed> {
    let mut origins = vec![(0, 0); sizes.len()];
    let (mut used_width, mut used_height) = (0u64, 0u64);
    // The next free column of the shelf, its bottom and its top.
    let (mut x, mut bottom, mut top) = (0u64, 0u64, 0u64);
    for i in order(sizes) {
        let (w, h) = (u64::from(sizes[i].0), u64::from(sizes[i].1));
        let mut at = aligned(x, w);
        if at + w > u64::from(width) && x + w <= u64::from(width) {
            at = x;
        }
        if at + w > u64::from(width) {
            bottom = aligned(if top == 0 { 0 } else { top + GAP }, h);
            (at, top) = (0, bottom);
        }
        if w > u64::from(width) || bottom + h > u64::from(height) {
            return None;
        }
        origins[i] = (at as u32, bottom as u32);
        x = at + w + GAP;
        top = top.max(bottom + h);
        used_width = used_width.max(at + w);
        used_height = used_height.max(bottom + h);
    }
    Some(Packed { origins, width: used_width as u32, height: used_height as u32 })
}

/// Charts longer than a tile begin at one where that wastes less than a quarter of their length: fewer tiles, and fewer borders in them.
fn aligned(start: u64, length: u64) -> u64 {
    let tile = u64::from(TILE_SIDE);
    let next = start.next_multiple_of(tile);
    if length > tile && (next - start) * 4 <= length { next } else { start }
}

/// Packs into whatever shape wastes least, with sides of at most `side` texels.
pub(super) fn pack_free(sizes: &[(u32, u32)], side: u32) -> Option<Packed> {
    let area: f64 = sizes.iter().map(|(w, h)| (f64::from(*w) + GAP as f64) * (f64::from(*h) + GAP as f64)).sum();
    let widest = sizes.iter().map(|(w, _)| *w).max().unwrap_or(1);
    let widths = [0.7, 0.85, 1.0, 1.15, 1.35, 1.6, 2.0].map(|k| ((area.sqrt() * k) as u32).clamp(widest, side.max(widest)));
    let texels = |p: &Packed| u64::from(p.width) * u64::from(p.height);
    // `min_by_key` keeps the first of equals.
    widths.into_iter().filter(|w| *w <= side).filter_map(|w| pack(sizes, w, side)).min_by_key(texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_chart_fills_its_texture_and_two_keep_their_gutters() {
        let one = pack_free(&[(30, 20)], 8192).unwrap();
        assert_eq!((one.width, one.height, &one.origins[..]), (30, 20, &[(0, 0)][..]));
        let two = pack(&[(10, 10), (10, 10)], 24, 10).unwrap();
        assert_eq!((two.origins, two.width), (vec![(0, 0), (14, 0)], 24));
        assert_eq!(pack(&[(10, 10), (10, 10)], 23, 10), None);
        assert_eq!(pack(&[(10, 10), (10, 10)], 23, 24).unwrap().origins, [(0, 0), (0, 14)]);
    }

    #[test]
    fn wide_charts_begin_at_tiles_where_that_is_cheap() {
        assert_eq!(pack(&[(60, 60), (50, 60)], 200, 60).unwrap().origins, [(0, 0), (64, 0)]);
        assert_eq!(pack(&[(60, 60), (50, 60)], 114, 60).unwrap().origins, [(0, 0), (64, 0)]);
        assert_eq!(pack(&[(59, 60), (50, 60)], 113, 60).unwrap().origins, [(0, 0), (63, 0)], "no room to align");
        assert_eq!(pack(&[(65, 60), (40, 60)], 200, 60).unwrap().origins, [(0, 0), (69, 0)], "too dear to align");
    }

    proptest! {
        #[test]
        fn rectangles_stay_inside_and_apart(sizes in prop::collection::vec((1u32..90, 1u32..90), 1..60), free in any::<bool>(), width in 90u32..400) {
            let packed = if free { pack_free(&sizes, 8192) } else { pack(&sizes, width, 100_000) }.unwrap();
            let gap = GAP as u32;
            for (i, ((x, y), (w, h))) in packed.origins.iter().zip(&sizes).enumerate() {
                prop_assert!(x + w <= packed.width && y + h <= packed.height);
                prop_assert!(free || packed.width <= width);
                for ((ox, oy), (ow, oh)) in packed.origins.iter().zip(&sizes).skip(i + 1) {
                    let apart = x + w + gap <= *ox || ox + ow + gap <= *x || y + h + gap <= *oy || oy + oh + gap <= *y;
                    prop_assert!(apart, "{:?} {:?}", (x, y, w, h), (ox, oy, ow, oh));
                }
            }
        }
    }
}
