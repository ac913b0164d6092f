//! Answers to single questions: the bake's own estimator at a given point of a surface, toward a given direction, with its standard error.
//!
//! Samples are drawn exactly as for a texel of the grid's directions, at the point alone; the only difference is the direction that the
//! result is evaluated for. Repeats use seeds of their own, and their spread is the standard error.

use crate::{
    capture::Points,
    capture::hemisphere::{Budget, Scratch, Views, capture},
    capture::site::Site,
    sampling::TexelKey,
    scene::BakeScene,
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    frame::{Frame, FrameRule, corner_normals},
    settings::BakeSettings,
    texel::SurfacePoint,
    units::Rgb,
};
use rayon::prelude::*;

/// How far from its surface a position may lie, relative to the scene's largest extent.
const NEAR: f64 = 1e-3;

/// A question: what leaves this point toward this direction?
#[derive(Debug, Clone, PartialEq)]
pub struct Query {
    /// Name of the surface.
    pub surface: String,
    /// World position, metres; the nearest point of the surface answers.
    pub position: Vec3,
    /// World direction from the surface to the viewer, of any length.
    pub direction: Vec3,
}

/// Outgoing radiance with its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Mean over the repeats, W/(sr m²).
    pub radiance: Rgb,
    /// Standard error of that mean, W/(sr m²); infinite for a single repeat, which says nothing of its spread.
    pub stderr: Rgb,
}

/// Why a question has no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum QueryError {
    /// No such surface.
    #[error("the scene has no surface `{name}`")]
    NoSurface {
        /// The name asked for.
        name: String,
    },
    /// A position beside the surface.
    #[error("the position is {distance} m away from `{name}`; at most {allowed} m is taken as on it")]
    TooFar {
        /// The surface.
        name: String,
        /// Distance to its nearest triangle.
        distance: f64,
        /// What is allowed.
        allowed: f64,
    },
    /// A direction without length, or numbers that are not finite.
    #[error("position and direction must be finite, and the direction not zero")]
    NotADirection,
}

/// Answers queries in their order, in parallel on the current thread pool. Directions below the horizon are black.
#[must_use]
pub fn evaluate(scene: &BakeScene, queries: &[Query], settings: &BakeSettings, repeats: u32) -> Vec<Result<Answer, QueryError>> {
    let grid = settings.directions.directions();
    queries.par_iter().map_init(Scratch::default, |scratch, query| answer(scene, query, settings, &grid, repeats.max(1), scratch)).collect()
}

fn answer(
    scene: &BakeScene,
    query: &Query,
    settings: &BakeSettings,
    grid: &[Vec3],
    repeats: u32,
    scratch: &mut Scratch,
) -> Result<Answer, QueryError> {
    let toward = query.direction.try_normalize().filter(|_| query.position.is_finite()).ok_or(QueryError::NotADirection)?;
    let (surface, point) = locate(scene, query)?;
    let frame = frame_at(scene, surface, &point, settings.frame);
    let wo = frame.to_local(toward);
    if wo.z <= 0.0 {
        return Ok(Answer { radiance: Rgb::BLACK, stderr: Rgb::BLACK });
    }
    let views = Views::toward(grid, &[wo]);
    let budget = Budget { samples: settings.samples, max_depth: settings.max_depth };
    let mut moments = Moments::default();
    for repeat in 0..repeats {
        // Named by its position: queries of one texel share their samples, as its directions do in a bake.
        let key = TexelKey::new(settings.seed.wrapping_add(u64::from(repeat)), surface as u32, name_of(query.position));
        let site = Site { surface, frame, points: Points::Fixed(point), key };
        let mut out = [Rgb::BLACK];
        capture(scene, &site, budget, &views, scratch, &mut out);
        moments.add(out[0]);
    }
    Ok(moments.answer())
}

/// The frame at a point. There is no layout here, so the tangent is that of the triangle in the author's coordinates: it only turns the
/// grid of directions that the samples are drawn for, never what is asked.
fn frame_at(scene: &BakeScene, surface: usize, point: &SurfacePoint, rule: FrameRule) -> Frame {
    let (canonical, triangle) = (scene.scene(), point.triangle as usize);
    let of = &canonical.surfaces[surface];
    let uv = of.uv(0, triangle).unwrap_or_default().map(|c| c.map(f64::from));
    let flat = Frame::of_triangle(canonical.corners(&of.triangles[triangle]), uv, rule)
        .unwrap_or(scene.prim(scene.prim_of(surface, point.triangle)).frame);
    let Some([a, b, c]) = corner_normals(canonical, of, triangle) else { return flat };
    let [second, third] = point.bary.map(f64::from);
    let normal = (a * (1.0 - second - third) + b * second + c * third).normalize();
    if rule == FrameRule::Thesis { Frame::thesis(normal) } else { Frame::oriented(normal, flat.tangent.as_dvec3()) }
}

/// A 64-bit name of a position.
fn name_of(position: Vec3) -> u64 {
    position.to_array().iter().fold(0, |h, v| crate::sampling::sequence::mix(h ^ u64::from(v.to_bits())))
}

/// Running mean and squared deviation (Welford 1962), in f64.
#[derive(Default)]
struct Moments {
    count: f64,
    mean: [f64; 3],
    squared: [f64; 3],
}

impl Moments {
    fn add(&mut self, value: Rgb) {
        self.count += 1.0;
        for (c, v) in value.to_array().into_iter().enumerate() {
            let off = f64::from(v) - self.mean[c];
            self.mean[c] += off / self.count;
            self.squared[c] += off * (f64::from(v) - self.mean[c]);
        }
    }

    fn answer(&self) -> Answer {
        let spread = |s: f64| if self.count > 1.0 { (s / (self.count * (self.count - 1.0))).sqrt() as f32 } else { f32::INFINITY };
        Answer { radiance: Rgb::from(self.mean.map(|m| m as f32)), stderr: Rgb::from(self.squared.map(spread)) }
    }
}

/// The surface and the point of its nearest triangle.
fn locate(scene: &BakeScene, query: &Query) -> Result<(usize, SurfacePoint), QueryError> {
    let canonical = scene.scene();
    let (index, surface) = canonical.surface(&query.surface).ok_or_else(|| QueryError::NoSurface { name: query.surface.clone() })?;
    let at = query.position.as_dvec3();
    let nearest = surface.triangles.iter().enumerate().map(|(t, triangle)| {
        let corners = canonical.corners(triangle);
        let bary = nearest_point(at, corners);
        let position = corners[0] * (1.0 - bary[0] - bary[1]) + corners[1] * bary[0] + corners[2] * bary[1];
        (position.distance(at), t as u32, bary, position)
    });
    let (low, high) = canonical.bounds();
    let allowed = NEAR * (0..3).map(|a| f64::from(high[a] - low[a])).fold(0.0, f64::max);
    let best = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
    let (distance, triangle, bary, position) = best.unwrap_or((f64::INFINITY, 0, [0.0; 2], at));
    if distance > allowed {
        return Err(QueryError::TooFar { name: query.surface.clone(), distance, allowed });
    }
    Ok((index, SurfacePoint { triangle, bary: bary.map(|b| b as f32), position: position.as_vec3() }))
}

/// Barycentric weights (second and third corner) of the point of a triangle nearest to `p` (Ericson, "Real-Time Collision Detection",
/// 5.1.5).
fn nearest_point(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 2] {
    let (ab, ac) = (b - a, c - a);
    let along = |from: DVec3| (ab.dot(p - from), ac.dot(p - from));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 1.0];
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return [d1 / (d1 - d3), 0.0];
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return [0.0, d2 / (d2 - d6)];
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [1.0 - w, w];
    }
    let sum = va + vb + vc;
    [vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        simd::Simd,
        testing::{closed_box, lambert, settings},
    };

    fn ask(surface: &str, position: [f32; 3], direction: [f32; 3], repeats: u32) -> Result<Answer, QueryError> {
        let scene = BakeScene::new(closed_box(2.0, &lambert(0.5, 0.5)), Simd::Auto).unwrap();
        let query = Query { surface: surface.into(), position: position.into(), direction: direction.into() };
        evaluate(&scene, &[query], &settings(r#"{"samples":64,"max_depth":20}"#), repeats).remove(0)
    }

    #[test]
    fn an_answer_comes_with_an_honest_error() {
        let answer = ask("wall0", [0.4, 0.0, 0.3], [0.1, 2.0, 0.3], 16).unwrap();
        assert!((answer.radiance.g - 1.0).abs() < 5.0 * answer.stderr.g + 1e-4, "{answer:?}");
        assert!(answer.stderr.g > 0.0 && answer.stderr.g < 0.02, "{answer:?}");
        assert_eq!(ask("wall0", [0.4, 0.0, 0.3], [0.0, 1.0, 0.0], 1).unwrap().stderr.r, f32::INFINITY);
    }

    #[test]
    fn directions_below_the_horizon_are_black() {
        let answer = ask("wall0", [0.4, 0.0, 0.3], [0.1, -1.0, 0.0], 4).unwrap();
        assert_eq!((answer.radiance, answer.stderr), (Rgb::BLACK, Rgb::BLACK));
    }

    #[test]
    fn questions_without_an_answer_say_why() {
        assert_eq!(ask("roof", [0.0; 3], [0.0, 1.0, 0.0], 2), Err(QueryError::NoSurface { name: "roof".into() }));
        assert!(matches!(ask("wall0", [0.4, 0.01, 0.3], [0.0, 1.0, 0.0], 2), Err(QueryError::TooFar { .. })));
        assert!(ask("wall0", [0.4, 0.001, 0.3], [0.0, 1.0, 0.0], 2).is_ok(), "within a thousandth of the scene");
        assert_eq!(ask("wall0", [0.4, 0.0, 0.3], [0.0; 3], 2), Err(QueryError::NotADirection));
        assert_eq!(ask("wall0", [f32::NAN, 0.0, 0.3], [0.0, 1.0, 0.0], 2), Err(QueryError::NotADirection));
    }

    #[test]
    fn the_nearest_point_of_a_triangle_is_found_in_every_region() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |x: f64, y: f64| nearest_point(DVec3::new(x, y, 0.7), t);
        assert_eq!([at(-1.0, -1.0), at(3.0, -1.0), at(-1.0, 3.0)], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!([at(0.25, -1.0), at(-1.0, 0.25), at(1.0, 1.0)], [[0.25, 0.0], [0.0, 0.25], [0.5, 0.5]]);
        assert_eq!(at(0.25, 0.5), [0.25, 0.5]);
    }
}
