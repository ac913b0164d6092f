//! Buffers and the views into them. A file that several buffers name is held once.

use super::{
    json::Json,
    report::Report,
    uri::{self, Target},
};
use crate::import::{Bundle, BundlePath};
use kiln_proto::limits;
use std::{borrow::Cow, collections::BTreeMap};

/// Compression whose data are not read.
pub(super) const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The bytes that a file refers to.
#[derive(Default)]
pub(super) struct Buffers<'b> {
    stores: Vec<Cow<'b, [u8]>>,
    /// Bytes of all stores.
    total: u64,
    /// Store and length of each buffer; `None` where its bytes are not to be had.
    buffers: Vec<Option<(usize, usize)>>,
    /// The views, `None` where one was wrong.
    views: Vec<Option<View>>,
}

/// A range of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct View {
    store: usize,
    /// Its first byte.
    start: usize,
    /// Its bytes.
    pub(super) len: usize,
    /// Bytes from one element to the next, where it says so.
    pub(super) stride: Option<usize>,
}

impl View {
    /// The same bytes, whatever lies in them.
    pub(super) fn bytes(self) -> Self {
        Self { stride: None, ..self }
    }

    /// Its first byte within its buffer.
    pub(super) fn start(&self) -> usize {
        self.start
    }
}

impl<'b> Buffers<'b> {
    /// Loads every buffer and checks every view.
    pub(super) fn load(bundle: &'b Bundle, from: &BundlePath, binary: Option<&'b [u8]>, root: Json<'_>, report: &mut Report<'_>) -> Self {
        let mut loaded = Self::default();
        let mut files = BTreeMap::new();
        for (index, json) in report.objects(root, "buffers").into_iter().enumerate() {
            let wanted = report.required(json, "byteLength").and_then(|length| report.integer_at(length).map(|n| (length, n)));
            if let Some((at, 0)) = wanted {
                report.error(at, "a buffer must have at least 1 byte");
            }
            let store = loaded.store(bundle, from, binary.filter(|_| index == 0), json, &mut files, report);
            let buffer = wanted.zip(store).and_then(|((at, wanted), store)| loaded.length(at, wanted, store, report).map(|n| (store, n)));
            loaded.buffers.push(buffer);
        }
        for json in report.objects(root, "bufferViews") {
            let view = loaded.view(json, report);
            loaded.views.push(view);
        }
        loaded
    }

    fn store(
        &mut self,
        bundle: &'b Bundle,
        from: &BundlePath,
        binary: Option<&'b [u8]>,
        json: Json<'_>,
        files: &mut BTreeMap<&'b BundlePath, usize>,
        report: &mut Report<'_>,
    ) -> Option<usize> {
        let bytes = match (json.get("uri"), binary) {
            (None, Some(bytes)) => Cow::Borrowed(bytes),
            (None, None) if MESHOPT.iter().any(|name| json.extension(name).is_some()) => return None,
            (None, None) => {
                report.error(json, "the buffer has no `uri`, and the file has no binary chunk for it");
                return None;
            }
            (Some(uri), _) => match uri::resolve(bundle, from, uri, report)? {
                Target::Data(bytes) => Cow::Owned(bytes),
                Target::File(path) => {
                    if let Some(store) = files.get(path) {
                        return Some(*store);
                    }
                    files.insert(path, self.stores.len());
                    bundle.read(path, limits::BUNDLE_BYTES).map_err(|problem| report.push_error(problem)).ok()?
                }
            },
        };
        self.total += bytes.len() as u64;
        self.stores.push(bytes);
        Some(self.stores.len() - 1)
    }

    fn length(&self, at: Json<'_>, wanted: u64, store: usize, report: &mut Report<'_>) -> Option<usize> {
        let found = self.stores.get(store)?.len();
        if wanted > found as u64 {
            report.error(at, format!("the buffer should have {wanted} bytes; there are {found}"));
            return None;
        }
        Some(wanted as usize)
    }

    fn view(&self, json: Json<'_>, report: &mut Report<'_>) -> Option<View> {
        let at = report.required(json, "buffer")?;
        let buffer = report.index_at(at, "buffer", self.buffers.len())?;
        let (start, length) = (report.integer(json, "byteOffset", 0), report.required(json, "byteLength")?);
        let len = report.integer_at(length)?;
        let (store, buffer_len) = self.buffers[buffer]?;
        if len == 0 {
            report.error(length, "a buffer view must have at least 1 byte");
            return None;
        }
        if start.saturating_add(len) > buffer_len as u64 {
            report.error(
                json,
                format!("bytes {start} to {} lie beyond the end of buffer {buffer}, which has {buffer_len}", start.saturating_add(len)),
            );
            return None;
        }
        let stride = self.stride(json, report);
        Some(View { store, start: start as usize, len: len as usize, stride })
    }

    fn stride(&self, json: Json<'_>, report: &mut Report<'_>) -> Option<usize> {
        let at = json.get("byteStride")?;
        let stride = report.integer_at(at)?;
        if !(4..=252).contains(&stride) || stride % 4 != 0 {
            report.error(at, format!("the stride {stride} is not a multiple of 4 from 4 to 252"));
            return None;
        }
        Some(stride as usize)
    }

    /// The number of views.
    pub(super) fn view_count(&self) -> usize {
        self.views.len()
    }

    /// A view, unless it was wrong.
    pub(super) fn view_of(&self, index: usize) -> Option<View> {
        self.views.get(index).copied().flatten()
    }

    /// The bytes of a view.
    pub(super) fn bytes(&self, view: View) -> &[u8] {
        self.stores.get(view.store).and_then(|store| store.get(view.start..view.start + view.len)).unwrap_or_default()
    }

    /// The bytes held.
    pub(super) fn total(&self) -> u64 {
        self.total
    }
}
