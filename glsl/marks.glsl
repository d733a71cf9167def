// Whether a shadow's edge comes near a corner of a triangle that its vertices show badly: the fourth number of their light.
bool is_marked(textureBuffer radiosity, uvec3 corners) {
    return texelFetch(radiosity, int(corners.x)).w + texelFetch(radiosity, int(corners.y)).w
         + texelFetch(radiosity, int(corners.z)).w > 0.0;
}
