// The environment behind everything: a triangle over the whole view, and where each of its points looks in the space of the scene.

uniform mat4 modelViewMatrix;
uniform mat4 projectionMatrix;

in vec3 position;

out vec3 vDirection;

void main() {
	vec4 ahead = inverse( projectionMatrix ) * vec4( position.xy, - 1.0, 1.0 );
	vDirection = inverse( mat3( modelViewMatrix ) ) * ( ahead.xyz / ahead.w );
	gl_Position = vec4( position.xy, 1.0, 1.0 );
}
