//! Nodes of the standard that a bake has no use for, or that are not read yet. They are here so that a file with a sensor is not told that
//! it has an unknown node, that the events of common sensors are checked like others, and that lines and points are named for what they
//! are. Their fields are those that a ROUTE or a USE may touch; others of theirs are not looked at.

/// See the head of `table`.
pub(super) const NODES: &str = r#"
abstract Sensor : Child
  SFString   [in,out] description
  SFBool     [in,out] enabled TRUE
  SFBool     [out] isActive
abstract Touching : Sensor
  SFBool     [out] isOver
abstract Dragging : Touching
  SFBool     [in,out] autoOffset TRUE
  SFVec3f    [out] trackPoint_changed
TouchSensor in children skipped : Touching
  SFVec3f    [out] hitNormal_changed
  SFVec3f    [out] hitPoint_changed
  SFVec2f    [out] hitTexCoord_changed
  SFTime     [out] touchTime
PlaneSensor in children skipped : Dragging
  SFVec3f    [out] translation_changed
SphereSensor in children skipped : Dragging
  SFRotation [out] rotation_changed
CylinderSensor in children skipped : Dragging
  SFRotation [out] rotation_changed
ProximitySensor in children skipped : Sensor
  SFVec3f    [out] centerOfRotation_changed
  SFTime     [out] enterTime
  SFTime     [out] exitTime
  SFRotation [out] orientation_changed
  SFVec3f    [out] position_changed
VisibilitySensor in children skipped : Sensor
  SFTime     [out] enterTime
  SFTime     [out] exitTime
KeySensor in children skipped : Sensor
StringSensor in children skipped : Sensor
LoadSensor in children skipped : Sensor
TransformSensor in children skipped : Sensor
Script in children skipped : Child
BooleanFilter in children skipped : Child
BooleanToggle in children skipped : Child
BooleanTrigger in children skipped : Child
IntegerTrigger in children skipped : Child
TimeTrigger in children skipped : Child
Sound in children skipped : Child
  SFNode     [in,out] source NULL
SpatialSound in children skipped : Child
AudioClip in source skipped : Node
MovieTexture in texture skipped : Node
Text in geometry skipped : Node
  SFNode     [in,out] fontStyle NULL
Text3D in geometry skipped : Node
  SFNode     [in,out] fontStyle NULL
FontStyle in fontStyle skipped : Node
ScreenFontStyle in fontStyle skipped : Node
IndexedLineSet in geometry skipped : Node
  SFNode     [in,out] color NULL
  SFNode     [in,out] coord NULL
LineSet in geometry skipped : Node
  SFNode     [in,out] color NULL
  SFNode     [in,out] coord NULL
PointSet in geometry skipped : Node
  SFNode     [in,out] color NULL
  SFNode     [in,out] coord NULL
Arc2D in geometry skipped : Node
Circle2D in geometry skipped : Node
Polyline2D in geometry skipped : Node
Polypoint2D in geometry skipped : Node
FillProperties in fillProperties skipped : Node
LineProperties in lineProperties skipped : Node
PointProperties in pointProperties skipped : Node
BlendMode in blendMode skipped : Node
ImageTexture3D in texture skipped : Node
PixelTexture3D in texture skipped : Node
ComposedTexture3D in texture skipped : Node
RenderedTexture in texture skipped : Node
Effect in effects skipped : Node
EffectPart in parts skipped : Node
TextureProjector in children skipped : Child
TextureProjectorParallel in children skipped : Child
TextureProjectorPoint in children skipped : Child
Viewport in viewport skipped : Node
LayoutLayer in layers skipped : Node
NurbsPatchSurface in geometry skipped : Node
NurbsTrimmedSurface in geometry skipped : Node
NurbsSweptSurface in geometry skipped : Node
NurbsSwungSurface in geometry skipped : Node
NurbsCurve in geometry skipped : Node
HAnimMotion in motions skipped : Node
GeoLocation in children skipped : Child
GeoTransform in children skipped : Child
GeoViewpoint in children skipped : Child
GeoElevationGrid in geometry skipped : Node
GeoOrigin in geoOrigin skipped : Node
GeoCoordinate in coord skipped : Node
ScreenGroup in children skipped : Child
GeoLOD in children skipped : Child
GeoMetadata in children skipped : Child
GeoTouchSensor in children skipped : Sensor
GeoProximitySensor in children skipped : Sensor
NurbsSet in children skipped : Child
NurbsOrientationInterpolator in children skipped : Child
NurbsPositionInterpolator in children skipped : Child
NurbsSurfaceInterpolator in children skipped : Child
NurbsTextureCoordinate in texCoord skipped : Node
Contour2D in trimmingContour skipped : Node
LinePickSensor in children skipped : Sensor
PointPickSensor in children skipped : Sensor
PrimitivePickSensor in children skipped : Sensor
VolumePickSensor in children skipped : Sensor
RigidBodyCollection in children skipped : Child
CollisionSensor in children skipped : Sensor
CollidableShape in children skipped : Child
CollidableOffset in children skipped : Child
CollisionCollection in children skipped : Child
RigidBody in bodies skipped : Node
VolumeData in children skipped : Child
SegmentedVolumeData in children skipped : Child
IsoSurfaceVolumeData in children skipped : Child
ReceiverPdu in children skipped : Child
SignalPdu in children skipped : Child
TransmitterPdu in children skipped : Child
DISEntityManager in children skipped : Child
DISEntityTypeMapping in children skipped : Child
ListenerPointSource in children skipped : Child
AcousticProperties in acousticProperties skipped : Node
ColorDamper in children skipped : Child
CoordinateDamper in children skipped : Child
OrientationChaser in children skipped : Child
OrientationDamper in children skipped : Child
PositionChaser in children skipped : Child
PositionChaser2D in children skipped : Child
PositionDamper in children skipped : Child
PositionDamper2D in children skipped : Child
ScalarChaser in children skipped : Child
ScalarDamper in children skipped : Child
CoordinateChaser in children skipped : Child
TexCoordChaser2D in children skipped : Child
TexCoordDamper2D in children skipped : Child
ParticleSystem in children skipped : Child
"#;
