//! Viewpoints, navigation and surroundings (ISO/IEC 19775-1: 23, 24; Castle's KambiNavigationInfo).

/// See the head of `table`.
pub(super) const NODES: &str = r#"
abstract Bindable : Child
  SFBool     [in] set_bind
  SFTime     [out] bindTime
  SFBool     [out] isBound
abstract AnyViewpoint : Bindable
  SFVec3f    [in,out] centerOfRotation 0 0 0
  SFString   [in,out] description
  SFFloat    [in,out] farDistance -1
  SFBool     [in,out] jump TRUE
  SFFloat    [in,out] nearDistance -1
  SFNode     [in,out] navigationInfo NULL
  SFRotation [in,out] orientation 0 0 1 0
  SFVec3f    [in,out] position 0 0 10
  SFBool     [in,out] retainUserOffsets FALSE
  SFBool     [in,out] viewAll FALSE
  SFVec3f    [in,out] gravityUp 0 1 0
  SFFloat    [in,out] projectionNear 0
  SFFloat    [in,out] projectionFar 0
Viewpoint in children : AnyViewpoint
  SFFloat angle [in,out] fieldOfView 0.78539816
OrthoViewpoint in children : AnyViewpoint
  MFFloat    [in,out] fieldOfView -1 -1 1 1
ViewpointGroup in children : Child
  SFVec3f    [in,out] center 0 0 0
  MFNode     [in,out] children []
  SFString   [in,out] description
  SFBool     [in,out] displayed TRUE
  SFBool     [in,out] retainUserOffsets FALSE
  SFVec3f    [in,out] size 0 0 0
NavigationInfo in children : Bindable
  MFFloat    [in,out] avatarSize 0.25 1.6 0.75
  SFBool     [in,out] headlight TRUE
  SFFloat    [in,out] speed 1
  MFTime     [in,out] transitionTime 1
  MFString   [in,out] transitionType "LINEAR"
  MFString   [in,out] type "EXAMINE" "ANY"
  SFFloat    [in,out] visibilityLimit 0
  SFBool     [out] transitionComplete
KambiNavigationInfo in children : Bindable
  MFFloat    [in,out] avatarSize 0.25 1.6 0.75
  SFBool     [in,out] headlight TRUE
  SFNode     [in,out] headlightNode NULL
  SFFloat    [in,out] speed 1
  MFTime     [in,out] transitionTime 1
  MFString   [in,out] transitionType "LINEAR"
  MFString   [in,out] type "EXAMINE" "ANY"
  SFFloat    [in,out] visibilityLimit 0
abstract Sky : Bindable
  MFFloat angle [in,out] groundAngle []
  MFColor    [in,out] groundColor []
  MFFloat angle [in,out] skyAngle []
  MFColor    [in,out] skyColor 0 0 0
  SFFloat    [in,out] transparency 0
Background in children : Sky
  MFString   [in,out] backUrl []
  MFString   [in,out] bottomUrl []
  MFString   [in,out] frontUrl []
  MFString   [in,out] leftUrl []
  MFString   [in,out] rightUrl []
  MFString   [in,out] topUrl []
TextureBackground in children : Sky
  SFNode     [in,out] backTexture NULL
  SFNode     [in,out] bottomTexture NULL
  SFNode     [in,out] frontTexture NULL
  SFNode     [in,out] leftTexture NULL
  SFNode     [in,out] rightTexture NULL
  SFNode     [in,out] topTexture NULL
abstract AnyFog
  SFColor    [in,out] color 1 1 1
  SFString   [in,out] fogType "LINEAR"
  SFFloat    [in,out] visibilityRange 0
Fog in children : Bindable AnyFog
LocalFog in children : Child AnyFog
  SFBool     [in,out] enabled TRUE
"#;
