// The same position as `lf_surface.vert`, to the last bit.

uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;

in vec3 position;
#ifdef LF_COVER
in vec4 coverAt;
in vec3 alphaAt;
in vec3 passingAt;
in vec3 roughnessAt;
in vec3 tintAt;

centroid out vec4 vCoverAt;
centroid out vec3 vAlphaAt;
centroid out vec3 vPassingAt;
centroid out vec3 vRoughnessAt;
centroid out vec3 vTintAt;
#endif

invariant gl_Position;

void main() {
#ifdef LF_COVER
	vCoverAt = coverAt;
	vAlphaAt = alphaAt;
	vPassingAt = passingAt;
	vRoughnessAt = roughnessAt;
	vTintAt = tintAt;
#endif
	gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
}
