// Of an entity that casts shadows: src/draw/sun_map.rs.
layout(push_constant) uniform Push {
    mat4 clip_from_object;
    float alpha_cutoff;
} push;
