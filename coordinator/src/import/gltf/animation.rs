//! Animations at one moment: they overwrite what nodes say of themselves, one animation after the other in the order of the file.
//!
//! Of each sampler only the two key frames around the moment are read. Before the first and behind the last the value stays (glTF 2.0,
//! section 3.11). Without a time nothing happens: the rest pose.

use super::{
    accessor::{Accessor, Accessors},
    form::{ANIMATED_TURN, ANIMATED_WEIGHT, PLACE, TIME, of_form},
    json::Json,
    local::{Local, unit},
    node::Graph,
    report::Report,
};
use crate::import::slerp;
use glam::{DQuat, DVec3};
use std::collections::BTreeSet;

/// Weights of morph targets that are computed in any file, and the bytes of the buffers that each further one takes: those of an honest
/// channel have their own values there.
const WEIGHTS: u64 = 1 << 20;
const BYTES_PER_WEIGHT: u64 = 4;

/// How values between key frames come about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// A checked sampler.
struct Sampler<'s, 'd, 'j> {
    times: &'s Accessor<'d>,
    values: &'s Accessor<'d>,
    /// What names the values.
    output: Json<'j>,
    interpolation: Interpolation,
}

/// A moment within a sampler: the key frames around it, how far between them it is, and the seconds between them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moment {
    before: usize,
    after: usize,
    share: f64,
    seconds: f64,
}

/// What animations move, and when.
struct Player<'s, 'g, 'd, 'b> {
    graph: &'s mut Graph<'g>,
    accessors: &'s Accessors<'d, 'b>,
    time: Option<f64>,
    /// Weights of morph targets that may still be computed.
    left: u64,
}

/// Checks all animations, and applies them where there is a time.
pub(super) fn apply(root: Json<'_>, graph: &mut Graph<'_>, accessors: &Accessors<'_, '_>, time: Option<f64>, report: &mut Report<'_>) {
    let animations = report.objects(root, "animations");
    if let (Some(first), None) = (animations.first(), time) {
        let message =
            format!("the file has {} animations; the rest pose is imported (a time in seconds chooses another)", animations.len());
        report.warn(*first, message);
    }
    let left = WEIGHTS.saturating_add(accessors.buffers.total() / BYTES_PER_WEIGHT);
    let mut player = Player { graph, accessors, time, left };
    for animation in animations {
        let samplers: Vec<Option<Sampler<'_, '_, '_>>> =
            report.objects(animation, "samplers").into_iter().map(|json| sampler(json, accessors, report)).collect();
        let mut targets = BTreeSet::new();
        for channel in report.objects(animation, "channels") {
            let index = report.required(channel, "sampler").and_then(|at| report.index_at(at, "sampler", samplers.len()));
            let target = report.required(channel, "target");
            if let (Some(Some(sampler)), Some(target)) = (index.map(|i| &samplers[i]), target) {
                let key = (target.get("node").and_then(Json::number).map(f64::to_bits), target.get("path").and_then(Json::string));
                if !targets.insert(key) {
                    report.count(channel, "channels of one animation move the same thing as another; the last one counts");
                }
                player.channel(target, sampler, report);
            }
        }
    }
}

fn sampler<'s, 'd, 'j>(json: Json<'j>, accessors: &'s Accessors<'d, '_>, report: &mut Report<'_>) -> Option<Sampler<'s, 'd, 'j>> {
    let (input, output) = (report.required(json, "input"), report.required(json, "output"));
    let interpolation = match report.string(json, "interpolation").as_deref() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(other) => {
            report.error(json, format!("`{other}` is no interpolation; there are LINEAR, STEP and CUBICSPLINE"));
            return None;
        }
    };
    let (input, output) = (input?, output?);
    let (times, values) = (of_form(input, &TIME, None, accessors, report)?, accessors.at(output, report)?);
    if !times.has_bounds {
        report.count(input, "times of key frames without `min` and `max`, which glTF wants (computed)");
    }
    let time = |i: usize| times.get::<1>(&accessors.buffers, i)[0];
    if let Some(i) = if time(0) < 0.0 { Some(0) } else { times.stalls() } {
        report.error(input, format!("time {i} is {}; times must be 0 or more and rise", time(i)));
        return None;
    }
    Some(Sampler { times, values, output, interpolation })
}

impl Player<'_, '_, '_, '_> {
    /// Checks what a channel moves, and moves it where there is a time.
    fn channel(&mut self, target: Json<'_>, sampler: &Sampler<'_, '_, '_>, report: &mut Report<'_>) {
        let path = report.string(target, "path").unwrap_or_default();
        if path == "pointer" || target.extension("KHR_animation_pointer").is_some() {
            report.count(target, "animations of other things than nodes (KHR_animation_pointer) were skipped");
            return;
        }
        let Some(index) = report.index(target, "node", "node", self.graph.nodes.len()) else { return };
        let Some(width) = sampler.width(target, &path, report) else { return };
        let node = &mut self.graph.nodes[index];
        if path != "weights" && node.has_matrix() {
            return report.error(target, format!("node {index} has a `matrix`, so its {path} cannot be animated"));
        }
        let Some(time) = self.time else { return };
        let moment = sampler.moment(self.accessors, time);
        let value = |k: usize| -> [f64; 4] { sampler.value(self.accessors, moment, width, k, path == "rotation") };
        if path == "weights" {
            let Some(left) = self.left.checked_sub(width as u64) else {
                return report.error(target, format!("with its {width} weights the channels have more than are computed in such a file"));
            };
            self.left = left;
            node.weights = Some((0..width).map(|k| value(k)[0]).collect());
            return;
        }
        match (path.as_ref(), node.local()) {
            ("translation", Local::Parts { translation, .. }) => *translation = DVec3::from_slice(&value(0)),
            ("scale", Local::Parts { scale, .. }) => *scale = DVec3::from_slice(&value(0)),
            ("rotation", Local::Parts { rotation, .. }) => *rotation = unit(DQuat::from_array(value(0))),
            _ => {}
        }
    }
}

impl Sampler<'_, '_, '_> {
    /// Values per key frame and target.
    fn keys(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// How many values of this path each key frame has; `None` where they do not fit it.
    fn width(&self, target: Json<'_>, path: &str, report: &mut Report<'_>) -> Option<usize> {
        let (form, width) = match path {
            "translation" | "scale" => (&PLACE, 1),
            "rotation" => (&ANIMATED_TURN, 1),
            "weights" => (&ANIMATED_WEIGHT, (self.values.count / self.times.count / self.keys()).max(1)),
            other => {
                report.error(target, format!("`{other}` cannot be animated; translation, rotation, scale and weights can"));
                return None;
            }
        };
        if !form.allows(self.values, self.output, report) {
            return None;
        }
        let (wanted, count, kind) = (self.times.count * self.keys() * width, self.values.count, self.values.kind());
        if count != wanted {
            report.error(target, format!("{wanted} values of type {kind} are expected for `{path}`; there are {count}"));
            return None;
        }
        Some(width)
    }

    fn moment(&self, accessors: &Accessors<'_, '_>, time: f64) -> Moment {
        let at = |i: usize| self.times.get::<1>(&accessors.buffers, i)[0];
        // The first key frame behind the moment, by bisection: times rise.
        let (mut low, mut high) = (0, self.times.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if at(middle) <= time { low = middle + 1 } else { high = middle }
        }
        let before = low.saturating_sub(1);
        let after = low.min(self.times.count - 1);
        let seconds = at(after) - at(before);
        let share = if seconds > 0.0 { ((time - at(before)) / seconds).clamp(0.0, 1.0) } else { 0.0 };
        Moment { before, after, share, seconds }
    }

    /// Value `k` of `width` at a moment.
    fn value(&self, accessors: &Accessors<'_, '_>, at: Moment, width: usize, k: usize, is_rotation: bool) -> [f64; 4] {
        let read = |i: usize| self.values.get::<4>(&accessors.buffers, i);
        if self.interpolation == Interpolation::CubicSpline {
            // In-tangents, values and out-tangents of a key frame follow each other.
            let key = |frame: usize, part: usize| read((frame * 3 + part) * width + k);
            let (t, d) = (at.share, at.seconds);
            let (t2, t3) = (t * t, t * t * t);
            let weights = [2.0 * t3 - 3.0 * t2 + 1.0, d * (t3 - 2.0 * t2 + t), -2.0 * t3 + 3.0 * t2, d * (t3 - t2)];
            let points = [key(at.before, 1), key(at.before, 2), key(at.after, 1), key(at.after, 0)];
            return std::array::from_fn(|c| weights.iter().zip(&points).map(|(w, p)| w * p[c]).sum());
        }
        let (a, b) = (read(at.before * width + k), read(at.after * width + k));
        match self.interpolation {
            Interpolation::Step if at.share < 1.0 => a,
            Interpolation::Step => b,
            _ if is_rotation => slerp::shortest(unit(DQuat::from_array(a)).to_array(), unit(DQuat::from_array(b)).to_array(), at.share),
            _ => std::array::from_fn(|c| a[c] + (b[c] - a[c]) * at.share),
        }
    }
}
