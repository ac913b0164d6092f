//! The field types of X3D (ISO/IEC 19775-1, clause 5) and their values.
//!
//! A type is a base and whether there may be many; a value is a flat list whose width the type tells. Twenty-one bases in two forms are
//! so five stores, and whatever handles values (IS, ROUTE, interpolation) is written once. The alternative, a variant per type, moves the
//! same forty arms into every function.

use super::document::NodeId;
use std::{fmt, sync::Arc};

/// What one element of a field is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // The names are the standard's.
pub(crate) enum Base {
    Bool,
    Color,
    ColorRgba,
    Double,
    Float,
    Image,
    Int32,
    Matrix3d,
    Matrix3f,
    Matrix4d,
    Matrix4f,
    Node,
    Rotation,
    String,
    Time,
    Vec2d,
    Vec2f,
    Vec3d,
    Vec3f,
    Vec4d,
    Vec4f,
}

/// How elements lie in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Store {
    /// Booleans (0 and 1), integers and images.
    Ints,
    /// 32-bit numbers.
    Floats,
    /// 64-bit numbers.
    Doubles,
    /// Texts.
    Strings,
    /// Nodes.
    Nodes,
}

/// Every base with its name behind `SF` or `MF`, its store and its numbers per element (0: it varies).
const BASES: [(Base, &str, Store, usize); 21] = [
    (Base::Bool, "Bool", Store::Ints, 1),
    (Base::Color, "Color", Store::Floats, 3),
    (Base::ColorRgba, "ColorRGBA", Store::Floats, 4),
    (Base::Double, "Double", Store::Doubles, 1),
    (Base::Float, "Float", Store::Floats, 1),
    (Base::Image, "Image", Store::Ints, 0),
    (Base::Int32, "Int32", Store::Ints, 1),
    (Base::Matrix3d, "Matrix3d", Store::Doubles, 9),
    (Base::Matrix3f, "Matrix3f", Store::Floats, 9),
    (Base::Matrix4d, "Matrix4d", Store::Doubles, 16),
    (Base::Matrix4f, "Matrix4f", Store::Floats, 16),
    (Base::Node, "Node", Store::Nodes, 1),
    (Base::Rotation, "Rotation", Store::Floats, 4),
    (Base::String, "String", Store::Strings, 1),
    (Base::Time, "Time", Store::Doubles, 1),
    (Base::Vec2d, "Vec2d", Store::Doubles, 2),
    (Base::Vec2f, "Vec2f", Store::Floats, 2),
    (Base::Vec3d, "Vec3d", Store::Doubles, 3),
    (Base::Vec3f, "Vec3f", Store::Floats, 3),
    (Base::Vec4d, "Vec4d", Store::Doubles, 4),
    (Base::Vec4f, "Vec4f", Store::Floats, 4),
];

/// A field type: `SFVec3f`, `MFNode`, …
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FieldType {
    /// What one element is.
    pub(crate) base: Base,
    /// `MF`: any number of elements; `SF`: one, and of nodes at most one.
    pub(crate) many: bool,
}

impl FieldType {
    /// The type of this name in the standard (`SFVec3f`); matrices may leave out the `f`, as Castle and InstantReality do.
    pub(crate) fn parse(name: &str) -> Option<Self> {
        let (many, base) = match name.split_at_checked(2)? {
            ("SF", base) => (false, base),
            ("MF", base) => (true, base),
            _ => return None,
        };
        let base = match base {
            "Matrix3" => "Matrix3f",
            "Matrix4" | "Matrix" => "Matrix4f",
            other => other,
        };
        BASES.iter().find(|(_, n, ..)| *n == base).map(|(base, ..)| Self { base: *base, many })
    }

    fn row(self) -> &'static (Base, &'static str, Store, usize) {
        // The table lists the variants in their order, which a test holds it to.
        &BASES[self.base as usize]
    }

    /// How its values lie in memory.
    pub(crate) fn store(self) -> Store {
        self.row().2
    }

    /// Numbers of one element; 0 for images, which say it themselves.
    pub(crate) fn width(self) -> usize {
        self.row().3
    }

    /// What a field of this type is where nobody says: nothing for lists, nodes and images, else zeros (0 0 1 0 for a rotation).
    pub(crate) fn zero(self) -> Value {
        let width = if self.many { 0 } else { self.width() };
        match self.store() {
            Store::Ints if self.base == Base::Image && !self.many => Value::Ints([0, 0, 0].into()),
            Store::Ints => Value::Ints(vec![0; width].into()),
            Store::Floats if self.base == Base::Rotation && !self.many => Value::Floats([0.0, 0.0, 1.0, 0.0].into()),
            Store::Floats => Value::Floats(vec![0.0; width].into()),
            Store::Doubles => Value::Doubles(vec![0.0; width].into()),
            Store::Strings => Value::Strings(vec![Arc::from(""); width].into()),
            Store::Nodes => Value::Nodes([].into()),
        }
    }
}

impl fmt::Display for FieldType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}F{}", if self.many { 'M' } else { 'S' }, self.row().1)
    }
}

/// The value of a field, elements one after another; cheap to clone, because a PROTO hands the same value to each of its instances.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs)] // See `Store`.
pub(crate) enum Value {
    Ints(Arc<[i32]>),
    Floats(Arc<[f32]>),
    Doubles(Arc<[f64]>),
    Strings(Arc<[Arc<str>]>),
    Nodes(Arc<[NodeId]>),
}

impl Value {
    /// One node.
    pub(super) fn node(id: NodeId) -> Self {
        Self::Nodes([id].into())
    }

    /// The nodes of it; none of any other value.
    pub(crate) fn nodes(&self) -> &[NodeId] {
        if let Self::Nodes(ids) = self { ids } else { &[] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_has_its_name_and_its_row() {
        for (at, (base, name, ..)) in BASES.iter().enumerate() {
            assert_eq!(*base as usize, at, "{name}");
            for (many, prefix) in [(false, "SF"), (true, "MF")] {
                let ty = FieldType { base: *base, many };
                assert_eq!(FieldType::parse(&format!("{prefix}{name}")), Some(ty));
                assert_eq!(ty.to_string(), format!("{prefix}{name}"));
            }
        }
        assert_eq!(FieldType::parse("SFMatrix4"), FieldType::parse("SFMatrix4f"));
        assert!(["SFVec5f", "Vec3f", "XFVec3f", "S", "", "SF\u{e4}"].iter().all(|n| FieldType::parse(n).is_none()));
    }

    #[test]
    fn zeros_have_one_element_or_none() {
        let zero = |n: &str| FieldType::parse(n).unwrap().zero();
        assert_eq!(zero("SFRotation"), Value::Floats([0.0, 0.0, 1.0, 0.0].into()));
        assert_eq!(zero("MFRotation"), Value::Floats([].into()));
        assert_eq!(zero("SFImage"), Value::Ints([0, 0, 0].into()));
        assert_eq!(zero("SFString"), Value::Strings([Arc::from("")].into()));
        assert_eq!(zero("SFNode"), Value::Nodes([].into()));
    }
}
