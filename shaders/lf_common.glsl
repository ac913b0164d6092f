// What every scheme shares: directions and their bilinear stencil, texel footprints, the sRGB curve.
//
// A scheme file defines `vec3 lfRadiance(vec2 uv, vec3 w)`: linear radiance of texture coordinate `uv` toward the local unit direction `w`,
// in units of 2^-stops W/(sr m^2) (1 is white at the job's exposure), and sets `lfCover`, the share of the footprint that holds light.

uniform ivec2 lfSize;        // texels of the surface's texture
uniform ivec2 lfGrid;        // inclinations, azimuths
uniform int lfThetaFastest;  // 1 where the walk along directions visits inclinations first

float lfCover = 0.0;

const float LF_PI = 3.14159265358979;
// Light is cut here as it is written: half floats end at 65,504, and infinity under what covers all is no number. The environment and three
// panes of glass that are as bright themselves add up to less.
const float LF_BRIGHTEST = 16000.0;

float lfLinear( float s ) { return s <= 0.04045 ? s / 12.92 : pow( ( s + 0.055 ) / 1.055, 2.4 ); }
vec3 lfLinear( vec3 s ) { return vec3( lfLinear( s.r ), lfLinear( s.g ), lfLinear( s.b ) ); }
float lfCoded( float l ) { return l <= 0.0031308 ? l * 12.92 : 1.055 * pow( l, 1.0 / 2.4 ) - 0.055; }
vec3 lfCoded( vec3 l ) { l = clamp( l, 0.0, 1.0 ); return vec3( lfCoded( l.r ), lfCoded( l.g ), lfCoded( l.b ) ); }

// Four directions of the spherical grid around `w`, as depths, with their weights. Azimuth wraps; above the first ring lies the same ring
// at phi + 180 degrees; below the last ring, and below the horizon, the last ring counts.
void lfStencil( vec3 w, out ivec4 depth, out vec4 weight ) {
	float across = length( w.xy );
	float v = atan( across, max( w.z, 0.0 ) ) * ( 2.0 / LF_PI ) * float( lfGrid.x ) - 0.5;
	float turns = across > 0.0 ? atan( w.y, w.x ) * ( 0.5 / LF_PI ) : 0.0;
	float u = ( turns - floor( turns ) ) * float( lfGrid.y );
	int j0 = int( floor( u ) );
	float fu = u - float( j0 );
	int j = j0 % lfGrid.y, next = ( j0 + 1 ) % lfGrid.y;
	int top, bottom;
	float fv;
	if ( v < 0.0 ) {
		int half_turn = lfGrid.y / 2;
		depth = ivec4( ( j + half_turn ) % lfGrid.y, ( next + half_turn ) % lfGrid.y, j, next );
		fv = v + 1.0;
	} else {
		v = min( v, float( lfGrid.x - 1 ) );
		top = int( floor( v ) );
		bottom = min( top + 1, lfGrid.x - 1 );
		fv = v - float( top );
		depth = ivec4( top * lfGrid.y + j, top * lfGrid.y + next, bottom * lfGrid.y + j, bottom * lfGrid.y + next );
	}
	weight = vec4( ( 1.0 - fu ) * ( 1.0 - fv ), fu * ( 1.0 - fv ), ( 1.0 - fu ) * fv, fu * fv );
}

// The bilinear footprint of `uv`: two texels an axis, clamped to the texture, and the fraction between them.
void lfFootprint( vec2 uv, out ivec2 lo, out ivec2 hi, out vec2 f ) {
	vec2 g = clamp( uv * vec2( lfSize ) - 0.5, vec2( 0.0 ), vec2( lfSize - 1 ) );
	lo = ivec2( floor( g ) );
	hi = min( lo + 1, lfSize - 1 );
	f = g - vec2( lo );
}

// `sum` holds radiance times cover, and cover: the mean over the texels that hold light.
vec3 lfResolve( vec4 sum ) {
	lfCover = sum.a;
	return sum.a > 0.0 ? sum.rgb / sum.a : vec3( 0.0 );
}
