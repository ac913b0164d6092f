//! The estimator against true radiance: a part of the queries in `make test`, all of them in `make soak` (`KILN_SOAK=1`).
//!
//! The reference values were computed with Mitsuba 3 at 16,384 samples a query with the BRDF of the light-transport documentation
//! (normalised modified Phong), at the nominal texel centres, depth 5.

use crate::harness::{scene, succeed};
use std::{collections::BTreeMap, path::Path};
use tempfile::TempDir;

/// Queries of each surface that the quick form looks at: its first ones.
const QUICK_QUERIES: usize = 100;

/// Sums over the queries of one texel, whose directions share their noise.
#[derive(Default)]
struct Texel {
    error: f64,
    truth: f64,
}

struct Row {
    surface: String,
    texel: (String, String),
    rgb: [f64; 3],
    se: [f64; 3],
}

fn rows(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let at = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (surface, tx, ty) = (at("surface"), at("tx"), at("ty"));
    let (rgb, se) = (["r", "g", "b"].map(at), ["se_r", "se_g", "se_b"].map(at));
    let row = |r: csv::StringRecord| Row {
        surface: r[surface].to_owned(),
        texel: (r[tx].to_owned(), r[ty].to_owned()),
        rgb: rgb.map(|k| r[k].parse().unwrap()),
        se: se.map(|k| r[k].parse().unwrap()),
    };
    reader.records().map(|r| row(r.unwrap())).collect()
}

/// The lines of `text` (a header and one query each) that the quick form asks: the first of every surface, so that none is left out.
fn first_of_every_surface(text: &str) -> Vec<&str> {
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let column = header.split(',').position(|h| h == "surface").unwrap();
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let chosen = lines.filter(|line| {
        let count = seen.entry(line.split(',').nth(column).unwrap()).or_default();
        *count += 1;
        *count <= QUICK_QUERIES
    });
    std::iter::once(header).chain(chosen).collect()
}

/// What the errors of a surface's texels add up to, and the standard deviation of that sum: the texels are independent, so it is the root
/// of n times the sample variance of their errors about their mean. About zero instead of the mean, a common bias would count as noise.
fn bias_and_sigma(errors: &[f64]) -> (f64, f64) {
    let n = errors.len() as f64;
    let sum: f64 = errors.iter().sum();
    let squared: f64 = errors.iter().map(|e| (e - sum / n) * (e - sum / n)).sum();
    (sum, (n / (n - 1.0) * squared).sqrt())
}

/// Bias per surface within 0.5 % or 3 sigma clustered by texel; mean of z^2 over lit channels within [0.8, 1.25] widened by what so few
/// queries may scatter; black exactly black.
fn compare(name: &str, obj: &str) {
    let dir = TempDir::new().unwrap();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/reference/{name}.csv"));
    let text = std::fs::read_to_string(source).unwrap();
    let (queries, answers) = (dir.path().join("queries.csv"), dir.path().join("answers.csv"));
    let soak = std::env::var_os("KILN_SOAK").is_some();
    let asked = if soak { text.lines().collect() } else { first_of_every_surface(&text) };
    let count = asked.len() - 1;
    std::fs::write(&queries, asked.join("\n")).unwrap();
    let flags = ["--samples", "1024", "--repeats", "16", "--max-depth", "5"];
    let paths = [scene(obj), queries.clone()].map(|p| p.display().to_string());
    succeed(["eval", &paths[0], &paths[1], "--out", answers.to_str().unwrap()].iter().chain(&flags));
    let (truth, ours) = (rows(&queries), rows(&answers));
    assert_eq!((truth.len(), ours.len()), (count, count));

    let (mut z2, mut channels) = (0.0, 0);
    let mut surfaces: BTreeMap<&str, BTreeMap<&(String, String), Texel>> = BTreeMap::new();
    for (t, o) in truth.iter().zip(&ours) {
        let texel = surfaces.entry(&t.surface).or_default().entry(&t.texel).or_default();
        for c in 0..3 {
            let sigma2 = t.se[c] * t.se[c] + o.se[c] * o.se[c];
            if t.rgb[c] == 0.0 && t.se[c] == 0.0 {
                assert_eq!(o.rgb[c], 0.0, "{name} {} {:?}: truly black", t.surface, t.texel);
            } else if sigma2 > 0.0 {
                let error = o.rgb[c] - t.rgb[c];
                z2 += error * error / sigma2;
                channels += 1;
            }
            texel.error += o.rgb[c] - t.rgb[c];
            texel.truth += t.rgb[c];
        }
    }
    let mean_z2 = z2 / f64::from(channels);
    println!("{name}: mean z^2 {mean_z2:.4} over {channels} channels");
    // Fewer queries scatter more about their mean.
    let range = if soak { 0.8..1.25 } else { 0.75..1.35 };
    assert!(range.contains(&mean_z2), "{name}: mean z^2 {mean_z2}");
    for (surface, texels) in surfaces {
        let total: f64 = texels.values().map(|t| t.truth).sum();
        let (error, sigma) = bias_and_sigma(&texels.values().map(|t| t.error).collect::<Vec<_>>());
        println!("{name} {surface}: bias {:+.3} %, sigma {:.3} %", 100.0 * error / total, 100.0 * sigma / total);
        let within = error.abs() <= 0.005 * total || error.abs() <= 3.0 * sigma;
        assert!(within, "{name} {surface}: bias {:+.3} % at {:.1} sigma", 100.0 * error / total, error / sigma);
    }
}

#[test]
fn the_room_of_the_thesis_has_its_true_radiance() {
    compare("thesis-room", "thesis-room/thesis.obj");
}

#[test]
fn the_cornell_room_has_its_true_radiance() {
    compare("cornell-room", "cornell-room/cornell.obj");
}

#[test]
fn a_common_bias_is_not_taken_for_noise() {
    let (bias, sigma) = bias_and_sigma(&[1.0, 1.1, 0.9, 1.0]);
    assert!(bias > 3.0 * sigma, "{bias} {sigma}");
    let (bias, sigma) = bias_and_sigma(&[1.0, -1.0, 1.0, -1.0]);
    assert!(bias.abs() < 1e-12 && (sigma - (16.0f64 / 3.0).sqrt()).abs() < 1e-12, "{bias} {sigma}");
}
