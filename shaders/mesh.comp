// A mesh's surface in the G-buffer, of the nearest face at each pixel of a rectangle. Empties the faces' textures there.
// BASE: colours are linear light. TEXTURED: they are multiplied by a texture's.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
//@ include camera.glsl
//@ include face_rows.glsl
//@ include surface.glsl
#ifdef TEXTURED
//@ include base_texture.glsl
#endif
uniform ivec4 rectangle;  // lower left corner, size

layout(binding = 2, rgba32f) uniform image2D g_position;
layout(binding = 3) writeonly uniform image2D g_normal;
layout(binding = 4) writeonly uniform image2D g_color;

struct Face {
    ivec3 corners;  // places in `rows`
    vec3 a;
    vec3 b;
    vec3 c;
};

Face face_of(int number) {
    ivec3 corners = ivec3(corner_at(number, 0), corner_at(number, 1), corner_at(number, 2));
    return Face(corners, vector_at(corners.x), vector_at(corners.y), vector_at(corners.z));
}

// Weights of the corners where the ray through a pixel meets the plane.
vec3 plane_weights(Face face, vec2 pixel) {
    vec3 origin = ray_origin(pixel), ray = ray_direction(pixel);
    vec3 a = face.a - origin, b = face.b - origin, c = face.c - origin;
    vec3 weights = vec3(dot(cross(b, c), ray), dot(cross(c, a), ray), dot(cross(a, b), ray));
    return weights / (weights.x + weights.y + weights.z);
}

// Where the ray through a pixel meets the plane, not beyond the corners.
vec3 plane_point(Face face, vec2 pixel) {
    vec3 origin = ray_origin(pixel), ray = ray_direction(pixel);
    vec3 normal = cross(face.b - face.a, face.c - face.a);
    vec3 ways = (ray * mat3(face.a - origin, face.b - origin, face.c - origin)) / dot(ray, ray);
    float way = dot(normal, face.a - origin) / dot(normal, ray);
    return origin + clamp(way, min(ways.x, min(ways.y, ways.z)), max(ways.x, max(ways.y, ways.z))) * ray;
}

// Three numbers of the vertices, from a column on.
vec3 vector_on(Face face, vec3 weights, int column) {
    ivec3 places = face.corners + column;
    return mat3(vector_at(places.x), vector_at(places.y), vector_at(places.z)) * weights;
}

#ifdef TEXTURED
vec2 coordinates_on(Face face, vec3 weights) {
    ivec3 u = face.corners + 9, v = u + 1;
    return vec2(dot(vec3(rows[u.x], rows[u.y], rows[u.z]), weights), dot(vec3(rows[v.x], rows[v.y], rows[v.z]), weights));
}

vec3 texture_light_on(Face face, vec3 weights, vec2 pixel) {
    vec2 here = coordinates_on(face, weights);
    vec2 right = coordinates_on(face, plane_weights(face, pixel + vec2(1.0, 0.0)));
    vec2 up = coordinates_on(face, plane_weights(face, pixel + vec2(0.0, 1.0)));
    return texture_light(here, right - here, up - here);
}
#endif

void main() {
    ivec2 offset = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(offset, rectangle.zw))) {
        return;
    }
    ivec2 texel = rectangle.xy + offset;
    uint number = imageLoad(face_number, texel).x;
    if (number == NO_FACE) {
        return;
    }
    imageStore(face_depth, texel, uvec4(NO_FACE));
    imageStore(face_number, texel, uvec4(NO_FACE));
    Face face = face_of(int(number));
    vec2 pixel = vec2(texel) + 0.5;
    vec3 ray = ray_direction(pixel);
    vec3 weights = max(plane_weights(face, pixel), 0.0);  // a pixel may lie a rounding beyond an edge
    weights /= weights.x + weights.y + weights.z;
    vec3 position = plane_point(face, pixel);
    vec4 before = imageLoad(g_position, texel);
    if (before.w > 0.0 && dot(before.xyz - position, ray) <= 0.0) {
        return;
    }
    bool is_mirrored = dot(cross(ray_right.xyz, ray_up.xyz), ray_corner.xyz) > 0.0;
    bool outside = (dot(cross(face.b - face.a, face.c - face.a), ray) < 0.0) != is_mirrored;
    vec3 normal = vector_on(face, weights, 3), color = vector_on(face, weights, 6);
#ifdef TEXTURED
    color *= texture_light_on(face, weights, pixel);
#endif
#ifdef BASE
    Surface surface = surface_in_light(position, normal, color, outside);
#else
    Surface surface = surface_at(position, normal, color, outside);
#endif
    imageStore(g_position, texel, surface.position);
    imageStore(g_normal, texel, surface.normal);
    imageStore(g_color, texel, surface.color);
}
