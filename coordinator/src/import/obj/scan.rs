//! The first reading of an OBJ text: every statement checked, every fault located, and what is sound written out again for `tobj`.
//!
//! `tobj` reads well-formed geometry well, but has no line numbers, ends at the first fault, does not know continued lines or tabs after
//! a keyword, divides by vertex weights, invents texture coordinates where a corner has none, and takes `o` and `g` for the same. So this
//! scan hands it a text in which none of that can happen: vertices first, then faces with positive indices under numbered groups.
//! Cost: one pass, and a second copy of the text. The alternative, a parser of our own, would be as long and less proven.

use super::text::{self, Statement};
use crate::import::findings::{At, Findings};
use kiln_proto::limits;
use std::{collections::BTreeMap, fmt::Write as _};

/// Corners of one polygon: ear clipping takes their square.
const POLYGON_CORNERS: usize = 4_096;

/// References to later definitions that are noted one by one.
const AHEAD: usize = 1_000;

/// Which object, group and material a face belongs to: indices into the names of the scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) struct Group {
    pub(super) object: Option<usize>,
    pub(super) group: Option<usize>,
    pub(super) material: Option<usize>,
}

/// What `tobj` does not keep of a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FaceNote {
    /// Its line.
    pub(super) line: u32,
    /// Whether all its corners have texture coordinates.
    pub(super) has_uv: bool,
}

/// The outcome of a scan.
#[derive(Debug, Default)]
pub(super) struct Scan {
    /// `v` and `vt` lines for `tobj`.
    pub(super) vertices: String,
    /// `g` and `f` lines for `tobj`; the names of groups are indices into `groups`.
    pub(super) faces: String,
    /// What the groups mean.
    pub(super) groups: Vec<Group>,
    /// One note per `f` line.
    pub(super) notes: Vec<FaceNote>,
    /// Names behind `o`, `g` and `usemtl`, each with the line of its first use.
    pub(super) names: Vec<(String, u32)>,
    /// Operands of `mtllib` with their lines.
    pub(super) libraries: Vec<(u32, String)>,
}

/// Scans a text. Faults go into `findings`; the outcome is whole only if there are none.
pub(super) fn scan(file: &str, text: &str, findings: &mut Findings) -> Scan {
    let mut scanner =
        Scanner { file, findings, out: Scan::default(), counts: [0; 3], ahead: vec![], highest: [0; 3], state: State::default() };
    for statement in text::statements(text) {
        scanner.statement(&statement);
        if scanner.findings.is_full() {
            break;
        }
    }
    scanner.finish();
    scanner.out
}

#[derive(Default)]
struct State {
    now: Group,
    /// The group last written to `faces`.
    written: Option<Group>,
    numbers: BTreeMap<Group, usize>,
    ids: BTreeMap<String, usize>,
}

struct Scanner<'a> {
    file: &'a str,
    findings: &'a mut Findings,
    out: Scan,
    /// Vertices, texture coordinates and normals so far.
    counts: [i64; 3],
    /// Indices beyond what was defined where they stand: (line, kind, index). Allowed if the definition follows.
    ahead: Vec<(u32, usize, i64)>,
    /// The highest of them by kind.
    highest: [i64; 3],
    state: State,
}

const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];

impl Scanner<'_> {
    fn statement(&mut self, statement: &Statement<'_>) {
        let (word, rest) = statement.split();
        let line = statement.line;
        match word {
            "v" => self.vertex(line, rest),
            "vt" => self.texture_coordinate(line, rest),
            "vn" => self.normal(line, rest),
            "f" | "fo" => self.face(line, rest),
            "o" => self.state.now.object = self.name(line, rest),
            "g" => self.state.now.group = self.name(line, rest),
            "usemtl" => self.state.now.material = self.name(line, rest),
            "mtllib" => self.library(line, rest),
            "p" | "l" => self.findings.count(At::line(self.file, line), "points and lines were ignored, only faces are surfaces"),
            // Smoothing groups and display attributes: surfaces are baked flat, as their triangles lie.
            "s" | "mg" | "lod" | "bevel" | "c_interp" | "d_interp" => {}
            other => {
                let shown: String = other.chars().take(40).collect();
                self.warn_once(line, &shown, format!("the statement `{shown}` is not supported and was ignored"));
            }
        }
    }

    fn warn_once(&mut self, line: u32, key: &str, message: impl Into<String>) {
        self.findings.warn_once(At::line(self.file, line), key, message);
    }

    fn error(&mut self, line: u32, message: impl Into<String>) {
        self.findings.error(At::line(self.file, line), message);
    }

    /// The id of a name; `None` for an empty one.
    fn name(&mut self, line: u32, rest: &str) -> Option<usize> {
        if rest.len() > limits::NAME_BYTES {
            self.error(line, format!("the name has {} bytes; at most {} are allowed", rest.len(), limits::NAME_BYTES));
            return None;
        }
        if rest.is_empty() {
            return None;
        }
        let next = self.out.names.len();
        let id = *self.state.ids.entry(rest.to_owned()).or_insert(next);
        if id == next {
            self.out.names.push((rest.to_owned(), line));
        }
        Some(id)
    }

    fn library(&mut self, line: u32, rest: &str) {
        if rest.is_empty() {
            self.findings.warn(At::line(self.file, line), "`mtllib` names no file");
        } else if self.out.libraries.len() >= limits::BUNDLE_FILES {
            self.error(line, format!("more than {} `mtllib` statements", limits::BUNDLE_FILES));
        } else {
            self.out.libraries.push((line, rest.to_owned()));
        }
    }

    fn vertex(&mut self, line: u32, rest: &str) {
        self.counts[0] += 1;
        let Some(values) = self.numbers(line, rest, "vertex", 3) else { return };
        match values.len() {
            3 => {}
            4 => {
                if values[3] != "1" && values[3].parse::<f32>() != Ok(1.0) {
                    self.warn_once(line, "weight", "vertex weights (a fourth number behind `v`) were ignored");
                }
            }
            _ => self.warn_once(line, "colour", "vertex colours (numbers behind the third of `v`) were ignored"),
        }
        let _ = writeln!(self.out.vertices, "v {} {} {}", values[0], values[1], values[2]);
    }

    fn texture_coordinate(&mut self, line: u32, rest: &str) {
        self.counts[1] += 1;
        let Some(values) = self.numbers(line, rest, "texture coordinate", 1) else { return };
        let _ = writeln!(self.out.vertices, "vt {} {}", values[0], values.get(1).unwrap_or(&"0"));
    }

    fn normal(&mut self, line: u32, rest: &str) {
        self.counts[2] += 1;
        self.numbers(line, rest, "normal", 3);
    }

    /// The operands, all of them finite numbers in 32 bits, at least `least`.
    fn numbers<'t>(&mut self, line: u32, rest: &'t str, what: &str, least: usize) -> Option<Vec<&'t str>> {
        let words: Vec<&str> = rest.split_whitespace().take(8).collect();
        if words.len() < least {
            self.error(line, format!("the {what} has {} numbers; at least {least} are needed", words.len()));
            return None;
        }
        for word in &words {
            let shown: String = word.chars().take(40).collect();
            match word.parse::<f32>() {
                Ok(value) if value.is_finite() => {}
                Ok(_) => {
                    self.error(line, format!("the {what} has the value `{shown}`, which is not finite in 32 bits"));
                    return None;
                }
                Err(_) => {
                    self.error(line, format!("the {what} has `{shown}` where a number should be"));
                    return None;
                }
            }
        }
        Some(words)
    }

    fn face(&mut self, line: u32, rest: &str) {
        let corners = rest.split_whitespace().count();
        if !(3..=POLYGON_CORNERS).contains(&corners) {
            self.error(line, format!("a face has 3 to {POLYGON_CORNERS} corners; this one has {corners}"));
            return;
        }
        if self.out.notes.len() >= limits::TRIANGLES {
            self.error(line, format!("the scene has more than {} faces", limits::TRIANGLES));
            return;
        }
        let Some(indices) = rest.split_whitespace().map(|c| self.corner(line, c)).collect::<Option<Vec<_>>>() else { return };
        let with_uv = indices.iter().filter(|(_, t)| t.is_some()).count();
        if with_uv != 0 && with_uv != corners {
            self.warn_once(line, "mixed", "a face has texture coordinates at some corners only; they were ignored there");
        }
        let has_uv = with_uv == corners;
        self.begin_group();
        self.out.faces.push('f');
        for (v, t) in indices {
            let _ = match t.filter(|_| has_uv) {
                Some(t) => write!(self.out.faces, " {v}/{t}"),
                None => write!(self.out.faces, " {v}"),
            };
        }
        self.out.faces.push('\n');
        self.out.notes.push(FaceNote { line, has_uv });
    }

    /// Writes the group of the next face where it differs from the last one's.
    fn begin_group(&mut self) {
        let now = self.state.now;
        if self.state.written == Some(now) {
            return;
        }
        let next = self.out.groups.len();
        let number = *self.state.numbers.entry(now).or_insert(next);
        if number == next {
            self.out.groups.push(now);
        }
        let _ = writeln!(self.out.faces, "g {number}");
        self.state.written = Some(now);
    }

    /// Positive indices, from 1, of the vertex and the texture coordinate of a corner.
    fn corner(&mut self, line: u32, corner: &str) -> Option<(i64, Option<i64>)> {
        let parts: Vec<&str> = corner.split('/').take(4).collect();
        if parts.len() > 3 || parts[0].is_empty() {
            let shown: String = corner.chars().take(40).collect();
            self.error(line, format!("the face has the corner `{shown}`; expected vertex, vertex/texture or vertex/texture/normal"));
            return None;
        }
        let vertex = self.index(line, 0, parts[0])?;
        let mut optional = |kind: usize| match parts.get(kind) {
            None | Some(&"") => Some(None),
            Some(word) => self.index(line, kind, word).map(Some),
        };
        let texture = optional(1)?;
        optional(2)?;
        Some((vertex, texture))
    }

    fn index(&mut self, line: u32, kind: usize, word: &str) -> Option<i64> {
        let (what, count) = (KINDS[kind], self.counts[kind]);
        let shown: String = word.chars().take(40).collect();
        let Ok(index) = word.parse::<i64>() else {
            self.error(line, format!("the face has `{shown}` where the number of a {what} should be"));
            return None;
        };
        let resolved = if index < 0 { index.saturating_add(count + 1) } else { index };
        if kind == 2 {
            if resolved < 1 || resolved > count {
                self.findings.count(At::line(self.file, line), "normals that do not exist were referred to (normals are not used)");
            }
            return Some(resolved);
        }
        if index == 0 {
            self.error(line, format!("the face uses {what} 0, but indices begin at 1"));
            return None;
        }
        if resolved < 1 {
            self.error(line, format!("the face uses {what} {index}, but only {count} are defined so far"));
            return None;
        }
        // The highest is always noted, so nothing undefined slips through; of the others, more than can be reported.
        if resolved > count && (self.ahead.len() < AHEAD || resolved > self.highest[kind]) {
            self.highest[kind] = self.highest[kind].max(resolved);
            self.ahead.push((line, kind, resolved));
        }
        Some(resolved)
    }

    /// What can only be told at the end: indices that stay undefined, and texts without a face.
    fn finish(&mut self) {
        for (line, kind, index) in std::mem::take(&mut self.ahead) {
            if index > self.counts[kind] {
                self.error(line, format!("the face uses {} {index}, but only {} are defined", KINDS[kind], self.counts[kind]));
            }
        }
        if self.out.notes.is_empty() && !self.findings.has_errors() {
            self.findings.error(At::file(self.file), "the file has no faces, so there is nothing to bake");
        }
    }
}
