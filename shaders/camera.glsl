// The camera of this tile: clip space, and the ray through every pixel.
layout(std140) uniform CameraBlock {
    mat4 view_projection;
    vec4 eye;         // xyz: where the ray through the tile's lower left corner begins; w: 1 in perspective, 0 parallel
    vec4 ray_corner;  // xyz: that ray's direction; in perspective its part along the view is 1, else it is unit
    vec4 ray_right;   // xyz: step of one pixel to the right, of the direction in perspective, else of the origin
    vec4 ray_up;      // xyz: the same for one pixel up
};

// Offset of a position in pixels, such as gl_FragCoord.xy.
vec3 ray_step(vec2 pixel) {
    return pixel.x * ray_right.xyz + pixel.y * ray_up.xyz;
}

vec3 ray_origin(vec2 pixel) {
    return eye.w > 0.0 ? eye.xyz : eye.xyz + ray_step(pixel);
}

vec3 ray_direction(vec2 pixel) {
    return eye.w > 0.0 ? ray_corner.xyz + pixel.x * ray_right.xyz + pixel.y * ray_up.xyz : ray_corner.xyz;
}

// How many times ray_right a point on a ray moves by from pixel to pixel, across the ray.
float ray_spread(vec3 position, vec3 ray) {
    return eye.w > 0.0 ? dot(position - eye.xyz, ray) / dot(ray, ray) : 1.0;
}

// Value of gl_FragDepth at a point, equal to that of a rasterised triangle there.
float window_depth(vec3 position) {
    vec4 clip = view_projection * vec4(position, 1.0);
    return 0.5 * clip.z / clip.w + 0.5;
}

// A smooth normal may point away from the eye at a silhouette: turn it until it is just visible.
vec3 visible_normal(vec3 normal, vec3 toward_eye) {
    return normalize(normal - min(dot(normal, toward_eye) - 1e-3, 0.0) * toward_eye);
}
