// Radiance of a baked surface toward the eye. `lf_common`, one scheme and `lf_draft` come before it.

uniform int lfOutput;         // 0: for the screen, sRGB-coded; 1: linear radiance x 2^stops, and the chart's number; 2: what is looked up: uv, w.xy
uniform float lfExposure;     // the viewer's factor on radiance
uniform float lfTexelGrid;    // 1 draws lines along texel borders

// At a covered sample, where the surface is smoothed at its edges: beyond the edge lies another chart.
centroid in vec2 vUv;
centroid in vec3 vPosition;
centroid in vec3 vToEye;
in vec3 vNormal;
in vec3 vTangent;
flat in float vChart;

out vec4 outColor;

float lfGridLines( vec2 g ) {
	vec2 width = max( fwidth( g ), vec2( 1e-6 ) );
	vec2 line = 1.0 - smoothstep( vec2( 0.5 ), vec2( 1.5 ), min( fract( g ), 1.0 - fract( g ) ) / width );
	// Fades where a texel is only a few pixels wide: lines would cover everything.
	return max( line.x, line.y ) * ( 1.0 - smoothstep( 0.12, 0.35, max( width.x, width.y ) ) );
}

void main() {
	vec3 n = normalize( vNormal );
	vec3 t = normalize( vTangent - n * dot( n, vTangent ) );
	vec3 toEye = normalize( vToEye );
	vec3 w = vec3( dot( t, toEye ), dot( cross( n, t ), toEye ), dot( n, toEye ) );
	if ( lfOutput == 2 ) {
		outColor = vec4( vUv, w.xy );
		return;
	}
	vec3 radiance = lfRadiance( vUv, w );
	if ( lfOutput == 1 ) {
		outColor = vec4( radiance, vChart );
		return;
	}
	// Where only part of the footprint is baked, its light is extended; where none is, the draft stands in.
	if ( lfCover <= 0.0 ) radiance = lfDraft( vPosition, n );
	vec3 colour = lfCoded( radiance * lfExposure );
	float line = lfTexelGrid > 0.0 ? lfGridLines( vUv * vec2( lfSize ) ) : 0.0;
	outColor = vec4( mix( colour, vec3( dot( colour, vec3( 0.33 ) ) > 0.5 ? 0.0 : 1.0 ), 0.6 * line ), 1.0 );
}
