//! Humanoids (ISO/IEC 19775-1: 26): joints, segments and sites are groups with places. `Placed`, `Child` and `Grouping` are `core`'s.

/// See the head of `table`.
pub(super) const NODES: &str = r#"
HAnimHumanoid in children : Child Bounded Placed
  MFNode     [in,out] jointBindingPositions []
  MFNode     [in,out] joints []
  SFInt32    [in,out] loa -1
  MFNode     [in,out] motions []
  SFString   [in,out] name
  MFNode     [in,out] segments []
  MFNode     [in,out] sites []
  SFString   [in,out] skeletalConfiguration "BASIC"
  MFNode     [in,out] skeleton|humanoidBody []
  MFNode     [in,out] skin []
  SFNode     [in,out] skinCoord NULL
  SFNode     [in,out] skinNormal NULL
  SFString   [in,out] version
  MFNode     [in,out] viewpoints []
  MFString   [in,out] info []
HAnimJoint in children : Grouping Placed
  MFNode     [in,out] displacers []
  SFRotation [in,out] limitOrientation 0 0 1 0
  MFFloat    [in,out] llimit []
  SFString   [in,out] name
  MFInt32    [in,out] skinCoordIndex []
  MFFloat    [in,out] skinCoordWeight []
  MFFloat    [in,out] stiffness 0 0 0
  MFFloat    [in,out] ulimit []
HAnimSegment in children : Grouping
  SFVec3f    [in,out] centerOfMass 0 0 0
  SFNode     [in,out] coord NULL
  MFNode     [in,out] displacers []
  SFFloat    [in,out] mass 0
  MFFloat    [in,out] momentsOfInertia 0 0 0 0 0 0 0 0 0
  SFString   [in,out] name
HAnimSite in children : Grouping Placed
  SFString   [in,out] name
HAnimDisplacer in displacers : Node
  MFInt32    [in,out] coordIndex []
  MFVec3f    [in,out] displacements []
  SFString   [in,out] name
  SFFloat    [in,out] weight 0
"#;
