// Texels that are not baked yet: direct light from a few lights and points of the lamps, without shadows, on the material's diffuse part.
// It is there within a frame of the scene's arrival and gone texel by texel; hatching says that it is no result.

const int LF_DRAFT_LIGHTS = 16;
const int LF_PARTS_A_ROW = 512;
uniform int lfLightCount;
uniform vec4 lfLightPlace[ LF_DRAFT_LIGHTS ];  // metres; 0 a piece of a lamp, 1 a point or spot light, 2 from infinitely far away
uniform vec4 lfLightAxis[ LF_DRAFT_LIGHTS ];   // normal of the lamp, or where the light points; fade of a spot: 0 none, 1 linear, 2 squared cosine
uniform vec4 lfLightPower[ LF_DRAFT_LIGHTS ];  // radiance x area or W/sr or W/m^2; range or radius, metres, 0 for none
uniform vec3 lfLightFall[ LF_DRAFT_LIGHTS ];   // attenuation by distance; x negative: inverse square
uniform vec2 lfLightCone[ LF_DRAFT_LIGHTS ];   // half angles of full intensity and of the edge, radians
uniform vec3 lfAmbient;                        // mean radiance of the environment
uniform highp sampler2D lfParts;               // for each part two texels: reflectance; emission, W/(sr m^2)
uniform float lfDraftExposure;                 // 2^stops, or a guess while the exposure is not known

float lfSpotFade( int i, vec3 toLight ) {
	float fade = lfLightAxis[ i ].w, c = clamp( - dot( lfLightAxis[ i ].xyz, toLight ), - 1.0, 1.0 );
	if ( fade == 0.0 ) return 1.0;
	float beam = lfLightCone[ i ].x, edge = lfLightCone[ i ].y;
	if ( fade == 1.0 ) return clamp( ( edge - acos( c ) ) / max( edge - beam, 1e-6 ), 0.0, 1.0 );
	float x = clamp( ( c - cos( edge ) ) / max( cos( beam ) - cos( edge ), 1e-6 ), 0.0, 1.0 );
	return x * x;
}

float lfFalloff( int i, float d ) {
	float end = lfLightPower[ i ].w;
	vec3 fall = lfLightFall[ i ];
	if ( fall.x < 0.0 ) return ( end > 0.0 ? clamp( 1.0 - pow( d / end, 4.0 ), 0.0, 1.0 ) : 1.0 ) / ( d * d );
	return d <= end ? 1.0 / max( fall.x + d * ( fall.y + d * fall.z ), 1.0 ) : 0.0;
}

// Irradiance of a light.
vec3 lfLit( int i, vec3 position, vec3 normal ) {
	vec4 place = lfLightPlace[ i ];
	vec3 axis = lfLightAxis[ i ].xyz;
	if ( place.w == 2.0 ) return lfLightPower[ i ].rgb * max( - dot( normal, axis ), 0.0 );
	vec3 toLight = place.xyz - position;
	float d = max( length( toLight ), 1e-3 );
	toLight /= d;
	float strength = place.w == 0.0 ? max( - dot( axis, toLight ), 0.0 ) : lfSpotFade( i, toLight );
	return lfLightPower[ i ].rgb * max( dot( normal, toLight ), 0.0 ) * strength * lfFalloff( i, d );
}

vec3 lfDraft( vec3 position, vec3 normal, int part ) {
	vec3 irradiance = LF_PI * lfAmbient;
	for ( int i = 0; i < LF_DRAFT_LIGHTS; i ++ ) {
		if ( i >= lfLightCount ) break;
		irradiance += lfLit( i, position, normal );
	}
	ivec2 at = ivec2( part % LF_PARTS_A_ROW * 2, part / LF_PARTS_A_ROW );
	vec3 diffuse = texelFetch( lfParts, at, 0 ).rgb, emission = texelFetch( lfParts, at + ivec2( 1, 0 ), 0 ).rgb;
	vec3 radiance = ( emission + diffuse * irradiance / LF_PI ) * lfDraftExposure + 0.02 * diffuse;
	float hatch = step( 0.5, fract( ( gl_FragCoord.x + gl_FragCoord.y ) / 12.0 ) );
	return radiance * mix( 0.75, 1.0, hatch );
}
