// Points above a BlobTree whose surface the heights of decals move along its normals. A point p is outside where its
// distance to the surface exceeds the height at its foot, the closest point of the surface. LIMITED: decals have
// receivers or fades.
//@ include decal_data.glsl
#ifdef LIMITED
uniform isampler2D object_masks;
#endif
int surface_receivers = -1;  // mask of the object, see decals/receivers.py
//@ slot constants
//@ include trace.glsl
//@ include decals.glsl
//@ include relief.glsl
// decals.rendering.offset_tree.Shell, axes in the order z, y, x
uniform sampler3D shell;  // of each cell: a point of the surface near its middle; w: no surface is nearer to the middle
uniform vec3 shell_lower;
uniform float shell_cell;
uniform ivec3 shell_counts;

const float LEAST_FREE = 0.25;         // of a cell: shorter ways through free space are not taken at once
const float LONGEST = 4.0;             // step, over the greatest one of parallax: a quarter of the least radius
const float SHORTEST = 0.125;          // step, over the same: a 128th of the least radius
const float STEPS_PER_RADIUS = 16.0;   // of parallax: relief_step is a 16th of the least radius
const int SEED_STEPS = 12;             // of the search for a foot from a point of the shell
const int FOOT_STEPS = 4;              // and from the foot before
const float LEAST_SPREAD = 0.5;        // factor between steps over the surface and below it, in hollows
const float WEIGHT_ROUNDING = 0.004;   // of interpolation in the shell, in cells

struct Foot {
    vec3 place;
    vec3 normal;
    float bend;     // curvature of the surface where the foot moved last
    float height;   // of the point above the foot, negative inside
};

ivec2 span_at(vec3 q) {
    ivec3 cell = clamp(ivec3(floor((q - grid_lower) / block_size)), ivec3(0), grid_counts - 1);
    int i = (cell.x * grid_counts.y + cell.y) * grid_counts.z + cell.z;
    int block = texelFetch(blocks, ivec2(i & 4095, i >> 12), 0).x;
    int start = block >= 0 ? block : tape_start;
    return ivec2(start + 1, start + 1 + int(tape_texel(tape, start).x));
}

// Distance within which there is no surface around the point at a place in cells of the shell. Interpolation between
// points that lie h apart adds at most 3 h^2 / (8 d) to a distance d, since distances are convex, and at most 0.87 h.
float free_distance(vec3 place) {
    float v = texture(shell, (place / vec3(shell_counts)).zyx).w / shell_cell - WEIGHT_ROUNDING;
    return shell_cell * (v > 1.31 ? 0.5 * (v + sqrt(v * v - 1.5)) : v - 0.87);
}

// Unit normal at a point near the surface; w: distance to the surface along it.
vec4 normal_near(vec3 q) {
    vec4 f = field_gradient(q, tape, span_at(q));
    float steepness = max(length(f.yzw), 1e-20);
    return vec4(-f.yzw / steepness, clamp((f.x - 0.5) / steepness, -shell_cell, shell_cell));
}

// Move a foot below p, in steps over tangent planes, which are shortened as the surface curves; to within `near`.
void move_foot(inout Foot foot, vec3 p, int most, float near) {
    for (int i = 0; i <= most; i++) {
        vec3 offset = p - foot.place;
        foot.height = dot(offset, foot.normal);
        vec3 along = offset - foot.height * foot.normal;
        float way = length(along);
        bool known = dot(foot.normal, foot.normal) > 0.0;
        if (i == most || (known && way <= near)) {
            break;
        }
        float spread = max(1.0 + foot.bend * foot.height, LEAST_SPREAD);
        vec3 place = foot.place + (known ? along * min(1.0 / spread, 2.0 * shell_cell / way) : vec3(0.0));
        vec4 found = normal_near(place);
        place += found.w * found.xyz;
        vec3 moved = place - foot.place;
        if (known && dot(moved, moved) > 1e-6 * shell_cell * shell_cell) {
            foot.bend = dot(found.xyz - foot.normal, moved) / dot(moved, moved);
        }
        foot.place = place;
        foot.normal = found.xyz;
    }
    float apart = length(p - foot.place);  // at creases no foot is reached
    foot.height = foot.height < 0.0 ? -apart : apart;
}

// How near a point of a ray is to the moved surface, or to the highest point of all heights where it lies higher.
struct Nearness {
    float gap;
    float nearing;  // rate at which the distance to the surface shrinks at most, on the ray ahead
    float leaving;  // the same on the way back
    float across;   // the part of the ray's direction along the surface
    float pace;     // way of the foot over that of a point along the surface; 0 above all heights
    vec4 slopes;    // by which the heights rise at most on the point's way, up to each of the cone lengths of the foot's
};

// Heights are looked up if all of them together are nearer than `near`.
Nearness nearness(Foot foot, vec3 direction, float near) {
    float fall = -dot(direction, foot.normal);
    float across = sqrt(max(1.0 - fall * fall, 0.0));
    float bend = 0.125 * across * across;
    Nearness found = Nearness(
        foot.height - relief_range.y, max(bend + fall, 1e-6), max(bend - fall, 1e-6), across, 0.0, vec4(0.0));
    if (found.gap <= near) {
        found.gap = foot.height - relief_height(foot.place, foot.normal);
        found.pace = 1.0 / max(1.0 + foot.bend * foot.height, LEAST_SPREAD);
        found.slopes = found.pace * relief_slopes;
    }
    return found;
}

// Way along a ray outside: the gap shrinks at this rate, and by a part of the slopes.
float way_outside(Nearness near, float rate, float part) {
    vec4 ways = max(near.gap, 0.0) / (rate + part * near.across * near.slopes);
    ways = min(ways, cone_lengths / max(near.across * near.pace, 1e-6));
    return max(max(ways.x, ways.y), max(ways.z, ways.w));
}

// Way from a point through space above all heights.
float free_way(vec3 p) {
    return free_distance((p - shell_lower) / shell_cell) - max(relief_range.y, -relief_range.x);
}

// Move a foot below the next point of a ray; `tracked`: it is near already.
void follow(inout Foot foot, vec3 p, bool tracked, float near) {
    ivec3 cell = clamp(ivec3((p - shell_lower) / shell_cell), ivec3(0), shell_counts - 1);
    vec3 seed = texelFetch(shell, cell.zyx, 0).xyz;
    bool seeded = !tracked || distance(p, seed) < distance(p, foot.place);
    if (seeded) {
        foot = Foot(seed, vec3(0.0), 0.0, 0.0);
    }
    move_foot(foot, p, seeded ? SEED_STEPS : FOOT_STEPS, near);
}

void read_receivers() {
#ifdef LIMITED
    surface_receivers = texelFetch(object_masks, ivec2(object_id & 4095, object_id >> 12), 0).x;
#endif
}
