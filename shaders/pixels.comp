// The same pass as pixels.frag as a compute shader, for GLSL 4.30 on: an invocation a pixel.
layout(local_size_x = GROUP, local_size_y = GROUP) in;
uniform ivec2 first_texel;  // the lower left one of a rectangle
uniform ivec2 end_texel;    // past its upper right one

//@ slot body

layout(binding = 0) writeonly uniform image2D out_color;
#ifdef TWO_TARGETS
layout(binding = 1) writeonly uniform image2D out_buffers;
#endif
#ifdef MATERIALS
#ifdef TWO_TARGETS
layout(binding = 2) writeonly uniform image2D out_material;
layout(binding = 3) writeonly uniform image2D out_glow;
#else
layout(binding = 1) writeonly uniform image2D out_material;
layout(binding = 2) writeonly uniform image2D out_glow;
#endif
#endif

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy) + first_texel;
    if (any(greaterThanEqual(texel, end_texel))) {
        return;
    }
    Pixel pixel = pixel_at(texel);
    imageStore(out_color, texel, pixel.color);
#ifdef TWO_TARGETS
    imageStore(out_buffers, texel, pixel.buffers);
#endif
#ifdef MATERIALS
    imageStore(out_material, texel, pixel.material);
    imageStore(out_glow, texel, pixel.glow);
#endif
}
