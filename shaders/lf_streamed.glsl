// Scheme `streamed`: the kept samples as they are in the files, unrolled into integer textures (thesis, chapter 7.3). A texel's samples are
// found through its starting point, the one before a direction by binary search along the walk, and its radiance is the line to the next,
// rounded exactly as the reference decoder rounds it. Sixteen searches a pixel: some eight times slower than arrays, at a fraction of
// their memory.
//
// LF_DIRECT: colours are direct, without a map.

uniform highp usampler2DArray lfStarts;   // R32UI: where each texel's samples begin
uniform highp usampler2DArray lfSteps;    // R16UI: step of the walk of each sample
uniform highp usampler2DArray lfColours;  // R16UI index into the map, or RGBA8UI
#ifndef LF_DIRECT
uniform highp usampler2DArray lfMap;      // RGBA8UI
#endif
uniform ivec3 lfLogRows;                  // of starts, of samples, of the map: log2 of a layer's rows

const int LF_LOG_WIDTH = 11;

ivec3 lfUnroll( int i, int log_rows ) {
	int row = i >> LF_LOG_WIDTH;
	return ivec3( i & ( ( 1 << LF_LOG_WIDTH ) - 1 ), row & ( ( 1 << log_rows ) - 1 ), row >> log_rows );
}

int lfStepAt( int k ) { return int( texelFetch( lfSteps, lfUnroll( k, lfLogRows.y ), 0 ).r ); }

ivec3 lfColourAt( int k ) {
	uvec4 c = texelFetch( lfColours, lfUnroll( k, lfLogRows.y ), 0 );
#ifdef LF_DIRECT
	return ivec3( c.rgb );
#else
	return ivec3( texelFetch( lfMap, lfUnroll( int( c.r ), lfLogRows.z ), 0 ).rgb );
#endif
}

int lfStepOf( int depth ) { return lfThetaFastest == 1 ? ( depth % lfGrid.y ) * lfGrid.x + depth / lfGrid.y : depth; }

// The last of the samples [a, b) whose step is not behind `step`; the first is step 0. A texel has at most 4,096 samples: 12 halvings.
int lfFind( int a, int b, int step ) {
	for ( int i = 0; i < 12 && b - a > 1; i ++ ) {
		int m = ( a + b ) >> 1;
		if ( lfStepAt( m ) <= step ) a = m; else b = m;
	}
	return a;
}

// The radiance at `step`, on the line from sample k to the next.
vec3 lfLine( int k, int end, int step ) {
	int from = lfStepAt( k );
	ivec3 a = lfColourAt( k );
	if ( from == step || k + 1 >= end ) return lfLinear( vec3( a ) / 255.0 );
	int size = lfStepAt( k + 1 ) - from;
	ivec3 b = lfColourAt( k + 1 );
	ivec3 value = ( 2 * a * size + 2 * ( b - a ) * ( step - from ) + size ) / ( 2 * size );
	return lfLinear( vec3( value ) / 255.0 );
}

vec4 lfTexel( ivec2 texel, ivec4 steps, vec4 weight ) {
	int t = texel.y * lfSize.x + texel.x;
	int a = int( texelFetch( lfStarts, lfUnroll( t, lfLogRows.x ), 0 ).r );
	int b = int( texelFetch( lfStarts, lfUnroll( t + 1, lfLogRows.x ), 0 ).r );
	if ( a >= b ) return vec4( 0.0 );
	vec3 sum = vec3( 0.0 );
	int k = a, last = -2;
	for ( int n = 0; n < 4; n ++ ) {
		int step = steps[ n ];
		// Neighbours along the walk share a search: at most one sample lies between them.
		if ( step == last + 1 ) { if ( k + 1 < b && lfStepAt( k + 1 ) <= step ) k ++; }
		else k = lfFind( a, b, step );
		last = step;
		sum += weight[ n ] * lfLine( k, b, step );
	}
	return vec4( sum, 1.0 );
}

vec3 lfRadiance( vec2 uv, vec3 w ) {
	ivec4 depth;
	vec4 weight;
	lfStencil( w, depth, weight );
	// In an order in which neighbours along the walk follow each other.
	if ( lfThetaFastest == 1 ) { depth = depth.xzyw; weight = weight.xzyw; }
	ivec4 steps = ivec4( lfStepOf( depth.x ), lfStepOf( depth.y ), lfStepOf( depth.z ), lfStepOf( depth.w ) );
	ivec2 lo, hi;
	vec2 f;
	lfFootprint( uv, lo, hi, f );
	vec4 bottom = mix( lfTexel( lo, steps, weight ), lfTexel( ivec2( hi.x, lo.y ), steps, weight ), f.x );
	vec4 top = mix( lfTexel( ivec2( lo.x, hi.y ), steps, weight ), lfTexel( hi, steps, weight ), f.x );
	return lfResolve( mix( bottom, top, f.y ) );
}
