//! The reading of an OBJ text: every statement checked, every fault located, what is sound kept in flat lists.
//!
//! Faces may come before what they refer to, so indices are resolved as they are read and checked at the end. Lists that a file does not
//! use (texture coordinates, normals) take nothing. Cost: a pass that counts, so that lists have their length from the start, one that
//! reads, and two for polypaint where there is any. Vertices and faces take up to three times the bytes of the text (triangles of vertices
//! below 10 do), names that are used once more. `tobj`, which was behind this scan before, keeps neither lines nor colours nor smoothing
//! groups, ends at the first fault and invents texture coordinates, so that all of the text had to be written out again for it and most of
//! what it gives be thrown away.

use super::{
    count::count,
    text::{self, Statement},
    vertices::{KINDS, Vertices},
};
use crate::import::findings::{At, Findings};
use kiln_proto::limits;
use std::collections::BTreeMap;

/// References to later definitions that are noted one by one.
const AHEAD: usize = 1_000;

/// Where a corner has no texture coordinate or normal.
pub(super) const NONE: u32 = u32::MAX;

/// Which object, group and material a face belongs to (indices into the names of the scan), and its smoothing group (0: off).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) struct State {
    pub(super) object: Option<usize>,
    pub(super) group: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) smoothing: u32,
}

/// One face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Face {
    /// Its line.
    pub(super) line: u32,
    /// Where its run of corners ends; it begins where the last one's ends.
    pub(super) end: u32,
    /// Index into [`Scan::states`].
    pub(super) state: u32,
}

/// The outcome of a scan.
#[derive(Debug, Default)]
pub(super) struct Scan {
    pub(super) vertices: Vertices,
    pub(super) faces: Vec<Face>,
    /// For the corners of all faces, indices into the lists of [`KINDS`], or [`NONE`]. The second and third are as long as the corners that
    /// have one need.
    pub(super) corners: [Vec<u32>; 3],
    pub(super) states: Vec<State>,
    /// Names behind `o`, `g` and `usemtl`, each with the line of its first use.
    pub(super) names: Vec<(String, u32)>,
    /// Operands of `mtllib` with their lines.
    pub(super) libraries: Vec<(u32, String)>,
}

/// Scans a text. Faults go into `findings`; the outcome is whole only if there are none.
pub(super) fn scan(file: &str, text: &str, findings: &mut Findings) -> Scan {
    let counts = count(text);
    let corners = [Vec::with_capacity(counts.corners), vec![], vec![]];
    let (vertices, faces) = (Vertices::with_room(counts.vertices), Vec::with_capacity(counts.faces));
    let mut scanner = Scanner {
        file,
        findings,
        out: Scan { vertices, faces, corners, ..Scan::default() },
        ahead: vec![],
        highest: [0; 3],
        now: State::default(),
        ids: BTreeMap::new(),
        states: BTreeMap::new(),
        triangles: 0,
    };
    for statement in text::statements(text) {
        scanner.statement(&statement);
        if scanner.findings.is_full() {
            break;
        }
    }
    scanner.out.vertices.paint(file, text, scanner.findings);
    scanner.finish();
    scanner.out
}

struct Scanner<'a> {
    file: &'a str,
    findings: &'a mut Findings,
    out: Scan,
    /// Indices beyond what was defined where they stand: (line, kind, index). Allowed if the definition follows.
    ahead: Vec<(u32, usize, i64)>,
    /// The highest of them by kind.
    highest: [i64; 3],
    now: State,
    /// The names so far.
    ids: BTreeMap<String, usize>,
    states: BTreeMap<State, u32>,
    triangles: usize,
}

impl Scanner<'_> {
    fn statement(&mut self, statement: &Statement<'_>) {
        let (word, rest) = statement.split();
        let line = statement.line;
        let at = At::line(self.file, line);
        match word {
            "v" | "vt" | "vn" => self.out.vertices.statement(word, at, line, rest, self.findings),
            "f" | "fo" => self.face(line, rest),
            "o" => self.now.object = self.name(line, rest),
            "g" => self.now.group = self.name(line, rest),
            "usemtl" if rest.len() > limits::NAME_BYTES => {
                let (found, most) = (rest.len(), limits::NAME_BYTES);
                self.error(line, format!("the name has {found} bytes; those of materials have at most {most}"));
            }
            "usemtl" => self.now.material = self.name(line, rest),
            "s" => self.now.smoothing = self.smoothing(line, rest),
            "mtllib" => self.library(line, rest),
            "p" | "l" => self.findings.count(at, "points and lines were ignored, only faces are surfaces"),
            // How a modelling program displays, merges and refines surfaces.
            "mg" | "lod" | "bevel" | "c_interp" | "d_interp" => {}
            other => {
                let shown: String = other.chars().take(40).collect();
                self.findings.warn_once(at, &shown, format!("the statement `{shown}` is not supported and was ignored"));
            }
        }
    }

    fn error(&mut self, line: u32, message: impl Into<String>) {
        self.findings.error(At::line(self.file, line), message);
    }

    /// The id of a name; `None` for an empty one. Groups have names of any length: CAD programs list all assemblies around a part, and
    /// surfaces are called by the end.
    fn name(&mut self, line: u32, rest: &str) -> Option<usize> {
        if rest.is_empty() {
            return None;
        }
        let next = self.out.names.len();
        let id = *self.ids.entry(rest.to_owned()).or_insert(next);
        if id == next {
            self.out.names.push((rest.to_owned(), line));
        }
        Some(id)
    }

    /// `s 7`, `s off`, `s 0`; some programs write `s on`.
    fn smoothing(&mut self, line: u32, rest: &str) -> u32 {
        match rest {
            "off" | "" => 0,
            "on" => 1,
            number => number.parse::<u32>().unwrap_or_else(|_| {
                let shown: String = number.chars().take(40).collect();
                let message = format!("`s {shown}` names no smoothing group (a number, or `off`); it was taken as `off`");
                self.findings.warn_once(At::line(self.file, line), "smoothing", message);
                0
            }),
        }
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

    fn face(&mut self, line: u32, rest: &str) {
        let count = rest.split_whitespace().count();
        if count < 3 {
            self.error(line, format!("a face has 3 corners or more; this one has {count}"));
            return;
        }
        self.triangles += count - 2;
        if self.triangles > limits::TRIANGLES {
            self.error(line, format!("the scene has more than {} triangles", limits::TRIANGLES));
            return;
        }
        let start = self.out.corners[0].len();
        for corner in rest.split_whitespace() {
            let Some(indices) = self.corner(line, corner) else {
                self.out.corners.iter_mut().for_each(|list| list.truncate(start));
                return;
            };
            self.push(indices);
        }
        self.drop_mixed(line, start);
        let next = self.out.states.len() as u32;
        let state = *self.states.entry(self.now).or_insert(next);
        if state == next {
            self.out.states.push(self.now);
        }
        self.out.faces.push(Face { line, end: self.out.corners[0].len() as u32, state });
    }

    fn push(&mut self, indices: [u32; 3]) {
        let [first, ..] = &self.out.corners;
        let (place, room) = (first.len(), first.capacity());
        for (list, index) in self.out.corners.iter_mut().zip(indices) {
            if index != NONE {
                if list.is_empty() {
                    list.reserve_exact(room);
                }
                list.resize(place, NONE);
                list.push(index);
            }
        }
    }

    /// What only some corners of a face have, none has.
    fn drop_mixed(&mut self, line: u32, start: usize) {
        let end = self.out.corners[0].len();
        for (kind, list) in self.out.corners.iter_mut().enumerate().skip(1) {
            let given = list.get_mut(start..).unwrap_or_default();
            let with = given.iter().filter(|i| **i != NONE).count();
            if with != 0 && with != end - start {
                given.fill(NONE);
                let message = format!("a face has {}s at some corners only; they were ignored there", KINDS[kind]);
                self.findings.warn_once(At::line(self.file, line), KINDS[kind], message);
            }
        }
    }

    /// The indices of a corner, from 0.
    fn corner(&mut self, line: u32, corner: &str) -> Option<[u32; 3]> {
        let parts: Vec<&str> = corner.split('/').take(4).collect();
        if parts.len() > 3 || parts[0].is_empty() {
            let shown: String = corner.chars().take(40).collect();
            self.error(line, format!("the face has the corner `{shown}`; expected vertex, vertex/texture or vertex/texture/normal"));
            return None;
        }
        let mut indices = [NONE; 3];
        for (kind, word) in parts.iter().enumerate().filter(|(_, word)| !word.is_empty()) {
            indices[kind] = self.index(line, kind, word)?;
        }
        Some(indices)
    }

    fn index(&mut self, line: u32, kind: usize, word: &str) -> Option<u32> {
        let (what, count) = (KINDS[kind], self.out.vertices.counts()[kind]);
        let Ok(index) = word.parse::<i64>() else {
            let shown: String = word.chars().take(40).collect();
            self.error(line, format!("the face has `{shown}` where the number of a {what} should be"));
            return None;
        };
        let resolved = if index < 0 { index.saturating_add(count + 1) } else { index };
        // A normal is not worth refusing a scene for, and there are programs that write their indices without the list.
        if resolved < 1 && kind == 2 {
            return Some(NONE - 1);
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
        if kind < 2 && resolved > count && (self.ahead.len() < AHEAD || resolved > self.highest[kind]) {
            self.highest[kind] = self.highest[kind].max(resolved);
            self.ahead.push((line, kind, resolved));
        }
        Some(u32::try_from(resolved - 1).unwrap_or(NONE).min(NONE - 1))
    }

    /// What can only be told at the end: indices that stay undefined, and texts without a face.
    fn finish(&mut self) {
        let counts = self.out.vertices.counts();
        for (line, kind, index) in std::mem::take(&mut self.ahead) {
            if index > counts[kind] {
                self.error(line, format!("the face uses {} {index}, but only {} are defined", KINDS[kind], counts[kind]));
            }
        }
        if self.out.faces.is_empty() && !self.findings.has_errors() {
            self.findings.error(At::file(self.file), "the file has no faces, so there is nothing to bake");
        }
        self.out.vertices.finish(self.file, self.findings);
    }
}
