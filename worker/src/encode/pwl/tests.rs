use super::*;
use kiln_proto::codec::pwl::between;
use proptest::prelude::*;

/// What a decoder makes of corners.
fn decode(corners: &[Corner]) -> Vec<Sample> {
    let mut out = vec![corners[0].rgb];
    for pair in corners.windows(2) {
        let length = pair[1].step - pair[0].step;
        out.extend((1..=length).map(|t| between(pair[0].rgb, pair[1].rgb, t, length)));
    }
    out
}

fn errors(x: &[Sample], corners: &[Corner]) -> Vec<[i32; 3]> {
    x.iter().zip(decode(corners)).map(|(a, b)| difference(b, *a).map(i32::abs)).collect()
}

fn steps(corners: &[Corner]) -> Vec<usize> {
    corners.iter().map(|c| c.step).collect()
}

fn grey(values: &[u8]) -> Vec<Sample> {
    values.iter().map(|v| [*v; 3]).collect()
}

/// Random, constant, spiky, saturated and smooth texels.
fn texels() -> impl Strategy<Value = Vec<Sample>> {
    let noise = prop::collection::vec(any::<Sample>(), 2..130);
    let constant = (any::<Sample>(), 2usize..130).prop_map(|(v, n)| vec![v; n]);
    let spiky = (any::<Sample>(), prop::collection::vec(prop_oneof![9 => Just(None), 1 => any::<Sample>().prop_map(Some)], 2..130))
        .prop_map(|(base, spikes)| spikes.into_iter().map(|s| s.unwrap_or(base)).collect());
    let saturated = prop::collection::vec(prop_oneof![Just([255, 255, 255]), Just([0, 0, 0]), Just([255, 254, 1])], 2..130);
    let smooth = (prop::collection::vec((-3i32..4, -3i32..4, 0i32..2), 2..400), any::<Sample>()).prop_map(|(rises, start)| {
        let mut at = start.map(i32::from);
        let mut next = |(r, g, b): (i32, i32, i32)| {
            at = [at[0] + r, at[1] + g, at[2] + b].map(|v| v.clamp(0, 255));
            at.map(|v| v as u8)
        };
        rises.into_iter().map(&mut next).collect()
    });
    prop_oneof![noise, constant, spiky, saturated, smooth]
}

fn rules() -> impl Strategy<Value = Rule> {
    prop_oneof![
        (0u16..40).prop_map(|threshold| Rule::Thesis { threshold }),
        (0u16..40).prop_map(|threshold| Rule::Cumulative { threshold }),
        prop_oneof![0u8..8, Just(255)].prop_map(|eps| Rule::Bounded { eps }),
    ]
}

#[test]
fn the_thesis_rule_keeps_where_its_pseudo_code_does() {
    let t6 = |values: &[u8]| steps(&pick(&grey(values), Rule::Thesis { threshold: 6 }));
    assert_eq!(t6(&[10, 11, 12, 13, 14]), [0, 4]);
    // The slope changes by 2 in each of three channels: the sum is 6.
    assert_eq!(t6(&[10, 11, 14, 17, 20]), [0, 1, 4]);
    // By 1 in each: the sum is 3 and no channel reaches T/2; the slope stays anchored at 1, so the next change counts from there.
    assert_eq!(t6(&[10, 11, 13, 16, 19]), [0, 2, 4]);
    // A change of sign is a corner however small.
    assert_eq!(t6(&[10, 11, 10, 9, 8]), [0, 1, 4]);
    // One channel alone reaches T/2 = 3.
    let one = [[5, 9, 9], [5, 9, 9], [8, 9, 9], [11, 9, 9]];
    assert_eq!(steps(&pick(&one, Rule::Thesis { threshold: 6 })), [0, 1, 3]);
}

#[test]
fn the_cumulative_rule_finds_the_longest_segment_even_past_one_that_fails() {
    // To step 4 the line passes step 3 with an error of 4 a channel; to step 5 none is off by more than 2.
    let x = grey(&[10, 10, 10, 8, 12, 10]);
    assert_eq!(steps(&pick(&x, Rule::Cumulative { threshold: 7 })), [0, 5]);
    assert_eq!(steps(&pick(&x[..5], Rule::Cumulative { threshold: 7 })), [0, 3, 4]);
    assert_eq!(steps(&pick(&x, Rule::Cumulative { threshold: 0 })), [0, 2, 3, 4, 5]);
}

#[test]
fn a_bounded_ramp_with_noise_within_eps_is_one_segment() {
    let x: Vec<u8> = (0..100u8).map(|k| k + [0, 2, 1, 0, 2][usize::from(k) % 5]).collect();
    assert_eq!(steps(&pick(&grey(&x), Rule::Bounded { eps: 2 })), [0, 99]);
    assert_eq!(pick(&grey(&[7; 50]), Rule::Bounded { eps: 0 }).len(), 2);
}

/// The cumulative rule the slow way: every length, no cone.
fn cumulative_oracle(x: &[Sample], threshold: i32) -> Vec<usize> {
    let mut kept = vec![0];
    let mut from = 0;
    while from + 1 < x.len() {
        let holds = |to: usize| {
            (1..to - from).all(|t| {
                let e = difference(between(x[from], x[to], t, to - from), x[from + t]);
                e.iter().map(|v| v.abs()).sum::<i32>() < threshold.max(1)
            })
        };
        from = (from + 1..x.len()).rev().find(|to| holds(*to)).unwrap();
        kept.push(from);
    }
    kept
}

proptest! {
    #[test]
    fn first_and_last_are_kept_and_bounds_hold(x in texels(), rule in rules()) {
        let corners = pick(&x, rule);
        prop_assert_eq!((corners[0].step, corners[corners.len() - 1].step), (0, x.len() - 1));
        prop_assert!(corners.windows(2).all(|w| w[0].step < w[1].step));
        let errors = errors(&x, &corners);
        match rule {
            Rule::Thesis { threshold: 0 } => prop_assert!(errors.iter().all(|e| *e == [0; 3])),
            Rule::Thesis { .. } => prop_assert!(corners.iter().all(|c| c.rgb == x[c.step])),
            Rule::Cumulative { threshold } => {
                prop_assert!(corners.iter().all(|c| c.rgb == x[c.step]));
                prop_assert!(errors.iter().all(|e| e.iter().sum::<i32>() < i32::from(threshold).max(1)));
            }
            Rule::Bounded { eps } => prop_assert!(errors.iter().flatten().all(|e| *e <= i32::from(eps))),
        }
    }

    #[test]
    fn the_cone_rules_out_nothing_that_holds(x in texels(), threshold in 0u16..30) {
        let x = &x[..x.len().min(60)];
        prop_assert_eq!(steps(&pick(x, Rule::Cumulative { threshold })), cumulative_oracle(x, i32::from(threshold)));
    }

    /// Free corners never need more than a greedy choice among data samples does where that choice is one segment.
    #[test]
    fn a_line_within_eps_is_found(a in any::<Sample>(), b in any::<Sample>(), n in 2usize..200, eps in 0u8..4) {
        let x: Vec<Sample> = (0..n).map(|t| between(a, b, t, n - 1)).collect();
        prop_assert_eq!(pick(&x, Rule::Bounded { eps }).len(), 2);
    }
}
