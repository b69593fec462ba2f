// The ray through a pixel against a BlobTree whose surface the heights of decals move along its normals; body of
// offset.frag and offset.comp. A point p is outside where its distance to the surface exceeds the height at its foot,
// the closest point of the surface. LIMITED: decals have receivers or fades.
//@ include decal_data.glsl
#ifdef LIMITED
uniform isampler2D object_masks;
#endif
int surface_receivers = -1;  // mask of the object, see decals/receivers.py
//@ slot constants
//@ include trace.glsl
//@ include decals.glsl
//@ include relief.glsl
// decals.rendering.offset_tree.Shell
uniform sampler2D shell;  // of each cell: a point of the surface near its middle; w: no surface is nearer to the middle
uniform vec3 shell_lower;
uniform float shell_cell;
uniform ivec3 shell_counts;

const int OFFSET_STEPS = 256;
const float SHORTEST = 0.125;         // step, over the greatest one of parallax: a 128th of the least radius
const float LONGEST = 4.0;            // step, over the same
const float STEPS_PER_GROWTH = 16.0;  // after which the shortest step is longer by itself
const int SEED_STEPS = 12;            // of the search for a foot from a point of the shell
const int FOOT_STEPS = 4;             // and from the foot before
const float RELAXATION = 0.6;         // part of the slope of its cone that the surface is first assumed to rise by
const float LEAST_SPREAD = 0.5;       // factor between steps over the surface and below it, in hollows

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

// First point of a ray on the moved surface: distance along it, or -1; and its foot.
float offset_ray(vec3 origin, vec3 direction, inout Foot foot) {
    vec2 range = box_interval(origin, direction, shell_lower, shell_lower + shell_cell * vec3(shell_counts));
    float exactness = 0.1 * tolerance;
    float shortest = max(SHORTEST * relief_step, tolerance);
    float longest = min(shell_cell, LONGEST * relief_step);
    float t = range.x;
    vec2 outside = vec2(t, -1.0);  // the last place on the ray outside, and the gap there; -1: none
    vec2 inside = vec2(0.0);       // the first place inside
    float known = t;               // up to here the ray is outside, as cones tell
    bool tracked = false;
    bool met = false;
    for (int i = 0; i < OFFSET_STEPS; i++) {
        if (t > range.y) {
            return -1.0;
        }
        vec3 p = origin + t * direction;
        ivec3 cell = clamp(ivec3(floor((p - shell_lower) / shell_cell)), ivec3(0), shell_counts - 1);
        vec4 seed = tape_texel(shell, (cell.x * shell_counts.y + cell.y) * shell_counts.z + cell.z);
        float free = seed.w - distance(p, shell_lower + (vec3(cell) + 0.5) * shell_cell);
        free -= max(relief_range.y, -relief_range.x);
        if (free > 0.25 * shell_cell) {
            tracked = false;
            if (t - free > known) {
                t = known;  // the step before was too long
            } else {
                t = known = t + free;
            }
            continue;
        }
        bool seeded = !tracked || distance(p, seed.xyz) < distance(p, foot.place);
        if (seeded) {
            foot = Foot(seed.xyz, vec3(0.0), 0.0, 0.0);
        }
        move_foot(foot, p, seeded ? SEED_STEPS : FOOT_STEPS, met ? exactness : 0.1 * shortest);
        tracked = true;
        float nearing = 1.0;  // rates at which the distance to the surface shrinks at most, ahead and back
        float leaving = 1.0;
        float rise = 0.0;     // and the heights grow
        float gap = foot.height - relief_range.y;
        if (gap <= exactness) {
            gap = foot.height - relief_height(foot.place, foot.normal);
            float fall = -dot(direction, foot.normal);
            float across = sqrt(max(1.0 - fall * fall, 0.0));
            nearing = max(0.125 * across * across + fall, 1e-6);
            leaving = max(0.125 * across * across - fall, 1e-6);
            rise = across * relief_slope / max(1.0 + foot.bend * foot.height, LEAST_SPREAD);
        }
        if (!met && t - max(gap, 0.0) / (leaving + rise) > known) {
            t = known;  // the step before was too long
            continue;
        }
        met = met || gap <= 0.0;
        float now = t;
        if (gap > 0.0) {
            outside = vec2(t, gap);
            float least = shortest * max(1.0, float(i) / STEPS_PER_GROWTH);
            known = t + clamp(gap / (nearing + rise), least, longest);
            t += clamp(gap / (nearing + RELAXATION * rise), least, longest);
        } else {
            inside = vec2(t, gap);
        }
        if (met) {
            if (abs(gap) <= exactness || inside.x - outside.x <= exactness || outside.y < 0.0) {
                return now;
            }
            t = mix(outside.x, inside.x, clamp(outside.y / (outside.y - inside.y), 0.1, 0.9));
        }
    }
    return met ? inside.x : -1.0;
}

// The moved surface at a pixel, and below it the surface at rest: the targets of rest.frag.
struct Offset {
    Surface surface;  // position.w = 0: none
    vec4 rest;
    vec4 rest_normal;
    vec4 rest_right;
    vec4 rest_up;
};

Offset offset_pixel(vec2 pixel) {
#ifdef LIMITED
    surface_receivers = texelFetch(object_masks, ivec2(object_id & 4095, object_id >> 12), 0).x;
#endif
    Offset result;
    result.surface.position = vec4(0.0);
    vec3 origin = ray_origin(pixel);
    vec3 direction = normalize(ray_direction(pixel));
    Foot foot = Foot(vec3(0.0), vec3(0.0), 0.0, 0.0);
    float t = offset_ray(origin, direction, foot);
    vec3 position = origin + t * direction;
    float depth = window_depth(position);
    if (t < 0.0 || depth < 0.0 || depth > 1.0) {
        return result;
    }
    vec3 n = foot.normal;
    vec3 axis = normalize(abs(n.x) < 0.6 ? cross(n, vec3(1.0, 0.0, 0.0)) : cross(n, vec3(0.0, 1.0, 0.0)));
    vec3 second = cross(n, axis);
    float reach = 0.25 * relief_step;
    mat2x3 steps;  // of the moved surface over those of the surface at rest, by central differences
    for (int i = 0; i < 2; i++) {
        vec3 way = i == 0 ? axis : second;
        vec3 ahead = foot.place + reach * way;
        vec3 behind = foot.place - reach * way;
        vec3 n_ahead = normal_near(ahead).xyz;
        vec3 n_behind = normal_near(behind).xyz;
        vec3 risen = relief_height(ahead, n_ahead) * n_ahead - relief_height(behind, n_behind) * n_behind;
        steps[i] = way + risen / (2.0 * reach);
    }
    vec3 area = cross(steps[0], steps[1]);
    vec3 normal = dot(area, direction) > 0.0 ? -area : area;
    vec3 color = interpret_color(foot.place, vec3(0.0), 0.0, tape, span_at(foot.place)).yzw;
    result.surface = surface_at(position, normal, color, true);
    normal = result.surface.normal.xyz;
    result.rest = vec4(foot.place, float(object_id + 1));
    result.rest_normal = vec4(n, 0.0);
    vec3 ray = ray_direction(pixel);
    for (int i = 0; i < 2; i++) {
        vec3 moved = surface_step(position, normal, ray, i == 0 ? ray_right.xyz : ray_up.xyz);
        vec2 share = vec2(dot(cross(moved, steps[1]), area), dot(cross(steps[0], moved), area));
        vec4 rest = vec4((share.x * axis + share.y * second) / max(dot(area, area), 1e-20), 0.0);
        if (i == 0) {
            result.rest_right = rest;
        } else {
            result.rest_up = rest;
        }
    }
    return result;
}
