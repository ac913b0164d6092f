//! The colours of a shape's vertices, which take the place of its material's (ISO/IEC 19775-1: 11.4.2 and 11.4.3).

use crate::import::{mesh::Mesh, surfaces::mean_colour, x3d::NodeRef};
use kiln_proto::units::Rgb;

/// What a material has to know of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Colours {
    /// Whether they have an opacity of their own (ColorRGBA), which takes the place of the material's.
    pub(super) has_alpha: bool,
    /// Whether one of them is not opaque.
    pub(super) transparent: bool,
    /// Whether they are not all the same.
    pub(super) vary: bool,
    /// Their mean over the corners.
    pub(super) mean: Rgb,
}

impl Colours {
    /// Those of a geometry node that this mesh was made of; `None` where there are none.
    pub(super) fn of(geometry: NodeRef<'_>, mesh: &Mesh) -> Option<Self> {
        let channel = mesh.colours.as_ref()?;
        let has_alpha = geometry.node("color").is_some_and(|c| c.kind() == "ColorRGBA");
        let transparent = channel.values.iter().any(|c| c[3] < 1.0);
        let vary = channel.values.windows(2).any(|w| w[0][..3] != w[1][..3]);
        let mean = mean_colour((0..mesh.corners.len()).map(|corner| channel.get(corner)))?;
        Some(Self { has_alpha, transparent, vary, mean: Rgb::from(mean) })
    }
}
