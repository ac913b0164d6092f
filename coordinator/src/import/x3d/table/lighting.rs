//! Lights (ISO/IEC 19775-1: 17) with the shadow and projection fields of Kamburelis, "Shadow maps and projective texturing in X3D",
//! Web3D 2010: a light as a camera.

/// See the head of `table`.
pub(super) const NODES: &str = r#"
abstract Light : Child
  SFFloat    [in,out] ambientIntensity 0
  SFColor    [in,out] color 1 1 1
  SFFloat    [in,out] intensity 1
  SFBool     [in,out] on TRUE
  SFBool     [in,out] shadows FALSE
  SFFloat    [in,out] shadowIntensity 1
  SFNode     [] defaultShadowMap NULL
  SFFloat    [in,out] projectionNear 0
  SFFloat    [in,out] projectionFar 0
  SFVec3f    [in,out] up 0 0 0
  SFBool     [in,out] shadowVolumes|kambiShadows FALSE
  SFBool     [in,out] shadowVolumesMain|kambiShadowsMain FALSE
  MFNode     [in,out] effects []
DirectionalLight in children : Light
  SFVec3f    [in,out] direction 0 0 -1
  SFBool     [in,out] global FALSE
  SFVec4f    [in,out] projectionRectangle 0 0 0 0
  SFVec3f    [in,out] projectionLocation 0 0 0
PointLight in children : Light
  SFVec3f    [in,out] attenuation 1 0 0
  SFBool     [in,out] global TRUE
  SFVec3f    [in,out] location 0 0 0
  SFFloat    [in,out] radius 100
SpotLight in children : Light
  SFVec3f    [in,out] attenuation 1 0 0
  SFFloat angle [in,out] beamWidth 1.5707964 since 3.3 0.78539816
  SFFloat angle [in,out] cutOffAngle 0.78539816 since 3.3 1.5707964
  SFVec3f    [in,out] direction 0 0 -1
  SFBool     [in,out] global TRUE
  SFVec3f    [in,out] location 0 0 0
  SFFloat angle [in,out] projectionAngle 0
  SFFloat    [in,out] radius 100
EnvironmentLight in children : Light
  SFBool     [in,out] global FALSE
  MFFloat    [in,out] diffuseCoefficients []
  SFNode     [in,out] diffuseTexture NULL
  SFVec3f    [in,out] origin 0 0 0
  SFRotation [in,out] rotation 0 0 1 0
  SFNode     [in,out] specularTexture NULL
"#;
