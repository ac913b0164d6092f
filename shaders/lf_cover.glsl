// What shows through a surface. LF_COVER: 1 masks, whose fragments are there or not; 2 blends and thin walls, whose light is added to that of
// what lies behind.

#ifdef LF_COVER
uniform sampler2D lfAlpha;    // opacity, in red
uniform sampler2D lfPassing;  // share of light that goes through where the surface is, in red
uniform float lfCutoff;       // below it there is nothing; negative where opacity counts as it is
uniform float lfFresnel;      // reflectance at normal incidence of thin walls

centroid in vec4 vAlphaAt;    // (u q, v q, q) of the look-up, q <= 0 for none, and the factor on what is found
centroid in vec4 vPassingAt;

float lfFound( sampler2D map, vec4 at ) {
	return at.w * ( at.z > 0.0 ? texture( map, at.xy / at.z ).r : 1.0 );
}

// Share of the fragment that the surface takes.
float lfOpacity() {
	float opacity = lfFound( lfAlpha, vAlphaAt );
	if ( lfCutoff < 0.0 ) return clamp( opacity, 0.0, 1.0 );
	if ( opacity < lfCutoff ) discard;
	return 1.0;
}

// Share of what lies behind that does not come through; `cosine` is that of the view. Schlick's Fresnel term: what is reflected is in the light
// field already. The colour that a wall tints with is taken at its mean: one number a pixel is what blending has.
float lfCovered( float opacity, float cosine ) {
	float through = ( 1.0 - lfFresnel ) * ( 1.0 - pow( 1.0 - clamp( cosine, 0.0, 1.0 ), 5.0 ) );
	return opacity * ( 1.0 - lfFound( lfPassing, vPassingAt ) * through );
}
#endif
