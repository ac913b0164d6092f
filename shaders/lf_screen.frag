// A picture in linear light onto the screen. `lf_common` comes before it.

uniform highp sampler2D lfShown;

in vec2 vAt;

out vec4 outColor;

void main() {
	outColor = vec4( lfCoded( texture( lfShown, vAt ).rgb ), 1.0 );
}
