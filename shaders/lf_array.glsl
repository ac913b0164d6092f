// Schemes `raw` and `expanded`: every sample in an array texture, one direction a cell, cells side by side in layers. They differ in where
// the samples come from (.mtex, or the decoded segments), not in how they are read, so that they share this file. The texture is sRGB for
// 8-bit samples and half-float for linear ones, times 2^stops already: either way the sampler gives linear values in units of 2^-stops,
// which is the domain that samples are interpolated in. Alpha is 1 where a texel holds light; what holds none has colour 0, so that
// filtered colour is already weighted.
//
// LF_HW_FILTER: the sampler interpolates between texels (4 fetches), else the shader does (16).

uniform highp sampler2DArray lfSamples;
uniform ivec2 lfCells;  // cells along x and y of a layer

ivec3 lfCellOf( int depth ) {
	int cells = lfCells.x * lfCells.y;
	int cell = depth % cells;
	return ivec3( ( cell % lfCells.x ) * lfSize.x, ( cell / lfCells.x ) * lfSize.y, depth / cells );
}

#ifdef LF_HW_FILTER
vec4 lfTexels( ivec3 cell, vec2 g ) {
	return texture( lfSamples, vec3( ( vec2( cell.xy ) + g ) / vec2( lfCells * lfSize ), float( cell.z ) ) );
}
#else
vec4 lfTexels( ivec3 cell, ivec2 lo, ivec2 hi, vec2 f ) {
	vec4 a = texelFetch( lfSamples, cell + ivec3( lo, 0 ), 0 );
	vec4 b = texelFetch( lfSamples, cell + ivec3( hi.x, lo.y, 0 ), 0 );
	vec4 c = texelFetch( lfSamples, cell + ivec3( lo.x, hi.y, 0 ), 0 );
	vec4 d = texelFetch( lfSamples, cell + ivec3( hi, 0 ), 0 );
	return mix( mix( a, b, f.x ), mix( c, d, f.x ), f.y );
}
#endif

vec3 lfRadiance( vec2 uv, vec3 w ) {
	ivec4 depth;
	vec4 weight;
	lfStencil( w, depth, weight );
	vec4 sum = vec4( 0.0 );
#ifdef LF_HW_FILTER
	// Half a texel inside the cell at least: the sampler stays within it.
	vec2 g = clamp( uv * vec2( lfSize ), vec2( 0.5 ), vec2( lfSize ) - 0.5 );
	for ( int k = 0; k < 4; k ++ ) sum += weight[ k ] * lfTexels( lfCellOf( depth[ k ] ), g );
#else
	ivec2 lo, hi;
	vec2 f;
	lfFootprint( uv, lo, hi, f );
	for ( int k = 0; k < 4; k ++ ) sum += weight[ k ] * lfTexels( lfCellOf( depth[ k ] ), lo, hi, f );
#endif
	return lfResolve( sum );
}
