// The same position as `lf_surface.vert`, to the last bit. `lf_cover_vertex` comes before it.

uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;

in vec3 position;

invariant gl_Position;

void main() {
#ifdef LF_COVER
	lfPassCover();
#endif
	gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
}
