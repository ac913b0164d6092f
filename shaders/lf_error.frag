// The error heat map: the largest difference of a channel between two pictures, in levels of 1/255 as displayed, as a colour. `lf_common`
// comes before it.

uniform highp sampler2D lfShown;      // what the codec gives: linear, alpha 0 where there is nothing
uniform highp sampler2D lfReference;  // what raw radiance gives
uniform float lfExposure;             // as when it is looked at: an error counts as much as it shows
uniform float lfErrorRange;           // levels at the end of the scale
uniform vec3 lfBackground;            // sRGB-coded

in vec2 vAt;

out vec4 outColor;

// Black, blue, magenta, orange, yellow-white: brightness rises all along, for eyes that see no hues.
vec3 lfHeat( float x ) {
	const vec3 stops[ 5 ] = vec3[ 5 ](
		vec3( 0.02, 0.02, 0.05 ), vec3( 0.2, 0.1, 0.55 ), vec3( 0.72, 0.15, 0.47 ), vec3( 0.98, 0.55, 0.2 ), vec3( 0.99, 0.98, 0.75 )
	);
	float s = clamp( x, 0.0, 1.0 ) * 4.0;
	int i = min( int( s ), 3 );
	return mix( stops[ i ], stops[ i + 1 ], s - float( i ) );
}

void main() {
	vec4 shown = texture( lfShown, vAt ), reference = texture( lfReference, vAt );
	if ( shown.a <= 0.0 ) { outColor = vec4( lfBackground, 1.0 ); return; }
	vec3 d = abs( lfCoded( shown.rgb * lfExposure ) - lfCoded( reference.rgb * lfExposure ) ) * 255.0;
	outColor = vec4( lfHeat( max( d.r, max( d.g, d.b ) ) / lfErrorRange ), 1.0 );
}
