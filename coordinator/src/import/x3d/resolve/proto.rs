//! Prototypes: declared, found again, brought from other files.

use super::{
    Resolver,
    frame::{Argument, Arguments, Frame},
};
use crate::import::{
    BundlePath,
    x3d::{
        literal::{shown, shown_addresses},
        syntax::{FieldItem, File, Item, ProtoBody, ProtoItem, Written},
        value::{Base, Value},
    },
};
use std::{collections::BTreeMap, rc::Rc};

/// The prototypes declared in one file or one instance.
#[derive(Debug, Default)]
pub(super) struct Scope {
    /// The scope around it, and how many of that one's declarations it sees.
    parent: Option<(usize, usize)>,
    declared: usize,
    /// By name: the number of the declaration, and the prototype.
    names: BTreeMap<Box<str>, Vec<(usize, usize)>>,
}

/// Where the search for an external prototype stands.
#[derive(Debug, Clone, Copy)]
enum External {
    Unsought,
    Sought,
    Found(usize),
}

/// A declared prototype.
#[derive(Debug)]
pub(super) struct Prototype {
    pub(super) item: Rc<ProtoItem>,
    pub(super) file: Rc<File>,
    /// Metres and radians per unit of that file.
    pub(super) length: f64,
    pub(super) angle: f32,
    /// Where it was declared, and the number of the declaration: it sees those before it.
    pub(super) scope: (usize, usize),
    /// Its fields with their defaults.
    pub(super) arguments: Arguments,
    external: External,
}

impl Prototype {
    pub(super) fn is_external(&self) -> bool {
        matches!(self.item.body, ProtoBody::Extern(_))
    }
}

/// The prototypes of a file that was read for them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Library {
    scope: usize,
    /// Its first prototype, which an address without a name means.
    first: Option<usize>,
}

impl Resolver<'_> {
    /// A new scope inside another.
    pub(super) fn scope(&mut self, parent: Option<(usize, usize)>) -> usize {
        self.scopes.push(Scope { parent, ..Scope::default() });
        self.scopes.len() - 1
    }

    /// Declares a prototype; the defaults of its fields are of the names here.
    pub(super) fn declare(&mut self, frame: &mut Frame, item: &Rc<ProtoItem>) {
        let mut arguments = Arguments::new();
        for field in &item.interface {
            let value = field.value.as_ref().and_then(|value| {
                let what = format!("the field `{}` of the prototype `{}`", shown(&field.name), shown(&item.name));
                match &value.written {
                    Written::Nodes(nodes) if field.ty.base == Base::Node => Some(Value::Nodes(self.items(frame, nodes, None, 1).into())),
                    Written::Is(_) => None,
                    _ => self.simple(frame, value, field.ty, false, &what),
                }
            });
            let (ty, access, place, angle) = (field.ty, field.access, field.place, frame.angle);
            arguments.insert(field.name.clone(), Argument { ty, access, place, angle, value });
        }
        let index = self.prototypes.len();
        let scope = &mut self.scopes[frame.scope];
        let number = scope.declared;
        scope.declared += 1;
        scope.names.entry(item.name.clone()).or_default().push((number, index));
        self.prototypes.push(Prototype {
            item: Rc::clone(item),
            file: Rc::clone(&frame.file),
            length: frame.length,
            angle: frame.angle,
            scope: (frame.scope, number),
            arguments,
            external: External::Unsought,
        });
    }

    /// The prototype that a name means in a scope.
    pub(super) fn prototype(&self, scope: usize, name: &str) -> Option<usize> {
        let mut at = (scope, usize::MAX);
        loop {
            let scope = &self.scopes[at.0];
            let seen = scope.names.get(name).and_then(|list| list[..list.partition_point(|(number, _)| *number < at.1)].last());
            if let Some((_, index)) = seen {
                return Some(*index);
            }
            at = scope.parent?;
        }
    }

    /// The prototype itself: an external one is sought in the bundle when it is first used.
    pub(super) fn definition(&mut self, prototype: usize) -> Option<usize> {
        let ProtoBody::Extern(address) = &Rc::clone(&self.prototypes[prototype].item).body else { return Some(prototype) };
        match self.prototypes[prototype].external {
            External::Found(index) => return Some(index),
            // Also what a prototype finds that is external in a circle.
            External::Sought => return None,
            External::Unsought => self.prototypes[prototype].external = External::Sought,
        }
        let found = self.seek(prototype, address).and_then(|found| self.definition(found))?;
        self.prototypes[prototype].external = External::Found(found);
        Some(found)
    }

    /// The first of the addresses that leads to a prototype in the bundle.
    fn seek(&mut self, prototype: usize, address: &FieldItem) -> Option<usize> {
        let Prototype { file, item, .. } = &self.prototypes[prototype];
        let (file, item) = (Rc::clone(file), Rc::clone(item));
        let urls = self.addresses(&file, address);
        for url in &urls {
            let (path, name) = url.split_once('#').map_or((&**url, None), |(path, name)| (path, Some(name)));
            let Some(path) = self.find(address.place, path, &format!("the file of the prototype `{}`", shown(&item.name))) else {
                continue;
            };
            let Some(library) = self.library(&path) else { continue };
            let found = match name {
                Some(name) => self.prototype(library.scope, name),
                None => library.first,
            };
            if found.is_some() {
                return found;
            }
            let said = name.unwrap_or("any");
            self.warn(address.place, format!("`{path}` does not declare the prototype `{}`", shown(said)));
        }
        let said = shown_addresses(&urls);
        let message = format!("the external prototype `{}` is at none of its addresses in the bundle: {said}", shown(&item.name));
        self.warn(address.place, message);
        None
    }

    /// The prototypes that a file declares. Its nodes are not looked at.
    fn library(&mut self, path: &BundlePath) -> Option<Library> {
        if let Some(known) = self.libraries.get(path) {
            return *known;
        }
        self.libraries.insert(path.clone(), None);
        let file = self.load(path)?;
        let mut frame = self.file_frame(&file);
        let before = self.prototypes.len();
        for item in &file.items {
            if let Item::Proto(proto) = item
                && self.step(proto.place)
            {
                self.declare(&mut frame, proto);
            }
        }
        let first = self.scopes[frame.scope].names.values().flatten().filter(|(number, _)| *number == 0).map(|(_, index)| *index).next();
        let library = Library { scope: frame.scope, first: first.filter(|i| *i >= before) };
        self.libraries.insert(path.clone(), Some(library));
        Some(library)
    }
}
