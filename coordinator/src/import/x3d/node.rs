//! A node as the scene builder sees it: typed fields, each with the default of the table where the file says nothing.
//!
//! A getter asked for a field that the node's type lacks, or that has another type, answers with nothing or zeros: that is a slip of the
//! caller, which tests of the table's names catch, and no reason to lose somebody's scene.

use super::{
    document::{Document, Inlined, NodeId, Place, Set},
    value::Value,
};
use crate::import::{BundlePath, findings::At};
use std::{borrow::Cow, sync::Arc};

/// A node of a document.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeRef<'a> {
    pub(super) document: &'a Document,
    pub(super) id: NodeId,
}

impl<'a> NodeRef<'a> {
    /// Its number: equal for a DEF and every USE of it.
    pub(crate) fn id(self) -> NodeId {
        self.id
    }

    /// The name of its type, `Transform`.
    pub(crate) fn kind(self) -> &'static str {
        self.raw().kind.name
    }

    /// The name that DEF gave it.
    pub(crate) fn def(self) -> Option<&'a str> {
        self.raw().def.as_deref()
    }

    /// Where the value of a field stands; where the node begins if the field is not set.
    pub(crate) fn place_of(self, name: &str) -> Place {
        self.set(name).map_or(self.raw().place, |s| s.place)
    }

    /// Where it begins.
    pub(crate) fn place(self) -> Place {
        self.raw().place
    }

    /// Where it begins, for findings.
    pub(crate) fn at(self) -> At<'a> {
        self.document.at(self.raw().place)
    }

    /// Where the value of a field stands; where the node begins if the field is not set.
    pub(crate) fn at_field(self, name: &str) -> At<'a> {
        self.document.at(self.place_of(name))
    }

    /// The file in which the value of a field stands, from which its relative addresses count.
    pub(crate) fn file_of(self, name: &str) -> &'a BundlePath {
        self.document.file(self.place_of(name))
    }

    /// Whether the file (or an event) gives the field a value.
    pub(crate) fn is_set(self, name: &str) -> bool {
        self.set(name).is_some()
    }

    /// Whether nodes of its type have such a field.
    pub(crate) fn has(self, name: &str) -> bool {
        self.raw().kind.field(name).is_some()
    }

    /// What an Inline node brought in; `None` for other nodes, and where there was nothing to bring.
    pub(crate) fn inlined(self) -> Option<&'a Inlined> {
        self.document.inlines.get(&self.id)
    }

    fn raw(self) -> &'a super::document::Node {
        &self.document.nodes[self.id.0 as usize]
    }

    fn set(self, name: &str) -> Option<&'a Set> {
        let (index, _) = self.raw().kind.field(name)?;
        self.raw().get(index)
    }

    /// The value of a field or its default.
    pub(super) fn value(self, name: &str) -> Option<&'a Value> {
        let node = self.raw();
        let (index, field) = node.kind.field(name)?;
        Some(node.get(index).map_or(&field.default, |s| &s.value))
    }

    /// An `SFBool`.
    pub(crate) fn bool(self, name: &str) -> bool {
        self.int(name) != 0
    }

    /// An `SFInt32`.
    pub(crate) fn int(self, name: &str) -> i32 {
        self.mf_int(name).first().copied().unwrap_or_default()
    }

    /// An `SFFloat`, an `SFDouble` or an `SFTime` (seconds) in 32 bits; angles are in radians.
    pub(crate) fn float(self, name: &str) -> f32 {
        self.tuples::<1>(name).first().map_or(0.0, |v| v[0])
    }

    /// An `SFDouble` or an `SFTime` (seconds).
    pub(crate) fn double(self, name: &str) -> f64 {
        match self.value(name) {
            Some(Value::Doubles(v)) => v.first().copied().unwrap_or_default(),
            Some(Value::Floats(v)) => v.first().copied().map_or(0.0, f64::from),
            _ => 0.0,
        }
    }

    /// An `SFString`.
    pub(crate) fn string(self, name: &str) -> &'a str {
        self.mf_string(name).first().map_or("", |s| s)
    }

    /// An `SFVec2f` or `SFVec2d`.
    pub(crate) fn vec2(self, name: &str) -> [f32; 2] {
        self.tuple(name)
    }

    /// An `SFVec3f`, `SFVec3d` or `SFColor`.
    pub(crate) fn vec3(self, name: &str) -> [f32; 3] {
        self.tuple(name)
    }

    /// An `SFVec4f`, `SFVec4d`, `SFColorRGBA` or `SFRotation` (axis, not normalised, and radians).
    pub(crate) fn vec4(self, name: &str) -> [f32; 4] {
        self.tuple(name)
    }

    /// An `SFMatrix4f` or `SFMatrix4d`, as written: the rows of the file, the last of which translates.
    pub(crate) fn matrix4(self, name: &str) -> [f32; 16] {
        self.tuple(name)
    }

    /// An `MFInt32` or `MFBool`; an `SFImage` or `MFImage` as width, height, components and width times height pixels (row 0 at the
    /// bottom, the first component in the highest byte used), one image after another: the numbers are as many as they say.
    pub(crate) fn mf_int(self, name: &str) -> &'a [i32] {
        if let Some(Value::Ints(v)) = self.value(name) { v } else { &[] }
    }

    /// An `MFFloat`, `MFDouble` or `MFTime`.
    pub(crate) fn mf_float(self, name: &str) -> Cow<'a, [f32]> {
        self.numbers(name)
    }

    /// An `MFVec2f` or `MFVec2d`.
    pub(crate) fn mf_vec2(self, name: &str) -> Cow<'a, [[f32; 2]]> {
        self.tuples(name)
    }

    /// An `MFVec3f`, `MFVec3d` or `MFColor`.
    pub(crate) fn mf_vec3(self, name: &str) -> Cow<'a, [[f32; 3]]> {
        self.tuples(name)
    }

    /// An `MFVec4f`, `MFVec4d`, `MFColorRGBA` or `MFRotation`.
    pub(crate) fn mf_vec4(self, name: &str) -> Cow<'a, [[f32; 4]]> {
        self.tuples(name)
    }

    /// An `MFString`.
    pub(crate) fn mf_string(self, name: &str) -> &'a [Arc<str>] {
        if let Some(Value::Strings(v)) = self.value(name) { v } else { &[] }
    }

    /// An `SFNode`; the first of an `MFNode`.
    pub(crate) fn node(self, name: &str) -> Option<NodeRef<'a>> {
        self.children(name).next()
    }

    /// The nodes of an `MFNode` or `SFNode`, in their order.
    pub(crate) fn children(self, name: &str) -> impl ExactSizeIterator<Item = NodeRef<'a>> + use<'a> {
        self.value(name).map_or(&[][..], Value::nodes).iter().map(move |id| self.document.node(*id))
    }

    fn numbers(self, name: &str) -> Cow<'a, [f32]> {
        match self.value(name) {
            Some(Value::Floats(v)) => Cow::Borrowed(v),
            Some(Value::Doubles(v)) => Cow::Owned(v.iter().map(|x| *x as f32).collect()),
            _ => Cow::Borrowed(&[]),
        }
    }

    pub(super) fn tuples<const N: usize>(self, name: &str) -> Cow<'a, [[f32; N]]> {
        match self.numbers(name) {
            Cow::Borrowed(v) => Cow::Borrowed(v.as_chunks().0),
            Cow::Owned(v) => Cow::Owned(v.as_chunks().0.to_vec()),
        }
    }

    fn tuple<const N: usize>(self, name: &str) -> [f32; N] {
        self.tuples(name).first().copied().unwrap_or([0.0; N])
    }
}
