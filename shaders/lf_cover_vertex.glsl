// What `lf_cover` looks up, from the corners to the fragments: the same in every pass, so that all have the same holes.

#ifdef LF_COVER
in vec4 coverAt;
in vec3 alphaAt;
centroid out vec4 vCoverAt;
centroid out vec3 vAlphaAt;
#if LF_COVER == 2
in vec3 passingAt;
in vec3 roughnessAt;
in vec3 tintAt;
centroid out vec3 vPassingAt;
centroid out vec3 vRoughnessAt;
centroid out vec3 vTintAt;
#endif

void lfPassCover() {
	vCoverAt = coverAt;
	vAlphaAt = alphaAt;
#if LF_COVER == 2
	vPassingAt = passingAt;
	vRoughnessAt = roughnessAt;
	vTintAt = tintAt;
#endif
}
#endif
