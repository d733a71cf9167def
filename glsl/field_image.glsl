// Fields as one image of three dimensions: shells along z, the directions of all faces along y, a coefficient quad beside the other
// along x. Channels of fields stand above and beside each other; a base is the number of a channel. The sampler interpolates.
layout(binding = FIELD_BINDING) uniform sampler3D field_image;

void field_sums(FieldPlace place, uint base, uint sample_quads, out vec4 sums[FETCHED_QUADS]) {
    vec3 size = vec3(textureSize(field_image, 0));
    uint along = uint(size.z) / SHELLS;
    vec3 texel = place.texel + vec3(0, float(base / along * (6 * COLUMNS)), float(base % along * SHELLS));
    [[unroll]] for (uint q = 0; q < FETCHED_QUADS; q++) {
        sums[q] = place.weight[0] * textureLod(field_image, (texel + vec3(float(q * COLUMNS), 0, 0)) / size, 0.0);
    }
}
