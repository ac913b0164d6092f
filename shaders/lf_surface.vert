// A baked surface. Everything is in the object's space, the space that it was baked in: the eye is brought there, not the light out of it.
// `lf_cover_vertex` comes before it.

uniform mat4 modelMatrix;
uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 cameraPosition;

in vec3 position;
in vec3 normal;
in vec3 tangent;
in vec2 uv;
in float chart;
in float part;

centroid out vec2 vUv;
centroid out vec3 vPosition;
centroid out vec3 vToEye;
out vec3 vNormal;
out vec3 vTangent;
flat out float vChart;
flat out float vPart;

// The depth pre-pass must find the very depths that this shader does.
invariant gl_Position;

void main() {
	vUv = uv;
	vPosition = position;
	vToEye = ( inverse( modelMatrix ) * vec4( cameraPosition, 1.0 ) ).xyz - position;
	vNormal = normal;
	vTangent = tangent;
	vChart = chart;
	vPart = part;
#ifdef LF_COVER
	lfPassCover();
#endif
	gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
}
