//! The lists of an OBJ text that its faces refer to: positions with colours, texture coordinates, normals.
//!
//! Colours are what tools put behind the position (`v x y z r g b`): the format has none, but MeshLab, ZBrush and Blender agree. They are
//! coded for the eye (sRGB), as these tools paint and write them; Blender turns its linear colours into sRGB to export them. Tools that
//! count from 0 to 255 give themselves away by a number above 1.

use super::polypaint::{self, Paint};
use crate::import::findings::{At, Findings};
use kiln_proto::math;

/// What is read into lists, in the order of the operands of a face's corner.
pub(super) const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

/// Numbers of a statement that are needed and that are looked at, in the order of [`KINDS`]. Behind a position stands its weight or its
/// colour, and something more is told; behind others what has no meaning here.
const NUMBERS: [(usize, usize); 3] = [(3, 8), (1, 2), (3, 3)];

/// Steps of 32-bit numbers that an extent must have for a shape to be told.
const STEPS: f64 = 32_768.0;

/// Stands for the colour of a vertex that has none until all are read: above any white.
const UNCOLOURED: [f32; 3] = [f32::INFINITY; 3];

/// The lists so far.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    /// Metres.
    pub(super) positions: Vec<[f32; 3]>,
    /// Colours of positions: as they are written until [`Vertices::finish`], then linear. Empty where all are white.
    pub(super) colours: Vec<[f32; 3]>,
    /// V up.
    pub(super) uvs: Vec<[f32; 2]>,
    /// Of any length.
    pub(super) normals: Vec<[f32; 3]>,
    /// The line of the first colour and how many there are.
    coloured: Option<(u32, usize)>,
}

impl Vertices {
    /// Lists with room for so many of each of [`KINDS`].
    pub(super) fn with_room(counts: [usize; 3]) -> Self {
        let [positions, uvs, normals] = counts;
        Self {
            positions: Vec::with_capacity(positions),
            uvs: Vec::with_capacity(uvs),
            normals: Vec::with_capacity(normals),
            ..Self::default()
        }
    }

    /// How many there are of each of [`KINDS`].
    pub(super) fn counts(&self) -> [i64; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()].map(|n| n as i64)
    }

    /// Reads `v`, `vt` or `vn`. A statement that is wrong takes its place in the list all the same, so that indices stay right.
    pub(super) fn statement(&mut self, word: &str, at: At<'_>, line: u32, rest: &str, findings: &mut Findings) {
        match word {
            "v" => self.position(at, line, rest, findings),
            "vt" if has_none(rest, 1) => {
                findings.count(at, "texture coordinates that are no numbers (nan) were taken as 0");
                self.uvs.push([0.0; 2]);
            }
            "vt" => self.uvs.push(padded(&numbers(at, rest, 1, findings))),
            // A normal without a length is what a face is shaded without.
            _ if has_none(rest, 2) => self.normals.push([0.0; 3]),
            _ => self.normals.push(padded(&numbers(at, rest, 2, findings))),
        }
    }

    /// `v x y z`, `v x y z w` or `v x y z r g b`.
    fn position(&mut self, at: At<'_>, line: u32, rest: &str, findings: &mut Findings) {
        let values = numbers(at, rest, 0, findings);
        if let [_, _, _, r, g, b, more @ ..] = values.as_slice() {
            if !more.is_empty() {
                findings.warn_once(at, "more", "numbers behind the colour of `v` were ignored");
            }
            if self.colours.is_empty() {
                self.colours.reserve_exact(self.positions.capacity());
            }
            self.colours.resize(self.positions.len(), UNCOLOURED);
            self.colours.push([*r, *g, *b]);
            self.coloured.get_or_insert((line, 0)).1 += 1;
        } else if values.get(3).is_some_and(|w| *w != 1.0) {
            findings.warn_once(at, "weight", "vertex weights (a fourth number behind `v`) were ignored");
        }
        self.positions.push(padded(&values));
    }

    /// Looks at the lists as a whole, once all are read, and makes the colours linear.
    pub(super) fn finish(&mut self, file: &str, findings: &mut Findings) {
        self.check_distance(file, findings);
        let Some((line, count)) = self.coloured else { return };
        let at = At::line(file, line);
        if count < self.positions.len() {
            findings
                .warn(at, format!("{} of {} vertices have no colour; they are white", self.positions.len() - count, self.positions.len()));
        }
        self.colours.resize(self.positions.len(), UNCOLOURED);
        let most = self.colours.iter().flatten().filter(|c| c.is_finite()).fold(0.0, |most: f32, c| most.max(*c));
        let unit = if most > 1.0 { 255.0 } else { 1.0 };
        if most > 1.0 {
            findings.warn(at, "vertex colours exceed 1, so they are taken to count from 0 to 255");
        }
        if most > unit || self.colours.iter().flatten().any(|c| *c < 0.0) {
            findings.warn(at, "vertex colours outside their range were clamped");
        }
        self.colours.iter_mut().flatten().for_each(|c| *c = math::srgb_eotf((*c / unit).clamp(0.0, 1.0)));
        if self.colours.iter().flatten().all(|c| *c == 1.0) {
            self.colours = vec![];
        }
    }
}

impl Vertices {
    /// Warns of a model so far from the origin that its shape is lost in the rounding of 32 bits, as surveys in map coordinates are.
    fn check_distance(&self, file: &str, findings: &mut Findings) {
        let bounds = |axis: usize| {
            let values = self.positions.iter().map(|p| p[axis]);
            values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let bounds = [0, 1, 2].map(bounds);
        let size = bounds.iter().map(|(low, high)| f64::from(*high) - f64::from(*low)).fold(0.0, f64::max);
        for ((low, high), axis) in bounds.into_iter().zip(["x", "y", "z"]) {
            let far = low.abs().max(high.abs());
            let step = f64::from(far.next_up()) - f64::from(far);
            if step * STEPS > size && size > 0.0 {
                let message = format!(
                    "along {axis} the vertices lie {far} from the origin, where numbers of 32 bits are {step} apart, and the model is {size} \
                     long: its shape suffers; move it to the origin before it is exported"
                );
                findings.warn(At::file(file), message);
            }
        }
    }

    /// Takes the colours that ZBrush writes into comments, where the vertices have none of their own.
    pub(super) fn paint(&mut self, file: &str, text: &str, findings: &mut Findings) {
        let vertices = self.positions.len();
        let paint = polypaint::read(file, text, vertices, findings).filter(|_| self.coloured.is_none());
        let Some(Paint { line, found, colours }) = paint else { return };
        if found > vertices {
            let message = format!("there are {found} colours of polypaint for {vertices} vertices; the last were ignored");
            findings.warn(At::line(file, line), message);
        }
        self.coloured = Some((line, found));
        self.colours = colours;
    }
}

/// Whether a number is none, in the words of C libraries: `nan`, `-nan(ind)`, `1.#QNAN`, `-1.#IND`.
fn has_none(rest: &str, kind: usize) -> bool {
    rest.split_whitespace().take(NUMBERS[kind].1).any(|word| {
        let word = word.trim_start_matches(['-', '+']);
        word.contains(".#") || word.get(..3).is_some_and(|head| head.eq_ignore_ascii_case("nan"))
    })
}

fn padded<const N: usize>(values: &[f32]) -> [f32; N] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

/// The operands, all of them finite numbers in 32 bits, as many as are needed; none after an error.
fn numbers(at: At<'_>, rest: &str, kind: usize, findings: &mut Findings) -> Vec<f32> {
    let (what, (least, most)) = (KINDS[kind], NUMBERS[kind]);
    let mut values = Vec::with_capacity(most);
    for word in rest.split_whitespace().take(most) {
        let shown = || word.chars().take(40).collect::<String>();
        match word.parse::<f32>() {
            // Adding zero turns -0.0 into 0.0.
            Ok(value) if value.is_finite() => values.push(value + 0.0),
            Ok(_) => {
                findings.error(at, format!("the {what} has the value `{}`, which is not finite in 32 bits", shown()));
                return vec![];
            }
            Err(_) => {
                let hint = if word.contains(',') { "; decimals have a point, not a comma" } else { "" };
                findings.error(at, format!("the {what} has `{}` where a number should be{hint}", shown()));
                return vec![];
            }
        }
    }
    if values.len() < least {
        findings.error(at, format!("the {what} has {} numbers; at least {least} are needed", values.len()));
        return vec![];
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> (Vertices, Vec<String>) {
        let (mut vertices, mut findings) = (Vertices::default(), Findings::default());
        for (i, rest) in lines.iter().enumerate() {
            let line = i as u32 + 1;
            vertices.statement("v", At::line("a", line), line, rest, &mut findings);
        }
        vertices.finish("a", &mut findings);
        assert!(!findings.has_errors());
        (vertices, findings.into_warnings().iter().map(ToString::to_string).collect())
    }

    #[test]
    fn colours_are_srgb_in_ones_or_in_bytes() {
        let (ones, said) = read(&["0 0 0 1 0.5 0", "0 0 1 1 1 1"]);
        assert_eq!((ones.colours[0], said.len()), ([1.0, math::srgb_eotf(0.5), 0.0], 0));
        let (bytes, said) = read(&["0 0 0", "0 0 0 255 51 -3", "0 0 1 300 1 255 128"]);
        assert_eq!(bytes.colours, [[1.0; 3], [1.0, math::srgb_eotf(0.2), 0.0], [1.0, math::srgb_eotf(1.0 / 255.0), 1.0]]);
        assert_eq!(said.len(), 4, "{said:?}");
        assert!(said[0].starts_with("a:3: numbers behind the colour") && said[1].starts_with("a:2: 1 of 3 vertices"), "{said:?}");
        assert!(read(&["0 0 0 1 1 1", "1 0 0"]).0.colours.is_empty(), "white changes nothing");
    }

    #[test]
    fn weights_are_no_colours() {
        let (vertices, said) = read(&["1 2 3 1", "1 2 3 0.5"]);
        assert_eq!((vertices.positions, vertices.colours.len()), (vec![[1.0, 2.0, 3.0]; 2], 0));
        assert!(said.len() == 1 && said[0].starts_with("a:2: vertex weights"), "{said:?}");
    }
}
