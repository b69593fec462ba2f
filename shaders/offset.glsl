// The ray through a pixel against a BlobTree whose surface heights move; body of offset.frag and offset.comp.
//@ include footprint.glsl
//@ include offset_foot.glsl
//@ include octahedron.glsl
uniform sampler2D starts;  // see offset_start.glsl

const int OFFSET_STEPS = 256;
const float STEPS_PER_GROWTH = 16.0;  // after which the shortest step is longer by itself
const float RELAXATION = 0.65;        // part of the slope of its cone that the surface is first assumed to rise by

// First point of a ray on the moved surface: distance along it, or -1; its foot, and the height
// there. The ray is outside up to `start`.
float offset_ray(vec3 origin, vec3 direction, float start, inout Foot foot, out float height) {
    vec2 range = box_interval(origin, direction, shell_lower, shell_lower + shell_cell * vec3(shell_counts));
    float exactness = 0.1 * tolerance;
    float shortest = max(SHORTEST * relief_step, tolerance);
    float longest = min(shell_cell, LONGEST * relief_step);
    float t = max(range.x, start);
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
        float free = free_way(p);
        if (free > LEAST_FREE * shell_cell) {
            tracked = false;
            if (t - free > known) {
                t = known;  // the step before was too long
            } else {
                t = known = t + free;
            }
            continue;
        }
        follow(foot, p, tracked, met ? exactness : 0.1 * shortest);
        tracked = true;
        Nearness near = nearness(foot, direction, exactness);
        if (!met && t - way_outside(near, near.leaving, 1.0) > known) {
            t = known;  // the step before was too long
            continue;
        }
        met = met || near.gap <= 0.0;
        height = foot.height - near.gap;
        float now = t;
        if (near.gap > 0.0) {
            outside = vec2(t, near.gap);
            float least = shortest * max(1.0, float(i) / STEPS_PER_GROWTH);
            known = t + clamp(way_outside(near, near.nearing, 1.0), least, longest);
            t += clamp(way_outside(near, near.nearing, RELAXATION), least, longest);
        } else {
            inside = vec2(t, near.gap);
        }
        if (met) {
            float share = outside.y / max(outside.y - inside.y, 1e-30);
            float hit = outside.y < 0.0 ? now : mix(outside.x, inside.x, share);  // where the gap is 0 if it changes evenly
            if (abs(hit - now) <= tolerance) {
                return hit;
            }
            t = mix(outside.x, inside.x, clamp(share, 0.1, 0.9));
        }
    }
    return met ? inside.x : -1.0;
}

// The moved surface at a pixel, and below it the surface at rest: the targets of rest.frag.
struct Offset {
    Surface surface;  // position.w = 0: none
    vec4 rest;
    vec4 rest_right;
    vec4 rest_up;
};

Offset offset_pixel(vec2 pixel) {
    read_receivers();
    Offset result;
    result.surface.position = vec4(0.0);
    vec3 origin = ray_origin(pixel);
    vec3 direction = normalize(ray_direction(pixel));
    Foot foot = Foot(vec3(0.0), vec3(0.0), 0.0, 0.0);
    float height = 0.0;
    float t = offset_ray(origin, direction, texelFetch(starts, ivec2(pixel) / BLOCK, 0).x, foot, height);
    vec3 position = origin + t * direction;
    float depth = window_depth(position);
    if (t < 0.0 || depth < 0.0 || depth > 1.0) {
        return result;
    }
    vec3 n = foot.normal;
    vec3 axis = normalize(abs(n.x) < 0.6 ? cross(n, vec3(1.0, 0.0, 0.0)) : cross(n, vec3(0.0, 1.0, 0.0)));
    vec3 second = cross(n, axis);
    float reach = 0.125 * relief_step;
    mat2x3 steps;  // of the moved surface over those of the surface at rest, by differences
    for (int i = 0; i < 2; i++) {
        vec3 way = i == 0 ? axis : second;
        vec3 ahead = foot.place + reach * way;
        vec3 n_ahead = normal_near(ahead).xyz;
        steps[i] = way + (relief_height(ahead, n_ahead) * n_ahead - height * n) / reach;
    }
    vec3 area = cross(steps[0], steps[1]);
    vec3 normal = dot(area, direction) > 0.0 ? -area : area;
    vec3 color = interpret_color(foot.place, vec3(0.0), 0.0, tape, span_at(foot.place)).yzw;
    result.surface = surface_at(position, normal, color, true);
    normal = result.surface.normal.xyz;
    result.rest = vec4(foot.place, float(object_id + 1));
    vec2 rest_normal = on_octahedron(n);
    vec3 ray = ray_direction(pixel);
    for (int i = 0; i < 2; i++) {
        vec3 moved = surface_step(position, normal, ray, i == 0 ? ray_right.xyz : ray_up.xyz);
        vec2 share = vec2(dot(cross(moved, steps[1]), area), dot(cross(steps[0], moved), area));
        vec4 rest = vec4((share.x * axis + share.y * second) / max(dot(area, area), 1e-20), rest_normal[i]);
        if (i == 0) {
            result.rest_right = rest;
        } else {
            result.rest_up = rest;
        }
    }
    return result;
}
