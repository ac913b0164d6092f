use super::*;
use proptest::prelude::*;

fn order(walk: Walk) -> Order {
    Order::new(SphericalGrid::new(3, 4).unwrap(), walk)
}

fn kept(depth: u16, v: u8) -> Kept {
    Kept { depth, rgb: [v, v / 2, 255 - v] }
}

#[test]
fn values_between_corners_round_half_up() {
    assert_eq!(between([0, 10, 255], [1, 13, 0], 1, 2), [1, 12, 128]);
    assert_eq!(between([5, 5, 5], [4, 8, 255], 1, 3), [5, 6, 88]);
    assert_eq!((between([7; 3], [9; 3], 0, 5), between([7; 3], [9; 3], 5, 5)), ([7; 3], [9; 3]));
}

#[test]
fn rows_that_are_none_are_refused_with_the_reason() {
    let o = order(Walk::Theta); // visits 0, 4, 8, 1, 5, 9, …, 3, 7, 11
    assert_eq!(check_row(&[kept(0, 1), kept(8, 2), kept(1, 3), kept(11, 4)], &o), Ok(()));
    assert_eq!(check_row(&[kept(0, 1), kept(1, 2), kept(8, 3), kept(11, 4)], &o), Err(BadRow::Order { at: 2 }));
    assert_eq!(check_row(&[kept(0, 1), kept(0, 1), kept(11, 4)], &o), Err(BadRow::Order { at: 1 }));
    assert_eq!(check_row(&[kept(4, 1), kept(11, 4)], &o), Err(BadRow::Ends));
    assert_eq!(check_row(&[kept(0, 1), kept(7, 4)], &o), Err(BadRow::Ends));
    assert_eq!(check_row(&[], &o), Err(BadRow::Ends));
    assert_eq!(check_row(&[kept(0, 1), kept(12, 4)], &o), Err(BadRow::Depth { at: 1, depth: 12, directions: 12 }));
}

#[test]
fn statistics_follow_their_definitions() {
    let mut stats = ErrorStats::default();
    let original = vec![[10, 10, 10]; 2000];
    let mut decoded = original.clone();
    decoded[0] = [13, 10, 9]; // error 3, sum 4
    decoded[1] = [10, 11, 10]; // error 1, sum 1
    decoded[2] = [10, 11, 10];
    stats.measure(&original, &decoded);
    assert_eq!((stats.samples(), stats.differing(), stats.sum(), stats.max(), stats.p99_9()), (2000, 3, 6, 3, 1));
    assert_eq!((stats.average(), stats.average_differing()), (6.0 / 6000.0, 6.0 / 9.0));
    let parts: Vec<_> = stats.counts().collect();
    assert_eq!(ErrorStats::from_parts(&parts, 6, 2000).as_ref(), Ok(&stats));
    assert!(ErrorStats::from_parts(&parts, 6, 1999).is_err() && ErrorStats::from_parts(&parts, 4, 2000).is_err());
    assert!(ErrorStats::from_parts(&parts, 16, 2000).is_err() && ErrorStats::from_parts(&[(0, u64::MAX), (1, 2)], 2, 1).is_err());
    let mut twice = stats.clone();
    twice.add(&stats);
    assert_eq!((twice.samples(), twice.sum(), twice.average()), (4000, 12, stats.average()));
    assert_eq!((ErrorStats::default().average(), ErrorStats::default().p99_9()), (0.0, 0));
}

proptest! {
    /// One lookup by binary search and the whole row agree, in both walks, and kept samples come back as they are.
    #[test]
    fn one_lookup_is_one_value_of_the_row(
        picks in prop::collection::btree_map(1usize..11, any::<Sample>(), 0..10), ends in any::<[Sample; 2]>(), theta in any::<bool>(),
    ) {
        let o = order(if theta { Walk::Theta } else { Walk::Phi });
        let mut row = vec![Kept { depth: o.depth(0), rgb: ends[0] }];
        row.extend(picks.iter().map(|(step, rgb)| Kept { depth: o.depth(*step), rgb: *rgb }));
        row.push(Kept { depth: o.depth(11), rgb: ends[1] });
        let mut out = vec![[0; 3]; 12];
        decode_row(&row, &o, &mut out).unwrap();
        for depth in 0..12u16 {
            prop_assert_eq!(sample_at(&row, &o, depth), Some(out[usize::from(depth)]));
        }
        prop_assert!(row.iter().all(|k| out[usize::from(k.depth)] == k.rgb));
        prop_assert_eq!(sample_at(&row, &o, 12), None);
    }

    /// The integer form is the formula: floor(a + (b - a) t + 1/2), here in exact rationals.
    #[test]
    fn between_is_the_formula(a in any::<u8>(), b in any::<u8>(), length in 1usize..4096, t in 0usize..4096) {
        let t = t % (length + 1);
        let (n, d) = (2 * i64::from(a) * length as i64 + 2 * (i64::from(b) - i64::from(a)) * t as i64 + length as i64, 2 * length as i64);
        prop_assert_eq!(i64::from(between([a; 3], [b; 3], t, length)[0]), n.div_euclid(d));
    }
}
