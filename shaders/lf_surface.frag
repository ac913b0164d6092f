// Radiance of a baked surface toward the eye. `lf_common`, one scheme, `lf_draft` and `lf_cover` come before it.

// 0: for the screen, sRGB-coded; 1: linear radiance x 2^stops, and the chart's number; 2: what is looked up: uv, w.xy; 3: as on the screen,
// but linear, for pictures that are blended.
uniform int lfOutput;
uniform float lfExposure;     // the viewer's factor on radiance
uniform float lfTexelGrid;    // 1 draws lines along texel borders

// At a covered sample, where the surface is smoothed at its edges: beyond the edge lies another chart.
centroid in vec2 vUv;
centroid in vec3 vPosition;
centroid in vec3 vToEye;
in vec3 vNormal;
in vec3 vTangent;
flat in float vChart;
flat in float vPart;

out vec4 outColor;

// As in `proto::frame`.
const float LF_LEAST_TANGENT = 1e-4;

// The rotation about Y x N that carries +Y to N: where texture coordinates give no tangent, and everywhere with the thesis's frames.
vec3 lfThesisTangent( vec3 n ) {
	float across = dot( n.xz, n.xz );
	if ( n.y < 0.0 && across < 1e-12 ) return vec3( 1.0, 0.0, 0.0 );
	// 1/(1 + y), without cancellation near -Y.
	float k = n.y < 0.0 ? ( 1.0 - n.y ) / across : 1.0 / ( 1.0 + n.y );
	return vec3( 1.0 - n.x * n.x * k, - n.x, - n.x * n.z * k );
}

// Interpolated per fragment, then made orthogonal: the frame that the worker baked with. `plane` is along the triangle's own normal.
void lfFrame( out vec3 n, out vec3 t, out vec3 plane ) {
	plane = cross( dFdx( vPosition ), dFdy( vPosition ) );
	n = normalize( dot( vNormal, vNormal ) > 1e-12 ? vNormal : plane );
	t = vTangent - n * dot( n, vTangent );
	t = length( t ) >= LF_LEAST_TANGENT ? normalize( t ) : lfThesisTangent( n );
}

float lfGridLines( vec2 g ) {
	vec2 width = max( fwidth( g ), vec2( 1e-6 ) );
	vec2 line = 1.0 - smoothstep( vec2( 0.5 ), vec2( 1.5 ), min( fract( g ), 1.0 - fract( g ) ) / width );
	// Fades where a texel is only a few pixels wide: lines would cover everything.
	return max( line.x, line.y ) * ( 1.0 - smoothstep( 0.12, 0.35, max( width.x, width.y ) ) );
}

// As it is displayed, in linear light: what is too bright for a display, if not for half floats, is cut when all that is seen has been
// added up.
vec3 lfShade( vec3 radiance ) {
	vec3 light = radiance * lfExposure;
	if ( lfTexelGrid <= 0.0 ) return light;
	vec3 colour = lfCoded( light );
	return lfLinear( mix( colour, vec3( dot( colour, vec3( 0.33 ) ) > 0.5 ? 0.0 : 1.0 ), 0.6 * lfGridLines( vUv * vec2( lfSize ) ) ) );
}

void main() {
	vec3 n, t, plane;
	lfFrame( n, t, plane );
	vec3 toEye = normalize( vToEye );
	vec3 w = vec3( dot( t, toEye ), dot( cross( n, t ), toEye ), dot( n, toEye ) );
	float opacity = 1.0, alpha = lfOutput == 1 ? vChart : 1.0;
#ifdef LF_COVER
	opacity = lfOpacity();
#if LF_COVER == 2
	// What goes straight through goes through the triangle itself, whatever its normals are smoothed to.
	float flatness = length( plane );
	alpha = lfCovered( opacity, flatness > 0.0 ? abs( dot( plane, toEye ) ) / flatness : w.z );
#endif
#endif
	if ( lfOutput == 2 ) {
		// A view below the horizon of an interpolated normal is looked up on it.
		outColor = vec4( vUv, w.z < 0.0 ? normalize( w.xy ) : w.xy );
		return;
	}
	vec3 radiance = lfRadiance( vUv, w );
	// Where only part of the footprint is baked, its light is extended; where none is, the draft stands in.
	if ( lfCover <= 0.0 && lfOutput != 1 ) radiance = lfDraft( vPosition, n, int( vPart ) );
	if ( lfOutput != 1 ) radiance = lfShade( radiance );
	radiance = min( radiance, LF_BRIGHTEST );
	if ( lfOutput == 0 ) radiance = lfCoded( radiance );
	outColor = vec4( radiance * opacity, alpha );
}
