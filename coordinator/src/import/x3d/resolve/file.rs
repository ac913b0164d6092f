//! Files: the main one, those that are inlined, and their units.

use super::{Resolver, frame::Frame};
use crate::import::{
    BundlePath,
    findings::At,
    x3d::{
        classic,
        document::{Inlined, Node, NodeId, Place, Set},
        encoding::{self, Encoding},
        json,
        limits::MAX_INLINE_DEPTH,
        literal::{self, Form, shown, shown_addresses},
        syntax::{FieldItem, File, Source, Unit, Written},
        table,
        value::{FieldType, Value},
        xml,
    },
};
use kiln_proto::limits;
use std::{collections::BTreeMap, rc::Rc, sync::Arc};

impl Resolver<'_> {
    /// The nodes at the top of the main file.
    pub(super) fn main(&mut self, path: &BundlePath, bytes: &[u8]) -> Option<Vec<NodeId>> {
        let file = self.parse(path, bytes)?;
        self.document.version = file.version;
        self.files.insert(path.clone(), Some(Rc::clone(&file)));
        self.inlining.push(path.clone());
        let mut frame = self.file_frame(&file);
        let roots = self.roots(&mut frame, 1.0, 0);
        self.finish(&mut frame);
        Some(roots)
    }

    /// The nodes of a file in a place where a unit of length is `length` metres.
    fn roots(&mut self, frame: &mut Frame, length: f64, above: u16) -> Vec<NodeId> {
        let scale = (frame.length / length) as f32;
        let file = Rc::clone(&frame.file);
        if scale == 1.0 {
            return self.items(frame, &file.items, None, above);
        }
        let ids = self.items(frame, &file.items, None, above + 1);
        let place = Place { file: file.source.file, line: 1, column: 1 };
        self.scaled(ids, scale, place, above).into_iter().collect()
    }

    /// The same nodes below a `Transform` that scales them.
    pub(super) fn scaled(&mut self, ids: Vec<NodeId>, scale: f32, place: Place, above: u16) -> Option<NodeId> {
        let kind = table::lookup("Transform")?;
        let id = self.push(Node { kind, place, def: None, fields: vec![], height: 1 })?;
        let ((scaling, _), (children, _)) = (kind.field("scale")?, kind.field("children")?);
        self.node_mut(id).set(Set { field: scaling, place, value: Value::Floats([scale; 3].into()) });
        self.set(id, children, place, Value::Nodes(ids.into()), above);
        Some(id)
    }

    /// A frame for the items of a file.
    pub(super) fn file_frame(&mut self, file: &Rc<File>) -> Frame {
        let mut frame = Frame {
            file: Rc::clone(file),
            length: 1.0,
            angle: 1.0,
            scope: self.scope(None),
            names: BTreeMap::new(),
            arguments: None,
            connections: BTreeMap::new(),
            late_routes: vec![],
            exported: vec![],
        };
        for unit in &file.units {
            self.unit(&mut frame, unit);
        }
        frame
    }

    /// `UNIT category name factor` (ISO/IEC 19775-1, 4.3.6 and 7.2.5.11).
    fn unit(&mut self, frame: &mut Frame, unit: &Unit) {
        let factor = unit.factor.parse::<f64>().ok().filter(|f| f.is_finite() && *f > 0.0 && (*f as f32).is_normal());
        let Some(factor) = factor else {
            let message = format!(
                "the unit of `{}` has the factor `{}`, which is no number above 0; it was skipped",
                shown(&unit.category),
                shown(&unit.factor)
            );
            return self.warn(unit.place, message);
        };
        match &*unit.category {
            "length" => frame.length = factor,
            "angle" => frame.angle = factor as f32,
            // No node of light or shape has a mass or a force.
            "mass" | "force" => {}
            other => {
                let message = format!("`{}` is no category of units (angle, force, length, mass); the unit was skipped", shown(other));
                self.warn(unit.place, message);
            }
        }
    }

    /// A file of the bundle, read once.
    pub(super) fn load(&mut self, path: &BundlePath) -> Option<Rc<File>> {
        if let Some(known) = self.files.get(path) {
            return known.clone();
        }
        let bundle = self.bundle;
        let file = match bundle.read(path, limits::TEXT_BYTES) {
            Ok(bytes) => self.parse(path, &bytes),
            Err(problem) => {
                self.findings.push_error(problem);
                None
            }
        };
        self.files.insert(path.clone(), file.clone());
        file
    }

    fn parse(&mut self, path: &BundlePath, bytes: &[u8]) -> Option<Rc<File>> {
        let file = self.document.files.len() as u32;
        self.document.files.push(path.clone());
        let decoded = match encoding::decode(bytes) {
            Ok(decoded) => decoded,
            Err(e) => {
                self.findings.error(At::line(path.as_str(), 1), e.to_string());
                return None;
            }
        };
        if decoded.replaced {
            let at = At::line(path.as_str(), line_of_replacement(&decoded.text));
            self.findings.warn(at, "the text is not UTF-8; its odd bytes were replaced by U+FFFD");
        }
        let text = decoded.text;
        self.steps_left += text.len() as u64;
        let (read, form) = match decoded.encoding {
            Encoding::Classic => (classic::read(&text, file), Form::Classic),
            Encoding::Xml => (xml::read(&text, file), Form::Xml),
            Encoding::Json => (json::read(&text, file), Form::Json),
        };
        match read {
            Ok((version, units, items)) => Some(Rc::new(File { source: Source { file, text, form }, version, units, items })),
            Err(e) => {
                self.error(e.place, e.message);
                None
            }
        }
    }

    /// What an Inline node brings in.
    pub(super) fn inline(&mut self, frame: &Frame, id: NodeId, named: bool, above: u16) {
        let node = self.node_of(id);
        let value = |name: &str| {
            let (index, field) = node.kind.field(name)?;
            Some(node.get(index).map_or((node.place, &field.default), |s| (s.place, &s.value)))
        };
        let (Some((place, Value::Strings(urls))), Some((_, load))) = (value("url"), value("load")) else { return };
        if *load == Value::Ints([0].into()) || urls.is_empty() {
            let place = node.place;
            return self.tally.add(place, "Inline nodes without an address, or told not to load, were skipped".to_owned());
        }
        let urls = Arc::clone(urls);
        let found = urls.iter().find_map(|url| self.find(place, url.split('#').next().unwrap_or_default(), "the file of the Inline"));
        let Some(path) = found else {
            let message = format!("the Inline of {} was skipped: no such file is in the bundle", shown_addresses(&urls));
            return self.warn(place, message);
        };
        let Some(is_x3d) = self.is_x3d(&path) else { return };
        if !is_x3d {
            self.document.inlines.insert(id, Inlined::File(path));
            return;
        }
        let Some(roots) = self.inlined_roots(frame, id, &path, place, named, above) else { return };
        let roots: Vec<NodeId> = roots.into_iter().filter(|r| self.fits(*r, place, above + 1)).collect();
        let height = roots.iter().map(|r| self.node_of(*r).height).max().unwrap_or_default();
        let node = self.node_mut(id);
        node.height = node.height.max(height + 1);
        self.document.inlines.insert(id, Inlined::Nodes(roots));
    }

    /// Whether a file of the bundle is X3D, found out once for each file; `None` where it cannot be read, which is said once.
    fn is_x3d(&mut self, path: &BundlePath) -> Option<bool> {
        if let Some(known) = self.kinds.get(path) {
            return *known;
        }
        let bundle = self.bundle;
        let kind = match bundle.read(path, limits::TEXT_BYTES) {
            Ok(bytes) => Some(encoding::is_x3d(&bytes)),
            Err(problem) => {
                self.findings.push_error(problem);
                None
            }
        };
        self.kinds.insert(path.clone(), kind);
        kind
    }

    /// The nodes of an inlined file. Inline nodes without a name cannot be told apart, so they share the nodes of a file.
    fn inlined_roots(
        &mut self,
        frame: &Frame,
        id: NodeId,
        path: &BundlePath,
        place: Place,
        named: bool,
        above: u16,
    ) -> Option<Vec<NodeId>> {
        if self.inlining.contains(path) {
            self.warn(place, format!("`{path}` is inlined inside itself, which was skipped"));
            return None;
        }
        if self.inlining.len() >= MAX_INLINE_DEPTH {
            self.error(place, format!("more than {MAX_INLINE_DEPTH} files are inlined inside one another"));
            return None;
        }
        let key = (path.clone(), frame.length.to_bits());
        if !named && let Some(roots) = self.inlined.get(&key) {
            return Some(roots.clone());
        }
        let file = self.load(path)?;
        self.inlining.push(path.clone());
        let mut inner = self.file_frame(&file);
        let roots = self.roots(&mut inner, frame.length, above + 1);
        let exports = self.finish(&mut inner);
        self.inlining.pop();
        self.exports.insert(id, exports);
        if !named {
            self.inlined.insert(key, roots.clone());
        }
        Some(roots)
    }

    /// The file of the bundle that an address means, as seen from the file of `place`.
    pub(super) fn find(&mut self, place: Place, address: &str, what: &str) -> Option<BundlePath> {
        let from = self.document.files[place.file as usize].clone();
        let address = address.trim();
        if address.is_empty() || address.starts_with("urn:") {
            return None;
        }
        let found = self.bundle.find_address(&from, address)?;
        Some(found.told(what, &shown(address), |message| self.warn(place, message)).clone())
    }

    /// The addresses of an external prototype.
    pub(super) fn addresses(&mut self, file: &File, address: &FieldItem) -> Vec<Arc<str>> {
        let Written::Text(span) = &address.written else { return vec![] };
        let Some(ty) = FieldType::parse("MFString") else { return vec![] };
        match literal::parse(ty, span.of(&file.source), file.source.form) {
            Ok((Value::Strings(urls), _)) => urls.to_vec(),
            Ok(_) => vec![],
            Err(fault) => {
                self.error(address.place, format!("the addresses of the prototype have {}", fault.message));
                vec![]
            }
        }
    }
}

fn line_of_replacement(text: &str) -> u32 {
    let before = text.split('\u{fffd}').next().unwrap_or_default();
    Place { file: 0, line: 1, column: 1 }.behind(before).line
}
