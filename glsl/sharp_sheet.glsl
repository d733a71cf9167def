// The share of the parts of a light that sheets let through: SheetView::shadow of src/field/sheet.rs.
#include "sheet.glsl"

// Share of a disc on the inner side of two edges, from the shares inside of each and the cosine of their normals.
float both(float a, float b, float cosine) {
    return mix(a * b, cosine < 0.0 ? max(a + b - 1.0, 0.0) : min(a, b), abs(cosine));
}

// What sheets leave of the parts of a light.
struct SheetShadow {
    vec4 free;
    vec3 edges[4]; // unit normals, towards what is blocked, of the side that runs nearest to each part
};

SheetShadow no_shadow() {
    return SheetShadow(vec4(1.0), vec3[4](vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0)));
}

// Adds one more sheet. Two that meet in an edge, as the walls of a room, leave nothing free between them: their edges'
// normals are opposite there.
void pass_sheet(inout SheetShadow shadow, Entity entity, Surface surface, SeenLight light, Block block) {
    Sheet sheet = sheet_of(entity, entity.centre.xyz - surface.origin, surface.position, surface.facings[0].normal,
                           CONTACT / surface.inverse_radius);
    mat3 axes = transpose(mat3(light.toward, light.across, light.down)) * sheet.axes; // by the light's axes
    float h = sheet.height;
    vec4 ends = sheet.ends / sheet.to_ends;
    vec2 tilts = -(vec2(h * h) + sheet.ends.xz * sheet.ends.yw) / (sheet.to_ends.xz * sheet.to_ends.yw);
    float least = BEYOND_SHEET * light.sine * light.distance;
    EACH for (uint k = 0; k < 4; k++) {
        vec2 part = part_place(light, block, k);
        vec3 along = along_axes(light, part);
        float sine = part_sine(light, block, part, along);
        float reach = reach_of(light, part, along);
        vec3 direction = along * axes;
        vec4 inside = inside_of(sheet, direction);
        float width = max(sine, LEAST_PENUMBRA);
        vec4 share = vec4(blocked_share(inside.x / width), blocked_share(inside.y / width),
                          blocked_share(inside.z / width), blocked_share(inside.w / width));
        float x = both(share.x, share.y, tilts.x), y = both(share.z, share.w, tilts.y);
        float cosine = (share.x < share.y ? -ends.x : ends.y) * (share.z < share.w ? -ends.z : ends.w);
#if PANELS
        float facing = dot(is_panel(light) ? light.facing : along, axes[2]);
#else
        float facing = direction.z;
#endif
        float slope = sqrt(max(1.0 - facing * facing, 0.0));
        float counts = clamp((direction.z * reach - h - least) / max(reach * sine * slope, least), 0.0, 1.0);
        // The side that is nearest to the ray or farthest outside of it.
        uint side = 0;
        float nearest = inside.x, end = sheet.ends.x, off = sheet.to_ends.x;
        EACH for (uint i = 1; i < 4; i++) {
            bool nearer = inside[i] < nearest;
            side = nearer ? i : side;
            nearest = nearer ? inside[i] : nearest;
            end = nearer ? sheet.ends[i] : end;
            off = nearer ? sheet.to_ends[i] : off;
        }
        vec3 edge = (h * (side < 2 ? sheet.axes[0] : sheet.axes[1]) - end * sheet.axes[2]) / off;
        edge = (side & 1) != 0 ? -edge : edge;
        float free = 1.0 - entity.opacity * counts * both(x, y, cosine), before = shadow.free[k];
        shadow.free[k] = both(before, free, dot(shadow.edges[k], edge));
        shadow.edges[k] = abs(free - 0.5) < abs(before - 0.5) ? edge : shadow.edges[k];
#if EDGES
        // How far away the side is there.
        float across = side < 2 ? direction.x : direction.y;
        float toward = end * across + h * direction.z;
        float away = toward > 0.0 ? off * off / toward : -EVERYTHING;
        float scale = entity.centre.w;
        find_edge(nearest * abs(away) * scale, away * scale, reach * scale, away * scale * max(sine, LEAST_PENUMBRA),
                  inversesqrt(block.area), surface.step * scale);
#endif
    }
}
