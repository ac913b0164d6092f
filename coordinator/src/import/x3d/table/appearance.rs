//! Appearance, materials, textures and shaders (ISO/IEC 19775-1: 12, 18, 31, 33, 34; shadow fields: Kamburelis, "Shadow maps and projective
//! texturing in X3D", Web3D 2010).

/// See the head of `table`.
pub(super) const NODES: &str = r#"
Appearance in appearance : Node
  SFString   [in,out] alphaMode "AUTO"
  SFFloat    [in,out] alphaCutoff 0.5
  SFNode     [in,out] backMaterial NULL
  SFNode     [in,out] fillProperties NULL
  SFNode     [in,out] lineProperties NULL
  SFNode     [in,out] material NULL
  SFNode     [in,out] pointProperties NULL
  MFNode     [in,out] shaders []
  SFNode     [in,out] texture NULL
  SFNode     [in,out] textureTransform NULL
  MFNode     [in,out] receiveShadows []
  SFBool     [in,out] shadowCaster TRUE
  SFString   [in,out] alphaChannel "AUTO"
  SFNode     [in,out] blendMode NULL
  MFNode     [in,out] effects []
  SFNode     [in,out] heightMap NULL
  SFFloat    [in,out] heightMapScale 0.01
  SFNode     [in,out] normalMap NULL

abstract AnyMaterial : Node
  SFColor    [in,out] emissiveColor 0 0 0
  SFNode     [in,out] emissiveTexture NULL
  SFString   [in,out] emissiveTextureMapping
  SFFloat    [in,out] normalScale 1
  SFNode     [in,out] normalTexture NULL
  SFString   [in,out] normalTextureMapping
  SFFloat    [in,out] transparency 0
abstract Lit : AnyMaterial
  SFFloat    [in,out] occlusionStrength 1
  SFNode     [in,out] occlusionTexture NULL
  SFString   [in,out] occlusionTextureMapping
Material in material : Lit
  SFFloat    [in,out] ambientIntensity 0.2
  SFNode     [in,out] ambientTexture NULL
  SFString   [in,out] ambientTextureMapping
  SFColor    [in,out] diffuseColor 0.8 0.8 0.8
  SFNode     [in,out] diffuseTexture NULL
  SFString   [in,out] diffuseTextureMapping
  SFFloat    [in,out] shininess 0.2
  SFNode     [in,out] shininessTexture NULL
  SFString   [in,out] shininessTextureMapping
  SFColor    [in,out] specularColor 0 0 0
  SFNode     [in,out] specularTexture NULL
  SFString   [in,out] specularTextureMapping
  SFFloat    [in,out] mirror 0
  SFBool     [in,out] fogImmune FALSE
PhysicalMaterial in material : Lit
  SFColor    [in,out] baseColor|baseColorFactor 1 1 1
  SFNode     [in,out] baseTexture|baseColorTexture NULL
  SFString   [in,out] baseTextureMapping
  SFColor    [in,out] emissiveColor|emissiveFactor 0 0 0
  SFFloat    [in,out] metallic|metallicFactor 1
  SFNode     [in,out] metallicRoughnessTexture|roughnessMetallicTexture NULL
  SFString   [in,out] metallicRoughnessTextureMapping
  SFFloat    [in,out] roughness|roughnessFactor 1
UnlitMaterial in material : AnyMaterial
  SFColor    [in,out] emissiveColor 1 1 1
TwoSidedMaterial in material : Node
  SFFloat    [in,out] ambientIntensity 0.2
  SFFloat    [in,out] backAmbientIntensity 0.2
  SFColor    [in,out] backDiffuseColor 0.8 0.8 0.8
  SFColor    [in,out] backEmissiveColor 0 0 0
  SFFloat    [in,out] backShininess 0.2
  SFColor    [in,out] backSpecularColor 0 0 0
  SFFloat    [in,out] backTransparency 0
  SFColor    [in,out] diffuseColor 0.8 0.8 0.8
  SFColor    [in,out] emissiveColor 0 0 0
  SFBool     [in,out] separateBackColor FALSE
  SFFloat    [in,out] shininess 0.2
  SFColor    [in,out] specularColor 0 0 0
  SFFloat    [in,out] transparency 0

abstract Texture : Node
  SFString   [in,out] description
abstract Texture2D : Texture
  SFBool     [] repeatS TRUE
  SFBool     [] repeatT TRUE
  SFNode     [] textureProperties NULL
  SFString   [in,out] alphaChannel "AUTO"
ImageTexture in texture : Texture2D Address
  SFBool     [] flipVertically FALSE
PixelTexture in texture : Texture2D
  SFImage    [in,out] image 0 0 0
MultiTexture in texture : Texture
  SFFloat    [in,out] alpha 1
  SFColor    [in,out] color 1 1 1
  MFString   [in,out] function []
  MFString   [in,out] mode []
  MFString   [in,out] source []
  MFNode     [in,out] texture [] else PixelTexture
abstract CubeMap : Texture
  SFNode     [] textureProperties NULL
ComposedCubeMapTexture in texture : CubeMap
  SFNode     [in,out] backTexture|back NULL
  SFNode     [in,out] bottomTexture|bottom NULL
  SFNode     [in,out] frontTexture|front NULL
  SFNode     [in,out] leftTexture|left NULL
  SFNode     [in,out] rightTexture|right NULL
  SFNode     [in,out] topTexture|top NULL
ImageCubeMapTexture in texture : CubeMap Address
GeneratedCubeMapTexture in texture : CubeMap
  SFInt32    [] size 128
  SFString   [in,out] update "NONE"
GeneratedShadowMap in texture : Texture
  SFString   [in,out] update "NONE"
  SFInt32    [] size 128
  SFNode     [] light NULL
  SFFloat    [] scale 1.1
  SFFloat    [] bias 4
  SFString   [] compareMode "COMPARE_R_LEQUAL"
TextureProperties in textureProperties : Node
  SFFloat    [in,out] anisotropicDegree 1
  SFColorRGBA [in,out] borderColor 0 0 0 0
  SFInt32    [in,out] borderWidth 0
  SFString   [in,out] boundaryModeR "REPEAT"
  SFString   [in,out] boundaryModeS "REPEAT"
  SFString   [in,out] boundaryModeT "REPEAT"
  SFString   [in,out] magnificationFilter "FASTEST"
  SFString   [in,out] minificationFilter "FASTEST"
  SFString   [in,out] textureCompression "FASTEST"
  SFFloat    [in,out] texturePriority 0
  SFBool     [] generateMipMaps FALSE
  SFBool     [] guiTexture FALSE
abstract Mapping
  SFString   [in,out] mapping
TextureTransform in textureTransform : Node Mapping
  SFVec2f    [in,out] center 0 0
  SFFloat angle [in,out] rotation 0
  SFVec2f    [in,out] scale 1 1
  SFVec2f    [in,out] translation 0 0
TextureTransform3D in textureTransform : Node Mapping
  SFVec3f    [in,out] center 0 0 0
  SFRotation [in,out] rotation 0 0 1 0
  SFVec3f    [in,out] scale 1 1 1
  SFVec3f    [in,out] translation 0 0 0
TextureTransformMatrix3D in textureTransform : Node Mapping
  SFMatrix4f [in,out] matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
MultiTextureTransform in textureTransform : Node
  MFNode     [in,out] textureTransform [] else TextureTransform
TextureCoordinate in texCoord : Node Mapping
  MFVec2f    [in,out] point []
TextureCoordinate3D in texCoord : Node Mapping
  MFVec3f    [in,out] point []
TextureCoordinate4D in texCoord : Node Mapping
  MFVec4f    [in,out] point []
TextureCoordinateGenerator in texCoord : Node Mapping
  SFString   [in,out] mode "SPHERE"
  MFFloat    [in,out] parameter []
  SFNode     [in,out] projectedLight NULL
MultiTextureCoordinate in texCoord : Node
  MFNode     [in,out] texCoord [] else TextureCoordinate
MultiGeneratedTextureCoordinate in texCoord : Node
  MFNode     [in,out] texCoord [] else TextureCoordinate
ProjectedTextureCoordinate in texCoord : Node Mapping
  SFNode     [in,out] projector NULL

abstract Shader : Node
  SFBool     [in] activate
  SFBool     [out] isSelected
  SFBool     [out] isValid
  SFString   [] language
ComposedShader in shaders : Shader
  MFNode     [in,out] parts []
  SFBool     [in,out] suppressFog FALSE
PackagedShader in shaders : Shader Address
ProgramShader in shaders : Shader
  MFNode     [in,out] programs []
ShaderProgram in programs : Node Address
  SFString   [] type "VERTEX"
CommonSurfaceShader in shaders : Shader
  SFFloat    [in,out] alphaFactor 1
  SFColor    [in,out] ambientFactor 0.2 0.2 0.2
  SFColor    [in,out] diffuseFactor 0.8 0.8 0.8
  SFNode     [in,out] diffuseTexture NULL
  SFColor    [in,out] emissiveFactor 0 0 0
  SFNode     [in,out] emissiveTexture NULL
  SFNode     [in,out] normalTexture NULL
  SFFloat    [in,out] shininessFactor 0.2
  SFColor    [in,out] specularFactor 0 0 0
  SFNode     [in,out] specularTexture NULL
SurfaceShaderTexture in texture : Texture
  SFString   [in,out] channelMask "DEFAULT"
  SFNode     [in,out] texture NULL
  SFInt32    [in,out] textureCoordinatesId 0
  SFNode     [in,out] textureTransform NULL
ShaderPart in parts : Node Address
  SFString   [] type "VERTEX"
  SFString   [] sourceCode
"#;
