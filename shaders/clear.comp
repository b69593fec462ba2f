// Empties the G-buffer, or the rest buffer in its place: where few units fill pixels, faster than by the framebuffer.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
uniform ivec2 first_texel;  // the lower left one of a rectangle
uniform ivec2 end_texel;    // past its upper right one

layout(binding = 0) writeonly uniform image2D g_position;
layout(binding = 1) writeonly uniform image2D g_normal;
layout(binding = 2) writeonly uniform image2D g_color;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy) + first_texel;
    if (all(lessThan(texel, end_texel))) {
        imageStore(g_position, texel, vec4(0.0));
        imageStore(g_normal, texel, vec4(0.0));
        imageStore(g_color, texel, vec4(0.0));
    }
}
