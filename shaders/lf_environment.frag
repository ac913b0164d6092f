// Radiance of the environment, a lat-long map as `proto::scene::Environment` has it: the middle of the picture lies toward +X, its right
// half toward +Z, row 0 straight down. `lf_common` comes before it.

uniform highp sampler2D lfEnvironment;  // half-float: radiance x 2^stops
uniform float lfTurns;                  // by which it is turned about +Y
uniform int lfOutput;                   // as in `lf_surface.frag`
uniform float lfExposure;

in vec3 vDirection;

out vec4 outColor;

void main() {
	if ( lfOutput == 2 ) { outColor = vec4( 0.0 ); return; }
	vec3 d = normalize( vDirection );
	vec2 at = vec2( 0.5 + lfTurns + atan( d.z, d.x ) / ( 2.0 * LF_PI ), 0.5 + atan( d.y, length( d.xz ) ) / LF_PI );
	vec3 radiance = textureLod( lfEnvironment, at, 0.0 ).rgb;
	// No chart lies there.
	if ( lfOutput == 1 ) { outColor = vec4( min( radiance, LF_BRIGHTEST ), 0.0 ); return; }
	vec3 shown = min( radiance * lfExposure, LF_BRIGHTEST );
	outColor = vec4( lfOutput == 0 ? lfCoded( shown ) : shown, 1.0 );
}
