//! Geometry and what it is made of (ISO/IEC 19775-1: 11, 13, 14; Castle's texture coordinates and subdivisions of primitives).

/// See the head of `table`.
pub(super) const NODES: &str = r#"
abstract Composed : Node
  MFNode     [in,out] attrib []
  SFNode     [in,out] color NULL
  SFNode     [in,out] coord NULL
  SFNode     [in,out] fogCoord NULL
  SFNode     [in,out] normal NULL
  SFNode     [in,out] tangent NULL
  SFNode     [in,out] texCoord NULL
  SFBool     [] ccw TRUE
  SFBool     [] colorPerVertex TRUE
  SFBool     [] normalPerVertex TRUE
  SFBool     [] solid TRUE
abstract Indexed : Composed
  MFInt32    [in] set_index
  MFInt32    [] index []
abstract Solid : Node
  SFBool     [] solid TRUE
  SFNode     [in,out] texCoord NULL
abstract Round : Solid
  SFInt32    [in,out] slices -1
  SFInt32    [in,out] stacks -1
abstract Flat : Node
  SFBool     [] solid FALSE

IndexedFaceSet in geometry : Composed
  MFInt32    [in] set_colorIndex
  MFInt32    [in] set_coordIndex
  MFInt32    [in] set_normalIndex
  MFInt32    [in] set_texCoordIndex
  MFInt32    [] colorIndex []
  SFBool     [] convex TRUE
  MFInt32    [] coordIndex []
  SFFloat angle [] creaseAngle 0
  MFInt32    [] normalIndex []
  MFInt32    [] texCoordIndex []
  MFString   [in,out] radianceTransfer []
IndexedTriangleSet in geometry : Indexed
IndexedTriangleFanSet in geometry : Indexed
IndexedTriangleStripSet in geometry : Indexed
IndexedQuadSet in geometry : Indexed
TriangleSet in geometry : Composed
TriangleFanSet in geometry : Composed
  MFInt32    [in,out] fanCount []
TriangleStripSet in geometry : Composed
  MFInt32    [in,out] stripCount []
QuadSet in geometry : Composed
Box in geometry : Solid
  SFVec3f    [] size 2 2 2
  SFInt32    [in,out] divisions -1
Sphere in geometry : Round
  SFFloat    [] radius 1
Cone in geometry : Round
  SFBool     [] bottom TRUE
  SFFloat    [] bottomRadius 1
  SFFloat    [] height 2
  SFBool     [] side TRUE
Cylinder in geometry : Round
  SFBool     [] bottom TRUE
  SFFloat    [] height 2
  SFFloat    [] radius 1
  SFBool     [] side TRUE
  SFBool     [] top TRUE
ElevationGrid in geometry : Node
  MFFloat    [in] set_height
  MFNode     [in,out] attrib []
  SFNode     [in,out] color NULL
  SFNode     [in,out] fogCoord NULL
  SFNode     [in,out] normal NULL
  SFNode     [in,out] tangent NULL
  SFNode     [in,out] texCoord NULL
  SFBool     [] ccw TRUE
  SFBool     [] colorPerVertex TRUE
  SFFloat angle [] creaseAngle 0
  MFFloat    [] height []
  SFBool     [] normalPerVertex TRUE
  SFBool     [] solid TRUE
  SFInt32    [] xDimension 0
  SFFloat    [] xSpacing 1
  SFInt32    [] zDimension 0
  SFFloat    [] zSpacing 1
Extrusion in geometry : Node
  MFVec2f    [in] set_crossSection
  MFRotation [in] set_orientation
  MFVec2f    [in] set_scale
  MFVec3f    [in] set_spine
  SFBool     [] beginCap TRUE
  SFBool     [] ccw TRUE
  SFBool     [] convex TRUE
  SFFloat angle [] creaseAngle 0
  MFVec2f    [] crossSection 1 1 1 -1 -1 -1 -1 1 1 1
  SFBool     [] endCap TRUE
  MFRotation [] orientation 0 0 1 0
  MFVec2f    [] scale 1 1
  SFBool     [] solid TRUE
  MFVec3f    [] spine 0 0 0 0 1 0
  SFNode     [in,out] texCoord NULL
Rectangle2D in geometry : Flat
  SFVec2f    [] size 2 2
Disk2D in geometry : Flat
  SFFloat    [] innerRadius 0
  SFFloat    [] outerRadius 1
ArcClose2D in geometry : Flat
  SFString   [] closureType "PIE"
  SFFloat angle [] endAngle 1.570796
  SFFloat    [] radius 1
  SFFloat angle [] startAngle 0
TriangleSet2D in geometry : Flat
  MFVec2f    [in,out] vertices []

Coordinate in coord : Node
  MFVec3f    [in,out] point []
CoordinateDouble in coord : Node
  MFVec3d    [in,out] point []
Color in color : Node
  MFColor    [in,out] color []
ColorRGBA in color : Node
  MFColorRGBA [in,out] color []
Normal in normal : Node
  MFVec3f    [in,out] vector []
Tangent in tangent : Node
  MFVec4f    [in,out] vector []
FogCoordinate in fogCoord : Node
  MFFloat    [in,out] depth []
FloatVertexAttribute in attrib : Node
  SFString   [] name
  SFInt32    [] numComponents 4
  MFFloat    [in,out] value []
Matrix3VertexAttribute in attrib : Node
  SFString   [] name
  MFMatrix3f [in,out] value []
Matrix4VertexAttribute in attrib : Node
  SFString   [] name
  MFMatrix4f [in,out] value []
"#;
