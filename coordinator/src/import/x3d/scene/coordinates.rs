//! Where the textures of a shape get their coordinates from: the `texCoord` field, one source per texture (ISO/IEC 19775-1: 18.2.3).

use crate::import::{findings::Findings, x3d::NodeRef};
use kiln_proto::limits;

/// Where one texture's coordinates come from.
#[derive(Debug, Clone, Copy)]
pub(super) enum Source<'d> {
    /// A list of the author's: which coordinate set of the mesh.
    Set(u32),
    /// The bounding-box mapping, which is what geometry without `texCoord` has (the primitives have their own).
    Automatic,
    /// Through a light or viewpoint.
    Projected(NodeRef<'d>),
}

/// The sources of a shape, one per texture in order, and the lists that they name.
#[derive(Debug, Clone, Default)]
pub(super) struct Coordinates<'d> {
    sources: Vec<(&'d str, Source<'d>)>,
    /// Points of each of the author's lists, until the mesh takes them.
    pub(super) lists: Vec<Vec<[f32; 2]>>,
    /// The coordinate set of the automatic mapping: the one behind the author's.
    pub(super) automatic: u32,
}

impl<'d> Coordinates<'d> {
    /// Reads the `texCoord` field of a geometry node.
    pub(super) fn of(geometry: NodeRef<'d>, findings: &mut Findings) -> Self {
        let mut out = Self::default();
        if !geometry.has("texCoord") {
            return out;
        }
        for node in geometry.children("texCoord") {
            if matches!(node.kind(), "MultiTextureCoordinate" | "MultiGeneratedTextureCoordinate") {
                node.children("texCoord").for_each(|n| out.add(n, findings));
            } else {
                out.add(node, findings);
            }
        }
        out
    }

    fn add(&mut self, node: NodeRef<'d>, findings: &mut Findings) {
        let source = match node.kind() {
            "TextureCoordinate" | "TextureCoordinate3D" | "TextureCoordinate4D" if self.lists.len() + 1 >= limits::UV_SETS => {
                findings.count(node.at(), "coordinates of more textures than a surface can have sets for became automatic");
                Source::Automatic
            }
            "TextureCoordinate" => self.list(node.mf_vec2("point").into_owned()),
            // The third coordinate is for volume textures; the fourth divides (ISO/IEC 19775-1: 33.4.6).
            "TextureCoordinate3D" => self.list(node.mf_vec3("point").iter().map(|p| [p[0], p[1]]).collect()),
            "TextureCoordinate4D" => {
                let divide = |p: &[f32; 4]| if p[3] == 0.0 { [0.0; 2] } else { [p[0] / p[3], p[1] / p[3]] };
                self.list(node.mf_vec4("point").iter().map(divide).collect())
            }
            "ProjectedTextureCoordinate" => match node.node("projector") {
                Some(projector) => Source::Projected(projector),
                None => {
                    findings.warn(node.at(), "ProjectedTextureCoordinate has no projector; its texture gets automatic coordinates");
                    Source::Automatic
                }
            },
            "TextureCoordinateGenerator" => {
                let mode = node.string("mode");
                if mode != "BOUNDS" && mode != "COORD" {
                    let message =
                        format!("TextureCoordinateGenerator {mode} depends on the viewer or is not known; automatic coordinates are used");
                    findings.warn(node.at_field("mode"), message);
                }
                Source::Automatic
            }
            other => {
                findings.warn(node.at(), format!("{other} gives no texture coordinates; automatic ones are used"));
                Source::Automatic
            }
        };
        let mapping = if node.has("mapping") { node.string("mapping") } else { "" };
        self.sources.push((mapping, source));
    }

    fn list(&mut self, points: Vec<[f32; 2]>) -> Source<'d> {
        if points.is_empty() {
            return Source::Automatic;
        }
        self.lists.push(points);
        self.automatic = self.lists.len() as u32;
        Source::Set(self.automatic - 1)
    }

    /// The source of the texture at this place of the list; beyond its end, that of the last.
    pub(super) fn at(&self, texture: usize) -> Source<'d> {
        let last = self.sources.len().saturating_sub(1);
        self.sources.get(texture.min(last)).map_or(Source::Automatic, |(_, source)| *source)
    }

    /// The source of this mapping name (X3D 4); the first where no source has the name.
    pub(super) fn named(&self, mapping: &str) -> Source<'d> {
        let found = self.sources.iter().find(|(name, _)| !mapping.is_empty() && *name == mapping);
        found.map_or_else(|| self.at(0), |(_, source)| *source)
    }
}
