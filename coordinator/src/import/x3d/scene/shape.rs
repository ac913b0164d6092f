//! From a geometry node to a mesh: the fields that `geometry` asks for, with the property nodes' lists in place of the nodes.

use super::coordinates::Coordinates;
use crate::import::{
    findings::Findings,
    mesh::box_mapping,
    x3d::{
        NodeRef,
        geometry::{
            ArcClose2D, BoxNode, Composed, Cone, Cylinder, Disk2D, ElevationGrid, Extrusion, Geometry, GeometryError, IndexedFaceSet,
            IndexedQuadSet, IndexedTriangleFanSet, IndexedTriangleSet, IndexedTriangleStripSet, QuadSet, Rectangle2D, Sphere,
            TriangleFanSet, TriangleSet, TriangleSet2D, TriangleStripSet,
        },
    },
};

/// The mesh of a geometry node in its own space, with a set of texture coordinates for each list and an automatic one after them; `None`
/// where there is none, which is said.
pub(super) fn mesh(node: NodeRef<'_>, coordinates: &mut Coordinates<'_>, findings: &mut Findings) -> Option<Geometry> {
    if !node.has("coord") && node.kind() != "ElevationGrid" {
        coordinates.lists.clear();
        coordinates.automatic = 0;
    }
    let mut geometry = match build(node, std::mem::take(&mut coordinates.lists))? {
        Ok(geometry) => geometry,
        Err(e @ GeometryError::Empty { .. }) => {
            findings.warn(node.at(), format!("{}: {e}; it was left out", node.kind()));
            return None;
        }
        Err(e) => {
            findings.error(node.at(), format!("{}: {e}", node.kind()));
            return None;
        }
    };
    for repair in &geometry.repairs.0 {
        findings.warn(node.at(), format!("{}: {repair}", node.kind()));
    }
    if coordinates.automatic > 0 {
        let automatic = box_mapping(&geometry.mesh);
        geometry.mesh.uv_sets.push(automatic);
    }
    Some(geometry)
}

/// Whether nodes of this kind are points, lines or text, which have no surface.
pub(super) fn has_no_surface(kind: &str) -> bool {
    matches!(kind, "PointSet" | "LineSet" | "IndexedLineSet" | "Polyline2D" | "Polypoint2D" | "Arc2D" | "Circle2D" | "NurbsCurve")
}

/// The geometry, or `None` for a kind that has none here.
fn build(node: NodeRef<'_>, lists: Vec<Vec<[f32; 2]>>) -> Option<Result<Geometry, GeometryError>> {
    let solid = node.has("solid") && node.bool("solid");
    let flag = |name| node.bool(name);
    let float = |name| node.float(name);
    let composed = || composed(node, lists);
    let index = || node.mf_int("index").to_vec();
    Some(match node.kind() {
        "Box" => BoxNode { size: node.vec3("size"), solid }.build(),
        "Sphere" => Sphere { radius: float("radius"), solid }.build(),
        "Cone" => Cone { bottom_radius: float("bottomRadius"), height: float("height"), side: flag("side"), bottom: flag("bottom"), solid }
            .build(),
        "Cylinder" => {
            let (side, top, bottom) = (flag("side"), flag("top"), flag("bottom"));
            Cylinder { radius: float("radius"), height: float("height"), side, top, bottom, solid }.build()
        }
        "IndexedFaceSet" => face_set(node, composed()).build(),
        "IndexedTriangleSet" => IndexedTriangleSet { composed: composed(), index: index() }.build(),
        "IndexedTriangleStripSet" => IndexedTriangleStripSet { composed: composed(), index: index() }.build(),
        "IndexedTriangleFanSet" => IndexedTriangleFanSet { composed: composed(), index: index() }.build(),
        "IndexedQuadSet" => IndexedQuadSet { composed: composed(), index: index() }.build(),
        "TriangleSet" => TriangleSet(composed()).build(),
        "QuadSet" => QuadSet(composed()).build(),
        "TriangleStripSet" => TriangleStripSet { composed: composed(), strip_count: node.mf_int("stripCount").to_vec() }.build(),
        "TriangleFanSet" => TriangleFanSet { composed: composed(), fan_count: node.mf_int("fanCount").to_vec() }.build(),
        "ElevationGrid" => elevation_grid(node, composed()).build(),
        "Extrusion" => extrusion(node).build(),
        "Rectangle2D" => Rectangle2D { size: node.vec2("size"), solid }.build(),
        "Disk2D" => Disk2D { inner_radius: float("innerRadius"), outer_radius: float("outerRadius"), solid }.build(),
        "ArcClose2D" => {
            let closure_type = node.string("closureType").to_owned();
            let (start_angle, end_angle) = (float("startAngle"), float("endAngle"));
            ArcClose2D { closure_type, start_angle, end_angle, radius: float("radius"), solid }.build()
        }
        "TriangleSet2D" => TriangleSet2D { vertices: node.mf_vec2("vertices").into_owned(), solid }.build(),
        _ => return None,
    })
}

/// The fields of X3DComposedGeometryNode that a node has; defaults for the others.
fn composed(node: NodeRef<'_>, tex_coord: Vec<Vec<[f32; 2]>>) -> Composed {
    let list = |field: &str| node.has(field).then(|| node.node(field)).flatten();
    let flag = |field: &str| !node.has(field) || node.bool(field);
    let color = match list("color") {
        Some(c) if c.kind() == "ColorRGBA" => c.mf_vec4("color").into_owned(),
        Some(c) => c.mf_vec3("color").iter().map(|[r, g, b]| [*r, *g, *b, 1.0]).collect(),
        None => vec![],
    };
    Composed {
        coord: list("coord").map(|c| c.mf_vec3("point").into_owned()).unwrap_or_default(),
        normal: list("normal").map(|n| n.mf_vec3("vector").into_owned()).unwrap_or_default(),
        color,
        tex_coord,
        ccw: flag("ccw"),
        color_per_vertex: flag("colorPerVertex"),
        normal_per_vertex: flag("normalPerVertex"),
        solid: flag("solid"),
    }
}

fn face_set(node: NodeRef<'_>, composed: Composed) -> IndexedFaceSet {
    let list = |field| node.mf_int(field).to_vec();
    IndexedFaceSet {
        composed,
        coord_index: list("coordIndex"),
        color_index: list("colorIndex"),
        normal_index: list("normalIndex"),
        tex_coord_index: list("texCoordIndex"),
        crease_angle: node.float("creaseAngle"),
    }
}

fn elevation_grid(node: NodeRef<'_>, composed: Composed) -> ElevationGrid {
    ElevationGrid {
        normal: composed.normal,
        color: composed.color,
        tex_coord: composed.tex_coord,
        ccw: composed.ccw,
        color_per_vertex: composed.color_per_vertex,
        normal_per_vertex: composed.normal_per_vertex,
        solid: composed.solid,
        crease_angle: node.float("creaseAngle"),
        height: node.mf_float("height").into_owned(),
        x_dimension: node.int("xDimension"),
        x_spacing: node.float("xSpacing"),
        z_dimension: node.int("zDimension"),
        z_spacing: node.float("zSpacing"),
    }
}

fn extrusion(node: NodeRef<'_>) -> Extrusion {
    Extrusion {
        begin_cap: node.bool("beginCap"),
        end_cap: node.bool("endCap"),
        ccw: node.bool("ccw"),
        crease_angle: node.float("creaseAngle"),
        cross_section: node.mf_vec2("crossSection").into_owned(),
        orientation: node.mf_vec4("orientation").into_owned(),
        scale: node.mf_vec2("scale").into_owned(),
        solid: node.bool("solid"),
        spine: node.mf_vec3("spine").into_owned(),
    }
}
