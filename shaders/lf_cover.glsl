// What shows through a surface. LF_COVER: 1 masks, whose fragments are there or not; 2 blends and thin walls, whose light is added to that of
// what lies behind.

#ifdef LF_COVER
uniform sampler2D lfAlpha;    // opacity, in red
uniform sampler2D lfPassing;  // share of light that goes through where the surface is, in red
uniform vec3 lfAlphaMove[ 2 ];    // rows of the affine map of what is looked up
uniform vec3 lfPassingMove[ 2 ];
uniform bvec2 lfProjected;    // whether the one and the other come through a projector, which reaches its picture alone
uniform float lfCutoff;       // below it there is nothing; negative where opacity counts as it is
uniform float lfFresnel;      // reflectance at normal incidence of thin walls

centroid in vec4 vAlphaAt;    // (u q, v q, q) of the look-up, q <= 0 for none, and the factor on what is found
centroid in vec4 vPassingAt;

float lfFound( sampler2D map, vec4 at, vec3 move[ 2 ], bool projected ) {
	if ( at.z <= 0.0 ) return at.w;
	vec3 p = vec3( at.xy / at.z, 1.0 );
	if ( projected && p.xy != clamp( p.xy, 0.0, 1.0 ) ) return at.w;
	return at.w * texture( map, vec2( dot( move[ 0 ], p ), dot( move[ 1 ], p ) ) ).r;
}

// Share of the fragment that the surface takes.
float lfOpacity() {
	float opacity = lfFound( lfAlpha, vAlphaAt, lfAlphaMove, lfProjected.x );
	if ( lfCutoff < 0.0 ) return clamp( opacity, 0.0, 1.0 );
	if ( opacity < lfCutoff ) discard;
	return 1.0;
}

// Share of what lies behind that does not come through; `cosine` is that of the view. Schlick's Fresnel term: what is reflected is in the light
// field already. The colour that a wall tints with is taken at its mean: one number a pixel is what blending has.
float lfCovered( float opacity, float cosine ) {
	float through = ( 1.0 - lfFresnel ) * ( 1.0 - pow( 1.0 - clamp( cosine, 0.0, 1.0 ), 5.0 ) );
	return opacity * ( 1.0 - lfFound( lfPassing, vPassingAt, lfPassingMove, lfProjected.y ) * through );
}
#endif
