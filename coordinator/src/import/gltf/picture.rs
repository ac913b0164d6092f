//! The images of a file: where the bytes of each are, found once, and read only for who decodes them.

use super::{
    buffer::{Buffers, View},
    json::Json,
    report::{Place, Report},
    uri::{self, Target},
};
use crate::import::{Bundle, BundlePath, texture, uri::data};
use crate::records::Problem;
use kiln_proto::limits;
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};

/// Times that the bytes of the buffers are looked at for images that materials use, and as often for those that nothing uses: views of one
/// buffer may overlap.
const LOOKS: u64 = 4;

#[cfg(test)]
thread_local! {
    /// How often this thread read the bytes of an image.
    pub(super) static READ: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// The images of a file.
pub(super) struct Pictures<'a, 'd> {
    bundle: &'a Bundle,
    file: &'a BundlePath,
    buffers: &'a Buffers<'a>,
    list: Vec<Json<'d>>,
    /// The images that materials use; `None` where one cannot be had.
    known: BTreeMap<usize, Option<Located<'a, 'd>>>,
    /// The first image of each view.
    views: BTreeMap<View, usize>,
    /// Bytes of views that may still be looked at.
    left: u64,
}

/// An image that is there.
pub(super) struct Picture<'a, 'd> {
    /// Its description.
    pub(super) json: Json<'d>,
    /// A name that stands for exactly its bytes.
    pub(super) name: String,
    located: Located<'a, 'd>,
}

/// Where the bytes of an image are: the URI of those in the text.
#[derive(Clone, Copy)]
enum Located<'a, 'd> {
    File(&'a BundlePath),
    View(View),
    Data(Json<'d>),
}

impl<'a, 'd> Pictures<'a, 'd> {
    /// Nothing is looked at until a material asks.
    pub(super) fn new(bundle: &'a Bundle, file: &'a BundlePath, buffers: &'a Buffers<'a>, root: Json<'d>, report: &mut Report<'_>) -> Self {
        let (list, left) = (report.objects(root, "images"), buffers.total().saturating_mul(LOOKS));
        Self { bundle, file, buffers, list, known: BTreeMap::new(), views: BTreeMap::new(), left }
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    /// An image that a material uses; `None` where it cannot be had, which is told once.
    pub(super) fn find(&mut self, index: usize, report: &mut Report<'_>) -> Option<Picture<'a, 'd>> {
        let json = self.list[index];
        let located = match self.known.get(&index) {
            Some(known) => *known,
            None => {
                let located = self.locate(json, report).filter(|located| self.may_look(index, *located, report));
                self.known.insert(index, located);
                located
            }
        }?;
        Some(Picture { json, name: self.name(index, located), located })
    }

    /// The bytes of an image.
    pub(super) fn read(&self, picture: &Picture<'a, 'd>, place: Place<'_>) -> Result<Cow<'a, [u8]>, Problem> {
        self.bytes(picture.located, place)
    }

    fn bytes(&self, located: Located<'a, 'd>, place: Place<'_>) -> Result<Cow<'a, [u8]>, Problem> {
        #[cfg(test)]
        READ.set(READ.get() + 1);
        match located {
            Located::File(path) => self.bundle.read(path, limits::BUNDLE_BYTES),
            Located::View(view) => Ok(Cow::Borrowed(self.buffers.bytes(view))),
            Located::Data(at) => {
                let text = at.string().unwrap_or_default();
                let bytes = data(text.get("data:".len()..).unwrap_or_default());
                bytes.map(Cow::Owned).map_err(|message| place.problem(at, &message))
            }
        }
    }

    fn name(&self, index: usize, located: Located<'_, '_>) -> String {
        let inside = |index: usize| format!("{}#/images/{index}", self.file);
        match located {
            Located::File(path) => path.to_string(),
            Located::View(view) => inside(self.views.get(&view.bytes()).copied().unwrap_or(index)),
            Located::Data(_) => inside(index),
        }
    }

    /// Whether the bytes of views up to this one are not too many; those that are the same count once.
    fn may_look(&mut self, index: usize, located: Located<'_, '_>, report: &mut Report<'_>) -> bool {
        let Located::View(view) = located else { return true };
        if self.views.contains_key(&view.bytes()) {
            return true;
        }
        let Some(left) = self.left.checked_sub(view.len as u64) else {
            let message =
                format!("the views of the images up to this one have more than {LOOKS} times the bytes of all buffers: they overlap");
            report.error(self.list[index], message);
            return false;
        };
        self.left = left;
        self.views.insert(view.bytes(), index);
        true
    }

    /// Where the bytes of an image are; those in the text itself are not decoded yet.
    fn locate(&self, source: Json<'d>, report: &mut Report<'_>) -> Option<Located<'a, 'd>> {
        match (source.get("uri"), source.get("bufferView")) {
            (Some(at), None) if uri::is_data(at) => Some(Located::Data(at)),
            (Some(at), None) => match uri::resolve(self.bundle, self.file, at, report)? {
                Target::Data(_) => Some(Located::Data(at)),
                Target::File(path) => Some(Located::File(path)),
            },
            (None, Some(at)) => {
                let view = report.index_at(at, "buffer view", self.buffers.view_count())?;
                Some(Located::View(self.buffers.view_of(view)?))
            }
            _ => {
                report.error(source, "an image has either a `uri` or a `bufferView`");
                None
            }
        }
    }

    /// Looks at the images that no material uses, once at each file and view: what is wrong with them does no harm, but is said.
    pub(super) fn check_unused(&self, report: &mut Report<'_>) {
        let (mut files, mut views, mut left) = (BTreeSet::new(), BTreeSet::new(), self.buffers.total().saturating_mul(LOOKS));
        for source in self.list.iter().enumerate().filter(|(i, _)| !self.known.contains_key(i)).map(|(_, source)| *source) {
            if report.is_full() {
                return;
            }
            let Some(located) = self.locate(source, report) else { continue };
            let is_new = match located {
                Located::File(path) => files.insert(path),
                Located::View(view) => views.insert(view.bytes()),
                Located::Data(_) => true,
            };
            if !is_new {
                continue;
            }
            if let Located::View(view) = located {
                let Some(rest) = left.checked_sub(view.len as u64) else {
                    report.count(source, "images that no material uses were not looked at: their views overlap too much");
                    continue;
                };
                left = rest;
            }
            match self.bytes(located, report.place()).map(|bytes| texture::size("image", &bytes)) {
                Err(problem) => report.push_error(problem),
                Ok(Err(e)) => report.warn(source, format!("the image {e}; no material uses it")),
                Ok(Ok(_)) => {}
            }
        }
    }
}
