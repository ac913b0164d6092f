// Scheme `mean`: the cosine-weighted mean of the hemisphere (radiosity over pi), one value a texel: all that a lightmap would hold. It is
// the view "diffuse only", exact on diffuse surfaces, and what surfaces fall back to that do not fit into the memory budget.

uniform highp sampler2D lfMean;  // half-float: linear radiance in units of 2^-stops, weighted by alpha

vec3 lfRadiance( vec2 uv, vec3 w ) {
#ifdef LF_HW_FILTER
	return lfResolve( texture( lfMean, uv ) );
#else
	ivec2 lo, hi;
	vec2 f;
	lfFootprint( uv, lo, hi, f );
	vec4 bottom = mix( texelFetch( lfMean, lo, 0 ), texelFetch( lfMean, ivec2( hi.x, lo.y ), 0 ), f.x );
	vec4 top = mix( texelFetch( lfMean, ivec2( lo.x, hi.y ), 0 ), texelFetch( lfMean, hi, 0 ), f.x );
	return lfResolve( mix( bottom, top, f.y ) );
#endif
}
