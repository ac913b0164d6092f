//! Core, grouping, networking, CAD and information nodes (ISO/IEC 19775-1: 7, 9, 10, 32, 35; VRML97: 6; Castle's MatrixTransform).

/// See the head of `table`.
pub(super) const NODES: &str = r#"
abstract Node
  SFNode     [in,out] metadata NULL
abstract Child : Node
abstract Bounded
  SFVec3f    [] bboxCenter 0 0 0
  SFVec3f    [] bboxSize -1 -1 -1
  SFBool     [in,out] bboxDisplay FALSE
  SFBool     [in,out] visible TRUE
abstract Grouping : Child Bounded
  MFNode     [in] addChildren
  MFNode     [in] removeChildren
  MFNode     [in,out] children []
abstract Address
  SFTime     [in,out] autoRefresh 0
  SFTime     [in,out] autoRefreshTimeLimit 3600
  SFString   [in,out] description
  SFBool     [in,out] load TRUE
  MFString   [in,out] url []
abstract Placed
  SFVec3f    [in,out] center 0 0 0
  SFRotation [in,out] rotation 0 0 1 0
  SFVec3f    [in,out] scale 1 1 1
  SFRotation [in,out] scaleOrientation 0 0 1 0
  SFVec3f    [in,out] translation 0 0 0

Group in children : Grouping
StaticGroup in children : Grouping
PickableGroup in children : Grouping
  MFString   [in,out] objectType "ALL"
  SFBool     [in,out] pickable TRUE
Transform in children : Grouping Placed
EspduTransform in children : Grouping Placed
MatrixTransform in children : Grouping
  SFMatrix4f [in,out] matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
Switch in children : Child Bounded
  MFNode     [in] addChildren
  MFNode     [in] removeChildren
  MFNode     [in,out] children|choice [] else WorldInfo
  SFInt32    [in,out] whichChoice -1
LOD in children : Child Bounded
  MFNode     [in] addChildren
  MFNode     [in] removeChildren
  MFNode     [in,out] children|level []
  SFVec3f    [] center 0 0 0
  SFBool     [] forceTransitions FALSE
  MFFloat    [] range []
  SFInt32    [out] level_changed
Collision in children : Grouping
  SFBool     [in,out] enabled|collide TRUE
  SFNode     [] proxy NULL
  SFTime     [out] collideTime
  SFBool     [out] isActive
Anchor in children : Grouping Address
  MFString   [in,out] parameter []
Billboard in children : Grouping
  SFVec3f    [in,out] axisOfRotation 0 1 0
Inline in children : Child Bounded Address
  SFBool     [in,out] global FALSE
KambiInline in children : Child Bounded Address
  SFBool     [in,out] global FALSE
  MFString   [in,out] replaceNames []
  MFNode     [in,out] replaceNodes []
LayerSet in children : Child
  SFInt32    [in,out] activeLayer 0
  MFNode     [in,out] layers [] else Layer
  MFInt32    [in,out] order 0
Layer in layers : Grouping
  MFString   [in,out] objectType "ALL"
  SFBool     [in,out] pickable|isPickable TRUE
  SFNode     [in,out] viewport NULL
CADLayer in children : Grouping
  MFNode     [in,out] children [] else WorldInfo
  SFString   [in,out] name
  MFBool     [in,out] visible TRUE
CADAssembly in children : Grouping
  SFString   [in,out] name
CADPart in children : Grouping Placed
  SFString   [in,out] name
CADFace in children : Child Bounded
  SFString   [in,out] name
  SFNode     [in,out] shape NULL
Shape in children : Child Bounded
  SFNode     [in,out] appearance NULL
  SFNode     [in,out] geometry NULL
  SFBool     [in,out] castShadow TRUE
  SFString   [in,out] shading "DEFAULT"
  SFBool     [in,out] render TRUE
  MFNode     [in,out] collision []

WorldInfo in children : Child
  MFString   [] info []
  SFString   [] title
abstract Metadata : Node
  SFString   [in,out] name
  SFString   [in,out] reference
MetadataBoolean in metadata : Metadata
  MFBool     [in,out] value []
MetadataDouble in metadata : Metadata
  MFDouble   [in,out] value []
MetadataFloat in metadata : Metadata
  MFFloat    [in,out] value []
MetadataInteger in metadata : Metadata
  MFInt32    [in,out] value []
MetadataString in metadata : Metadata
  MFString   [in,out] value []
MetadataSet in metadata : Metadata
  MFNode     [in,out] value []
"#;
