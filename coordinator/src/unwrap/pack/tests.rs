use super::*;
use proptest::prelude::*;

fn full(sizes: &[(u32, u32)]) -> Vec<Piece> {
    sizes.iter().map(|(w, h)| Piece::full(*w, *h)).collect()
}

fn origins(packed: &Packed) -> Vec<(u32, u32)> {
    packed.places.iter().map(|p| p.origin).collect()
}

type Packer = fn(&[Piece], u32, u32) -> Option<Packed>;

#[test]
fn one_chart_fills_its_texture_and_two_keep_their_gutters() {
    let one = pack_free(&full(&[(30, 20)]), 8192).unwrap();
    assert_eq!((u64::from(one.width) * u64::from(one.height), origins(&one)), (600, vec![(0, 0)]));
    for packer in [skyline::pack as Packer, shelves::pack] {
        let two = full(&[(10, 10), (10, 10)]);
        let beside = packer(&two, 24, 10).unwrap();
        assert_eq!((origins(&beside), beside.width), (vec![(0, 0), (14, 0)], 24));
        assert_eq!(packer(&two, 23, 10), None);
        assert_eq!(origins(&packer(&two, 23, 24).unwrap()), [(0, 0), (0, 14)]);
    }
}

#[test]
fn wide_charts_begin_at_tiles_where_that_is_cheap() {
    for packer in [skyline::pack as Packer, shelves::pack] {
        let at = |sizes: &[(u32, u32)], width: u32| origins(&packer(&full(sizes), width, 60).unwrap())[1];
        assert_eq!(at(&[(60, 60), (50, 60)], 114), (64, 0));
        assert_eq!(at(&[(59, 60), (59, 60)], 126), (64, 0));
        assert_eq!(at(&[(60, 60), (60, 60)], 124), (64, 0));
        assert_eq!(at(&[(59, 59), (59, 59)], 122), (63, 0), "no room to align");
    }
}

#[test]
fn a_long_piece_is_turned_to_fit_and_tips_sink_between_each_other() {
    let turned = skyline::pack(&full(&[(40, 5)]), 10, 60).unwrap();
    assert_eq!((turned.places[0].turns % 2, turned.width, turned.height), (1, 5, 40));
    // Two right triangles of 40 x 40 texels: the second lies upside down on the slope of the first.
    let slope: Vec<(u16, u16)> = (0..40).map(|k| (0, 40 - k)).collect();
    let triangle = Piece { size: (40, 40), outline: Some([slope.clone(), slope]) };
    let packed = skyline::pack(&[triangle.clone(), triangle], 48, 100).unwrap();
    assert!(packed.height <= 56, "{packed:?}");
}

/// The taken texels of a piece in its place.
fn cells(piece: &Piece, place: Place) -> Vec<(i64, i64)> {
    let (w, h) = (i64::from(piece.size.0), i64::from(piece.size.1));
    let column = |x: i64| piece.outline.as_ref().map_or(0..h, |o| i64::from(o[0][x as usize].0)..i64::from(o[0][x as usize].1));
    let turned = |x: i64, y: i64| match place.turns {
        0 => (x, y),
        1 => (h - 1 - y, x),
        2 => (w - 1 - x, h - 1 - y),
        _ => (y, w - 1 - x),
    };
    let at = |(x, y): (i64, i64)| (x + i64::from(place.origin.0), y + i64::from(place.origin.1));
    (0..w).flat_map(|x| column(x).map(move |y| at(turned(x, y)))).collect()
}

/// A slanted bar across a box.
fn bar(width: u32, height: u32) -> Piece {
    let column = |k: u32| ((k * height / width) as u16, (((k + 1) * height).div_ceil(width) + 1).min(height) as u16);
    let columns: Vec<(u16, u16)> = (0..width).map(column).collect();
    let row = |y: u16| {
        let taken = || columns.iter().enumerate().filter(|(_, (low, high))| (*low..*high).contains(&y)).map(|(x, _)| x as u16);
        (taken().min().unwrap(), taken().max().unwrap() + 1)
    };
    let rows = (0..height as u16).map(row).collect();
    Piece { size: (width, height), outline: Some([columns, rows]) }
}

proptest! {
    #[test]
    fn pieces_stay_inside_and_apart(
        sizes in prop::collection::vec((1u32..60, 1u32..60, any::<bool>()), 1..40),
        free in any::<bool>(),
        shelves in any::<bool>(),
        width in 90u32..300,
    ) {
        let pieces: Vec<Piece> = sizes.iter().map(|(w, h, slanted)| if *slanted { bar(*w, *h) } else { Piece::full(*w, *h) }).collect();
        let packer: Packer = if shelves { shelves::pack } else { skyline::pack };
        let packed = if free { pack_free(&pieces, 8192) } else { packer(&pieces, width, 100_000) }.unwrap();
        prop_assert!(free || packed.width <= width);
        let (w, h) = (i64::from(packed.width), i64::from(packed.height));
        let mut owner = vec![usize::MAX; (w * h) as usize];
        for (i, (piece, place)) in pieces.iter().zip(&packed.places).enumerate() {
            for (x, y) in cells(piece, *place) {
                prop_assert!((0..w).contains(&x) && (0..h).contains(&y), "{x}, {y} of {w}x{h}");
                owner[(y * w + x) as usize] = i;
            }
        }
        for (i, (piece, place)) in pieces.iter().zip(&packed.places).enumerate() {
            for (x, y) in cells(piece, *place) {
                let gap = GAP as i64;
                for ny in (y - gap).max(0)..=(y + gap).min(h - 1) {
                    for nx in (x - gap).max(0)..=(x + gap).min(w - 1) {
                        let other = owner[(ny * w + nx) as usize];
                        prop_assert!(other == i || other == usize::MAX, "{i} and {other} at {nx}, {ny}");
                    }
                }
            }
        }
    }
}
