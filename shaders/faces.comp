// The nearest face of a mesh at each pixel: cards that rasterise slowly do this fast. An invocation for each face.
// It runs twice: it writes the least depths, and then, NAMING, the least number of the faces that have them.
// Faces that may cover many pixels are listed in shares. SHARES: draw these, a group each.
#ifdef SHARES
layout(local_size_x = GROUP, local_size_y = GROUP) in;
#else
layout(local_size_x = FACE_GROUP) in;
uniform int first_face;
uniform int end_face;
#endif
//@ include camera.glsl
//@ include face_rows.glsl
uniform ivec2 tile_size;
uniform ivec2 row_range;  // the first, and that after the last
uniform bool naming;

layout(std430, binding = 3) buffer FaceShares {
    uint share_groups[3];  // that draw the list
    uint share_count;
    uint spare_taken;      // shares beside one for each listed face
    ivec3 shares[];        // face, number of the share, number of shares
};

const uint MAX_SHARE_GROUPS = 65535u;  // that every driver runs
const float COVER = 0.002;  // pixels beyond its edges that a face covers, so that rounding leaves no gaps
const float FAR_COVER = 1e-6;  // the same for corners far outside of the picture, relative to their distance
const float FEW_PIXELS = 256.0;  // that one invocation draws
const float SHARE_PIXELS = 2048.0;
const float MAX_SHARES = 256.0;

int share = 0;
int share_total = 1;

void draw_pixel(ivec2 texel, float depth, int face) {
    uint bits = floatBitsToUint(depth);
    if (!naming) {
        imageAtomicMin(face_depth, texel, bits);
    } else if (imageLoad(face_depth, texel).x == bits) {
        imageAtomicMin(face_number, texel, uint(face));
    }
}

#ifndef SHARES
void list_shares(int face, float pixels) {
    uint spare = uint(min(ceil(pixels / SHARE_PIXELS), MAX_SHARES)) - 1u;
    if (spare > 0u && atomicAdd(spare_taken, spare) + spare > uint(SPARE_SHARES)) {
        spare = 0u;
    }
    uint total = spare + 1u, first = atomicAdd(share_count, total);
    for (uint number = 0u; number < total; ++number) {
        shares[first + number] = ivec3(face, number, total);
    }
    atomicMax(share_groups[0], min(first + total, MAX_SHARE_GROUPS));
}
#endif

vec2 window_point(vec4 clip) {
    return (0.5 * clip.xy / clip.w + 0.5) * vec2(tile_size);
}

// Extend a box by the visible part of an edge.
void hold_edge(vec4 from, vec4 to, inout vec2 lower, inout vec2 upper) {
    float begin = from.z + from.w, end = to.z + to.w;
    if (begin <= 0.0 && end <= 0.0) {
        return;
    }
    vec2 first = window_point(begin > 0.0 ? from : mix(from, to, begin / (begin - end)));
    vec2 last = window_point(end > 0.0 ? to : mix(from, to, begin / (begin - end)));
    lower = min(lower, min(first, last));
    upper = max(upper, max(first, last));
}

// Draw the part of a face before the near plane, or a share of it. Edges are planes through the eye, so no corner has
// to lie before it (Olano and Greer, Triangle Scan Conversion Using 2D Homogeneous Coordinates, 1997).
void draw_face(int face) {
    vec4 a = view_projection * vec4(vector_at(corner_at(face, 0)), 1.0);
    vec4 b = view_projection * vec4(vector_at(corner_at(face, 1)), 1.0);
    vec4 c = view_projection * vec4(vector_at(corner_at(face, 2)), 1.0);
    vec2 size = vec2(tile_size), lower = size, upper = vec2(0.0);
    hold_edge(a, b, lower, upper);
    hold_edge(b, c, lower, upper);
    hold_edge(c, a, lower, upper);
    lower = ceil(max(lower - FAR_COVER * abs(lower) - 0.5 - COVER, 0.0));
    upper = floor(min(upper + FAR_COVER * abs(upper) - 0.5 + COVER, size - 1.0));
    vec2 middle = floor(0.5 * (lower + upper)) + 0.5;
    lower.y = max(lower.y, float(row_range.x));
    upper.y = min(upper.y, float(row_range.y - 1));
    vec2 sides = upper - lower + 1.0;
    if (sides.x <= 0.0 || sides.y <= 0.0) {
        return;
    }
    // pixels from the middle of the box, times w: near it differences lose no digits
    mat3 corners;
    corners[0] = vec3(0.5 * size * a.xy + (0.5 * size - middle) * a.w, a.w);
    corners[1] = vec3(0.5 * size * b.xy + (0.5 * size - middle) * b.w, b.w);
    corners[2] = vec3(0.5 * size * c.xy + (0.5 * size - middle) * c.w, c.w);
    vec3 from_bc = cross(corners[1], corners[2]), from_ca = cross(corners[2], corners[0]);
    vec3 from_ab = cross(corners[0], corners[1]);
    float volume = dot(corners[0], from_bc);
    if (volume == 0.0) {
        return;
    }
#ifndef SHARES
    float pixels = sides.x * sides.y;
    if (pixels > FEW_PIXELS) {
        list_shares(face, pixels);
        return;
    }
#endif
    vec3 depths = (a.z * from_bc + b.z * from_ca + c.z * from_ab) / volume;
    float nearest = -2.0, farthest = 2.0;  // beyond the planes: no bounds, where a corner lies behind the near plane
    if (min(a.z + a.w, min(b.z + b.w, c.z + c.w)) > 0.0) {
        // a small face that is seen from the side must not reach beyond its corners
        vec3 ends = vec3(a.z / a.w, b.z / b.w, c.z / c.w);
        nearest = min(ends.x, min(ends.y, ends.z));
        farthest = max(ends.x, max(ends.y, ends.z));
    }
    float turn = sign(volume);
    mat3 edges = turn * mat3(from_bc, from_ca, from_ab);
    vec3 least = -COVER * vec3(
        abs(from_bc.x) + abs(from_bc.y), abs(from_ca.x) + abs(from_ca.y), abs(from_ab.x) + abs(from_ab.y));
    ivec2 first = ivec2(lower), end = ivec2(upper) + 1;
#ifdef SHARES
    ivec2 blocks = (end - first - 1) / GROUP + 1;
    for (int block = share; block < blocks.x * blocks.y; block += share_total) {
        ivec2 texel = first + GROUP * ivec2(block % blocks.x, block / blocks.x) + ivec2(gl_LocalInvocationID.xy);
        if (any(greaterThanEqual(texel, end))) {
            continue;
        }
#else
    for (ivec2 texel = first; texel.y < end.y; texel = texel.x + 1 < end.x ? texel + ivec2(1, 0) : ivec2(first.x, texel.y + 1)) {
#endif
        vec3 pixel = vec3(vec2(texel) + 0.5 - middle, 1.0);
        float depth = clamp(dot(depths, pixel), nearest, farthest);
        vec3 inside = pixel * edges;
        if (volume < 0.0 && farthest <= 1.0 && min(inside.x, min(inside.y, inside.z)) < 0.0) {
            depth = farthest;  // beside a silhouette the front face is seen, not the back face behind the same edge
        }
        if (all(greaterThanEqual(inside, least)) && abs(depth) <= 1.0) {
            draw_pixel(texel, 0.5 * depth + 0.5, face);
        }
    }
}

void main() {
#ifdef SHARES
    for (uint number = gl_WorkGroupID.x; number < share_count; number += gl_NumWorkGroups.x) {
        share = shares[number].y;
        share_total = shares[number].z;
        draw_face(shares[number].x);
    }
#else
    int step = FACE_GROUP * int(gl_NumWorkGroups.x);
    for (int face = first_face + int(gl_GlobalInvocationID.x); face < end_face; face += step) {
        draw_face(face);
    }
#endif
}
