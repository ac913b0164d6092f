//! Time and interpolation (ISO/IEC 19775-1: 8, 19, 30; Castle's VectorInterpolator).

/// See the head of `table`.
pub(super) const NODES: &str = r#"
TimeSensor in children : Child
  SFTime     [in,out] cycleInterval 1
  SFString   [in,out] description
  SFBool     [in,out] enabled TRUE
  SFBool     [in,out] loop FALSE
  SFTime     [in,out] pauseTime 0
  SFTime     [in,out] resumeTime 0
  SFTime     [in,out] startTime 0
  SFTime     [in,out] stopTime 0
  SFTime     [out] cycleTime
  SFTime     [out] elapsedTime
  SFFloat    [out] fraction_changed
  SFBool     [out] isActive
  SFBool     [out] isPaused
  SFTime     [out] time

abstract Interpolator : Child
  SFFloat    [in] set_fraction
  MFFloat    [in,out] key []
abstract Spline
  SFBool     [in,out] closed FALSE
  SFBool     [in,out] normalizeVelocity FALSE
ColorInterpolator in children : Interpolator
  MFColor    [in,out] keyValue []
  SFColor    [out] value_changed
ColorSetInterpolator in children : Interpolator
  MFColor    [in,out] keyValue []
  MFColor    [out] value_changed
CoordinateInterpolator in children : Interpolator
  MFVec3f    [in,out] keyValue []
  MFVec3f    [out] value_changed
CoordinateInterpolator2D in children : Interpolator
  MFVec2f    [in,out] keyValue []
  MFVec2f    [out] value_changed
NormalInterpolator in children : Interpolator
  MFVec3f    [in,out] keyValue []
  MFVec3f    [out] value_changed
OrientationInterpolator in children : Interpolator
  MFRotation [in,out] keyValue []
  SFRotation [out] value_changed
PositionInterpolator in children : Interpolator
  MFVec3f    [in,out] keyValue []
  SFVec3f    [out] value_changed
PositionInterpolator2D in children : Interpolator
  MFVec2f    [in,out] keyValue []
  SFVec2f    [out] value_changed
ScalarInterpolator in children : Interpolator
  MFFloat    [in,out] keyValue []
  SFFloat    [out] value_changed
VectorInterpolator in children : Interpolator
  MFFloat    [in,out] keyValue []
  MFFloat    [out] value_changed
EaseInEaseOut in children : Interpolator
  MFVec2f    [in,out] easeInEaseOut []
  SFFloat    [out] modifiedFraction_changed
SplinePositionInterpolator in children : Interpolator Spline
  MFVec3f    [in,out] keyValue []
  MFVec3f    [in,out] keyVelocity []
  SFVec3f    [out] value_changed
SplinePositionInterpolator2D in children : Interpolator Spline
  MFVec2f    [in,out] keyValue []
  MFVec2f    [in,out] keyVelocity []
  SFVec2f    [out] value_changed
SplineScalarInterpolator in children : Interpolator Spline
  MFFloat    [in,out] keyValue []
  MFFloat    [in,out] keyVelocity []
  SFFloat    [out] value_changed
SquadOrientationInterpolator in children : Interpolator
  MFRotation [in,out] keyValue []
  SFBool     [in,out] normalizeVelocity FALSE
  SFRotation [out] value_changed
abstract Sequencer : Interpolator
  SFBool     [in] next
  SFBool     [in] previous
BooleanSequencer in children : Sequencer
  MFBool     [in,out] keyValue []
  SFBool     [out] value_changed
IntegerSequencer in children : Sequencer
  MFInt32    [in,out] keyValue []
  SFInt32    [out] value_changed
"#;
