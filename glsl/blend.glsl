// The sum of three colours of a buffer by weights: what a point of a triangle has of its corners.
vec3 blend(textureBuffer colors, uvec3 corners, vec3 weights) {
    return weights.x * texelFetch(colors, int(corners.x)).rgb + weights.y * texelFetch(colors, int(corners.y)).rgb
         + weights.z * texelFetch(colors, int(corners.z)).rgb;
}
