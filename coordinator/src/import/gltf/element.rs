//! The elements of accessors: components of six types in seven shapes (glTF 2.0, section 3.6.2.2).

/// The type of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

/// Columns and rows of an element; a vector is one column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    /// As files call it.
    pub(super) name: &'static str,
    pub(super) columns: usize,
    pub(super) rows: usize,
}

/// All there are.
const SHAPES: [Shape; 7] = [
    Shape { name: "SCALAR", columns: 1, rows: 1 },
    Shape { name: "VEC2", columns: 1, rows: 2 },
    Shape { name: "VEC3", columns: 1, rows: 3 },
    Shape { name: "VEC4", columns: 1, rows: 4 },
    Shape { name: "MAT2", columns: 2, rows: 2 },
    Shape { name: "MAT3", columns: 3, rows: 3 },
    Shape { name: "MAT4", columns: 4, rows: 4 },
];

impl Component {
    /// The type of this number.
    pub(super) fn of(code: u64) -> Option<Self> {
        [Self::I8, Self::U8, Self::I16, Self::U16, Self::U32, Self::F32].into_iter().find(|c| u64::from(c.code()) == code)
    }

    /// The number that stands for it in a file.
    pub(super) fn code(self) -> u32 {
        match self {
            Self::I8 => 5120,
            Self::U8 => 5121,
            Self::I16 => 5122,
            Self::U16 => 5123,
            Self::U32 => 5125,
            Self::F32 => 5126,
        }
    }

    /// Bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// One component from its bytes, little-endian; zero where there are too few.
    pub(super) fn read(self, b: &[u8]) -> f64 {
        match (self, b) {
            (Self::I8, [a, ..]) => f64::from(*a as i8),
            (Self::U8, [a, ..]) => f64::from(*a),
            (Self::I16, [a, b, ..]) => f64::from(i16::from_le_bytes([*a, *b])),
            (Self::U16, [a, b, ..]) => f64::from(u16::from_le_bytes([*a, *b])),
            (Self::U32, [a, b, c, d, ..]) => f64::from(u32::from_le_bytes([*a, *b, *c, *d])),
            (Self::F32, [a, b, c, d, ..]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            _ => 0.0,
        }
    }

    /// What an integer stands for where it is normalized (glTF 2.0, section 3.6.2.2).
    pub(super) fn normal(self, v: f64) -> f64 {
        match self {
            Self::I8 => (v / 127.0).max(-1.0),
            Self::U8 => v / 255.0,
            Self::I16 => (v / 32_767.0).max(-1.0),
            Self::U16 => v / 65_535.0,
            Self::U32 | Self::F32 => v,
        }
    }
}

impl Shape {
    /// A single number.
    pub(super) const SCALAR: Shape = SHAPES[0];

    /// The shape of this name.
    pub(super) fn of(name: &str) -> Option<Self> {
        SHAPES.into_iter().find(|s| s.name == name)
    }

    /// Bytes from column to column: columns of matrices begin at multiples of 4.
    pub(super) fn column(self, component: Component) -> usize {
        let bytes = self.rows * component.size();
        if self.columns > 1 { bytes.next_multiple_of(4) } else { bytes }
    }

    /// Bytes from the first to the last component.
    pub(super) fn size(self, component: Component) -> usize {
        self.column(component) * (self.columns - 1) + self.rows * component.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_little_endian_and_normalized_symmetrically() {
        assert_eq!(Component::I16.read(&[0x01, 0x80]), -32_767.0);
        assert_eq!(Component::U32.read(&[1, 0, 0, 0x80]), 2_147_483_649.0);
        assert_eq!(Component::F32.read(&1.5f32.to_le_bytes()), 1.5);
        assert_eq!(Component::F32.read(&[1, 2]), 0.0);
        assert_eq!([Component::I8.normal(-128.0), Component::I8.normal(127.0), Component::U16.normal(65_535.0)], [-1.0, 1.0, 1.0]);
        assert_eq!((Component::of(5126), Component::of(5124)), (Some(Component::F32), None));
    }

    #[test]
    fn columns_of_matrices_begin_at_multiples_of_four() {
        let size = |name: &str, component| Shape::of(name).map(|s| (s.column(component), s.size(component)));
        assert_eq!(size("MAT2", Component::U8), Some((4, 6)));
        assert_eq!(size("MAT3", Component::U8), Some((4, 11)));
        assert_eq!(size("MAT3", Component::I16), Some((8, 22)));
        assert_eq!(size("MAT4", Component::F32), Some((16, 64)));
        assert_eq!(size("VEC3", Component::U8), Some((3, 3)));
        assert_eq!(size("VEC5", Component::U8), None);
    }
}
