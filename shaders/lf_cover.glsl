// What shows through a surface, as in `proto::scene::veil`. LF_COVER: 1 masks, whose fragments are there or not; 2 blends and clear glass,
// whose light is added to that of what lies behind.

#ifdef LF_COVER
uniform sampler2D lfAlpha;        // opacity, in red
uniform vec3 lfAlphaMove[ 2 ];    // rows of the affine map of what is looked up
uniform bvec4 lfProjected;        // whether each comes through a projector, which reaches its picture alone
uniform float lfCutoff;           // below it there is nothing; negative where opacity counts as it is

centroid in vec4 vCoverAt;        // colour of what goes through, and opacity, before textures
centroid in vec3 vAlphaAt;        // (u q, v q, q) of each look-up, q <= 0 for none

vec4 lfFound( sampler2D map, vec3 at, vec3 move[ 2 ], bool projected ) {
	if ( at.z <= 0.0 ) return vec4( 1.0 );
	vec3 p = vec3( at.xy / at.z, 1.0 );
	if ( projected && p.xy != clamp( p.xy, 0.0, 1.0 ) ) return vec4( 1.0 );
	return texture( map, vec2( dot( move[ 0 ], p ), dot( move[ 1 ], p ) ) );
}

// Share of the fragment that the surface takes.
float lfOpacity() {
	float opacity = vCoverAt.a * lfFound( lfAlpha, vAlphaAt, lfAlphaMove, lfProjected.x ).r;
	if ( lfCutoff < 0.0 ) return clamp( opacity, 0.0, 1.0 );
	if ( opacity < lfCutoff ) discard;
	return 1.0;
}

#if LF_COVER == 2
// Squared roughness below which a surface is perfectly smooth, as in `proto::scene`.
const float LF_LEAST_ALPHA = 1e-3;

uniform sampler2D lfPassing;      // share of light that goes through, in red
uniform sampler2D lfRoughness;    // roughness in green, metalness in blue
uniform sampler2D lfTint;         // colour of what goes through
uniform vec3 lfPassingMove[ 2 ];
uniform vec3 lfRoughnessMove[ 2 ];
uniform vec3 lfTintMove[ 2 ];
uniform vec3 lfGlass;             // factors: transmission, roughness, metalness
uniform vec2 lfReflected;         // strength of the reflection, and what is reflected at normal incidence before it
uniform vec3 lfChannel;           // the channel that is blended, 1 there

centroid in vec3 vPassingAt;
centroid in vec3 vRoughnessAt;
centroid in vec3 vTintAt;

// What clear glass lets straight through toward a direction of this cosine: its colour, less what its faces reflect (Schlick's Fresnel
// term), which is in the light field already. What rough glass lets through is there, too.
vec3 lfClear( float cosine ) {
	vec2 rough = lfFound( lfRoughness, vRoughnessAt, lfRoughnessMove, lfProjected.z ).gb * lfGlass.yz;
	if ( rough.x * rough.x >= LF_LEAST_ALPHA ) return vec3( 0.0 );
	float m = 1.0 - clamp( cosine, 0.0, 1.0 );
	float reflected = lfReflected.x * ( lfReflected.y + ( 1.0 - lfReflected.y ) * m * m * m * m * m );
	float share = lfGlass.x * lfFound( lfPassing, vPassingAt, lfPassingMove, lfProjected.y ).r * ( 1.0 - rough.y ) * ( 1.0 - reflected );
	return clamp( vCoverAt.rgb * lfFound( lfTint, vTintAt, lfTintMove, lfProjected.w ).rgb, 0.0, 1.0 ) * share;
}

// Share of what lies behind that does not come through, in the channel that is blended.
float lfCovered( float opacity, float cosine ) {
	return opacity * ( 1.0 - dot( lfClear( cosine ), lfChannel ) );
}
#endif
#endif
