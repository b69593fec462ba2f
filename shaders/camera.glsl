// The camera of this tile: clip space, and the ray through every pixel.
layout(std140) uniform CameraBlock {
    mat4 view_projection;
    vec4 eye;         // xyz
    vec4 ray_corner;  // xyz: direction through the tile's lower left corner; its part along the view is 1
    vec4 ray_right;   // xyz: what one pixel to the right adds to it
    vec4 ray_up;      // xyz: what one pixel up adds to it
};

// Direction, not unit, from the eye through a place in pixels such as gl_FragCoord.xy.
vec3 ray_direction(vec2 pixel) {
    return ray_corner.xyz + pixel.x * ray_right.xyz + pixel.y * ray_up.xyz;
}

// What gl_FragDepth must be at a point, equal to what a rasterised triangle there gets.
float window_depth(vec3 position) {
    vec4 clip = view_projection * vec4(position, 1.0);
    return 0.5 * clip.z / clip.w + 0.5;
}
