//! Shelf packing: boxes sorted by height stand side by side on shelves (Coffman et al. 1980, first-fit on the last shelf).

use super::{GAP, Packed, Piece, Place, aligned};

/// Packs boxes without turning them: tallest first, then widest, then first.
pub(super) fn pack(pieces: &[Piece], width: u32, height: u32) -> Option<Packed> {
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_unstable_by_key(|i| (std::cmp::Reverse(pieces[*i].size.1), std::cmp::Reverse(pieces[*i].size.0), *i));
    let mut packed = Packed { places: vec![Place::default(); pieces.len()], width: 0, height: 0 };
    // The next free column of the shelf, its bottom and its top.
    let (mut x, mut bottom, mut top) = (0u64, 0u64, 0u64);
    for i in order {
        let (w, h) = (u64::from(pieces[i].size.0), u64::from(pieces[i].size.1));
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
        packed.places[i].origin = (at as u32, bottom as u32);
        x = at + w + GAP;
        top = top.max(bottom + h);
        packed.width = packed.width.max((at + w) as u32);
        packed.height = packed.height.max((bottom + h) as u32);
    }
    Some(packed)
}
