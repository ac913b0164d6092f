use super::*;
use crate::package::fixture;
use kiln_proto::settings::{RawFormat, Rule};
use std::collections::BTreeSet;

fn decode(package: &Path, change: impl FnOnce(&mut Args)) -> Result<Vec<csv::StringRecord>, ToolError> {
    let mut args = Args { package: package.into(), out: "-".into(), surface: vec![], texels: None, seed: 0, from: Origin::Codec };
    change(&mut args);
    let mut out = vec![];
    run(&args, false, &mut out)?;
    let mut reader = csv::Reader::from_reader(&out[..]);
    assert_eq!(reader.headers().unwrap(), &COLUMNS[..]);
    Ok(reader.records().map(|r| r.unwrap()).collect())
}

fn texels(records: &[csv::StringRecord]) -> BTreeSet<(u32, u32)> {
    records.iter().map(|r| (r[1].parse().unwrap(), r[2].parse().unwrap())).collect()
}

fn values(record: &csv::StringRecord) -> Vec<f32> {
    record.iter().skip(3).map(|v| v.parse().unwrap()).collect()
}

#[test]
fn raw_radiance_comes_back_bit_by_bit_and_decoded_radiance_within_its_bound() {
    let dir = tempfile::tempdir().unwrap();
    fixture::bake(dir.path(), fixture::settings(Rule::Bounded { eps: 1 }, Some(RawFormat::F32)));
    let package = Package::open(dir.path()).unwrap();
    let (raster, exposure) = (package.raster(0), package.plan.exposure().factor());
    let raw = decode(dir.path(), |a| a.from = Origin::Raw).unwrap();
    let coded = decode(dir.path(), |_| {}).unwrap();
    assert_eq!((raw.len(), coded.len()), (35 * 33 * 24, 35 * 33 * 24), "the lamp is left out");
    for (a, b) in raw.iter().zip(&coded) {
        assert!(a.iter().take(14).eq(b.iter().take(14)) && &a[0] == "wall");
        let texel = raster.texel(a[1].parse().unwrap(), a[2].parse().unwrap()).unwrap();
        let v = values(a);
        let depth = (v[0] * 6.0 + v[1]) as u32;
        let toward = texel.frame.to_world(package.plan.settings.directions.direction(depth));
        assert_eq!(v[2..5], texel.position.to_array());
        assert_eq!((&v[5..8], &v[8..11]), (&[0.0, 0.0, 1.0][..], &toward.to_array()[..]));
        assert_eq!(v[11..], fixture::radiance(&texel, toward));
        for (raw, coded) in v[11..].iter().zip(&values(b)[11..]) {
            let byte = |v: f32| i32::from(kiln_proto::units::radiance_to_byte(v, exposure));
            assert!((byte(*raw) - byte(*coded)).abs() <= 1, "{raw} became {coded}");
        }
    }
}

#[test]
fn a_seed_chooses_texels_and_names_choose_surfaces() {
    let dir = tempfile::tempdir().unwrap();
    fixture::bake(dir.path(), fixture::settings(Rule::default(), None));
    let some = |seed| texels(&decode(dir.path(), |a| (a.texels, a.seed) = (Some(10), seed)).unwrap());
    assert_eq!((some(1).len(), some(1) == some(1), some(1) == some(2)), (10, true, false));
    let lamp = decode(dir.path(), |a| a.surface = vec!["lamp".into()]).unwrap();
    assert_eq!((lamp.len(), &lamp[0][0]), (40 * 24, "lamp"));
    assert_eq!(decode(dir.path(), |a| a.texels = Some(1 << 40)).unwrap().len(), 35 * 33 * 24);
    let unknown = decode(dir.path(), |a| a.surface = vec!["door".into()]).unwrap_err();
    assert!(unknown.is_usage() && unknown.to_string().contains("wall, lamp"));
    assert!(decode(dir.path(), |a| a.from = Origin::Raw).unwrap_err().to_string().contains("keeps no raw radiance"));
}

#[test]
fn damaged_files_are_not_decoded() {
    for (extension, from) in
        [("mtex", Origin::Raw), ("mtsp", Origin::Codec), ("mti", Origin::Codec), ("mtnc", Origin::Codec), ("mtm", Origin::Codec)]
    {
        let dir = tempfile::tempdir().unwrap();
        fixture::bake(dir.path(), fixture::settings(Rule::default(), Some(RawFormat::U8)));
        fixture::flip(&dir.path().join(format!("surfaces/wall.{extension}")));
        // One texel that need not be the damaged one: a file is whole or it is not used.
        let error = decode(dir.path(), |a| (a.texels, a.from) = (Some(1), from)).unwrap_err();
        let text = kiln_proto::chain(&error);
        assert!(text.contains(&format!("wall.{extension}")) && text.contains("checksum"), "{text}");
    }
}

/// Each thing is chosen about as often as the others: 2,000 choices of 3 in 10, within five sigma.
#[test]
fn every_texel_is_as_likely() {
    let mut counts = [0u32; 10];
    for seed in 0..2_000 {
        let mut pick = Pick::new(seed, 0, 3, 10);
        let chosen: Vec<usize> = (0..10).filter(|_| pick.next()).collect();
        assert_eq!(chosen.len(), 3);
        chosen.into_iter().for_each(|k| counts[k] += 1);
    }
    assert!(counts.iter().all(|n| n.abs_diff(600) < 103), "{counts:?}");
}
