// Empties the G-buffer: where few units fill pixels, faster than the framebuffer's own way.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
uniform ivec2 target_size;  // rows below the first one are left as they are
uniform int first_row;

layout(binding = 0) writeonly uniform image2D g_position;
layout(binding = 1) writeonly uniform image2D g_normal;
layout(binding = 2) writeonly uniform image2D g_color;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
    if (all(lessThan(texel, target_size))) {
        imageStore(g_position, texel, vec4(0.0));
        imageStore(g_normal, texel, vec4(0.0));
        imageStore(g_color, texel, vec4(0.0));
    }
}
