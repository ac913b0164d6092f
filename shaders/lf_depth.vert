// The same position as `lf_surface.vert`, to the last bit.

uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;

in vec3 position;
#ifdef LF_COVER
in vec4 alphaAt;
in vec4 passingAt;

centroid out vec4 vAlphaAt;
centroid out vec4 vPassingAt;
#endif

invariant gl_Position;

void main() {
#ifdef LF_COVER
	vAlphaAt = alphaAt;
	vPassingAt = passingAt;
#endif
	gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
}
