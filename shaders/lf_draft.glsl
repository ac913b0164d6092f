// Texels that are not baked yet: direct light from a few points of the lamps, without shadows, on the material's diffuse part. It is there
// within a frame of the scene's arrival and gone texel by texel; hatching says that it is no result.

const int LF_DRAFT_LIGHTS = 16;
uniform int lfLightCount;
uniform vec3 lfLightPosition[ LF_DRAFT_LIGHTS ];  // metres
uniform vec3 lfLightNormal[ LF_DRAFT_LIGHTS ];
uniform vec3 lfLightPower[ LF_DRAFT_LIGHTS ];     // radiance x area, W/sr
uniform vec3 lfDiffuse;                           // Kd of this surface
uniform vec3 lfEmission;                          // Ke of this surface, W/(sr m^2)
uniform float lfDraftExposure;                    // 2^stops, or a guess while the exposure is not known

vec3 lfDraft( vec3 position, vec3 normal ) {
	vec3 irradiance = vec3( 0.0 );
	for ( int i = 0; i < LF_DRAFT_LIGHTS; i ++ ) {
		if ( i >= lfLightCount ) break;
		vec3 d = lfLightPosition[ i ] - position;
		float r2 = max( dot( d, d ), 1e-6 );
		vec3 w = d * inversesqrt( r2 );
		irradiance += lfLightPower[ i ] * max( dot( normal, w ), 0.0 ) * max( - dot( lfLightNormal[ i ], w ), 0.0 ) / r2;
	}
	vec3 radiance = ( lfEmission + lfDiffuse * irradiance / LF_PI ) * lfDraftExposure + 0.02 * lfDiffuse;
	float hatch = step( 0.5, fract( ( gl_FragCoord.x + gl_FragCoord.y ) / 12.0 ) );
	return radiance * mix( 0.75, 1.0, hatch );
}
