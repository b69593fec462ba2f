// The same object as offset.frag draws as a compute shader, for GLSL 4.30 on; positions are compared, as in trace.comp.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
//@ include offset.glsl
uniform ivec4 rectangle;  // lower left corner, size

layout(binding = 0, rgba32f) uniform image2D g_position;
layout(binding = 1) writeonly uniform image2D g_normal;
layout(binding = 2) writeonly uniform image2D g_color;
layout(binding = 3) writeonly uniform image2D r_position;
layout(binding = 4) writeonly uniform image2D r_right;
layout(binding = 5) writeonly uniform image2D r_up;

void main() {
    ivec2 offset = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(offset, rectangle.zw))) {
        return;
    }
    ivec2 texel = rectangle.xy + offset;
    Offset found = offset_pixel(vec2(texel) + 0.5);
    vec4 position = found.surface.position;
    vec4 before = imageLoad(g_position, texel);
    vec3 ahead = ray_direction(vec2(texel) + 0.5);
    if (position.w <= 0.0 || (before.w > 0.0 && dot(before.xyz - position.xyz, ahead) <= 0.0)) {
        return;
    }
    imageStore(g_position, texel, position);
    imageStore(g_normal, texel, found.surface.normal);
    imageStore(g_color, texel, found.surface.color);
    imageStore(r_position, texel, found.rest);
    imageStore(r_right, texel, found.rest_right);
    imageStore(r_up, texel, found.rest_up);
}
