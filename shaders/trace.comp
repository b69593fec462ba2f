// The same object as trace.frag draws as a compute shader, for GLSL 4.30 on: an invocation for every pixel of its
// box's rectangle. Compute shaders write no depth buffer, so positions are compared.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
//@ include trace.glsl
uniform ivec4 rectangle;  // lower left corner, size

layout(binding = 0, rgba32f) uniform image2D g_position;
layout(binding = 1) writeonly uniform image2D g_normal;
layout(binding = 2) writeonly uniform image2D g_color;

void main() {
    ivec2 offset = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(offset, rectangle.zw))) {
        return;
    }
    ivec2 texel = rectangle.xy + offset;
    float start = resumed_way(texel);
    if (start < 0.0) {
        return;
    }
    Hit hit = trace_pixel(vec2(texel) + 0.5, start);
    vec4 before = imageLoad(g_position, texel);
    bool missed =
        hit.distance < 0.0 || (before.w > 0.0 && dot(before.xyz - hit.position, hit.direction) <= 0.0);
    Surface surface;
    if (!missed) {
        surface = surface_of(hit);
    }
    if (!complete(texel) || missed) {
        return;
    }
    imageStore(g_position, texel, surface.position);
    imageStore(g_normal, texel, surface.normal);
    imageStore(g_color, texel, surface.color);
}
