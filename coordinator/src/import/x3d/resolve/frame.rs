//! The names of one file or one instance of a prototype.

use crate::import::x3d::{
    document::{NodeId, Place},
    syntax::{File, RouteItem},
    table::{Access, NodeType},
    value::{FieldType, Value},
};
use std::{collections::BTreeMap, rc::Rc};

/// Where events to or from a field of an instance go: to these fields of the nodes that it is made of.
#[derive(Debug, Clone)]
pub(super) struct Connected {
    pub(super) ty: FieldType,
    pub(super) access: Access,
    pub(super) fields: Vec<(NodeId, u16)>,
}

/// The ways into and out of an instance, by the name of the field.
pub(super) type Connections = BTreeMap<Box<str>, Connected>;

/// What a name stands for.
#[derive(Debug, Clone)]
pub(super) enum Target {
    Node(NodeId),
    /// An instance of a prototype: its first node, and where its fields lead.
    Instance(NodeId, Rc<Connections>),
    /// Something that was left out, and its type where that is known.
    Skipped(Option<&'static NodeType>),
}

/// A field of a prototype as an instance of it has it.
#[derive(Debug, Clone)]
pub(super) struct Argument {
    pub(super) ty: FieldType,
    pub(super) access: Access,
    pub(super) place: Place,
    /// Radians per unit of angle where the value was written: plain numbers turn out to be angles only where they end.
    pub(super) angle: f32,
    /// `None` for events, and where neither the prototype nor the instance says anything.
    pub(super) value: Option<Value>,
}

/// The fields of an instance by name.
pub(super) type Arguments = BTreeMap<Box<str>, Argument>;

/// One file, or one instance of a prototype, while its items are walked.
#[derive(Debug)]
pub(super) struct Frame {
    pub(super) file: Rc<File>,
    /// Metres per unit of length.
    pub(super) length: f64,
    /// Radians per unit of angle.
    pub(super) angle: f32,
    /// Index of the scope that its prototypes are declared in.
    pub(super) scope: usize,
    pub(super) names: BTreeMap<Box<str>, Target>,
    /// The fields of the prototype; `None` in a file.
    pub(super) arguments: Option<Arguments>,
    pub(super) connections: Connections,
    /// Routes to names that were not there yet.
    pub(super) late_routes: Vec<RouteItem>,
    /// `EXPORT`: local name, exported name.
    pub(super) exported: Vec<(Place, Box<str>, Box<str>)>,
}
