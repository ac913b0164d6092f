//! Faces out of index lists: what can be used, in the order of the file, with where each corner stood.

use super::error::{GeometryError, Repairs};

/// A corner: a coordinate, and where the file's list names it, so that parallel lists can be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Corner {
    /// Index of the coordinate.
    pub(super) vertex: u32,
    /// Position in the list that named it.
    pub(super) place: u32,
}

/// Usable faces.
#[derive(Debug, Default)]
pub(super) struct Faces {
    /// Corners of all faces, one after the other.
    pub(super) corners: Vec<Corner>,
    /// Where each face's corners end.
    pub(super) ends: Vec<u32>,
    /// The number of each face in the file, dropped ones counted.
    pub(super) numbers: Vec<u32>,
    /// The strip or fan that each face is part of; 0 where there are none.
    pub(super) groups: Vec<u32>,
}

/// Takes faces against the list of coordinates.
pub(super) struct Collector<'a> {
    coord: &'a [[f32; 3]],
    /// The field that corners are named in, for messages.
    field: &'static str,
    /// Faces with fewer than three different corners are the glue of strips, and nothing to report.
    thin_is_normal: bool,
    faces: Faces,
    repairs: &'a mut Repairs,
    seen: u32,
    scratch: Vec<Corner>,
}

impl<'a> Collector<'a> {
    pub(super) fn new(coord: &'a [[f32; 3]], field: &'static str, thin_is_normal: bool, repairs: &'a mut Repairs) -> Self {
        Self { coord, field, thin_is_normal, faces: Faces::default(), repairs, seen: 0, scratch: vec![] }
    }

    /// Notes something about the list at a place in it.
    pub(super) fn note(&mut self, what: &'static str, place: usize) {
        self.repairs.note(what, self.field, place);
    }

    /// Takes the next face, by coordinate and place; a face that cannot be used is counted and dropped.
    pub(super) fn face(&mut self, group: u32, corners: impl IntoIterator<Item = (i64, usize)>) {
        let number = self.seen;
        self.seen += 1;
        self.scratch.clear();
        let mut first = None;
        for (index, place) in corners {
            first.get_or_insert(place);
            let Some(point) = usize::try_from(index).ok().and_then(|i| self.coord.get(i)) else {
                self.note("faces that name a point which does not exist were dropped", place);
                return;
            };
            if point.iter().any(|x| !x.is_finite()) {
                self.note("faces with a point that is not a finite number were dropped", place);
                return;
            }
            let corner = Corner { vertex: index as u32, place: place as u32 };
            if self.scratch.last().is_none_or(|last| last.vertex != corner.vertex) {
                self.scratch.push(corner);
            }
        }
        while self.scratch.len() > 1 && self.scratch.first().map(|c| c.vertex) == self.scratch.last().map(|c| c.vertex) {
            self.scratch.pop();
        }
        if self.scratch.len() < 3 {
            if !self.thin_is_normal {
                self.note("faces with fewer than three different corners were dropped", first.unwrap_or_default());
            }
            return;
        }
        self.faces.corners.extend(&self.scratch);
        self.faces.ends.push(self.faces.corners.len() as u32);
        self.faces.numbers.push(number);
        self.faces.groups.push(group);
    }

    /// The faces, at least one.
    pub(super) fn finish(self) -> Result<Faces, GeometryError> {
        if self.seen == 0 {
            return Err(GeometryError::Empty { why: "it has no faces" });
        }
        if self.faces.ends.is_empty() {
            return Err(match self.repairs.0.is_empty() {
                true => GeometryError::Empty { why: "all its faces have fewer than three different corners" },
                false => GeometryError::NothingLeft { repairs: self.repairs.clone() },
            });
        }
        Ok(self.faces)
    }
}
