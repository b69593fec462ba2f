// The same pass as pixels.frag as a compute shader, for GLSL 4.30 on: an invocation a pixel. FILTERED: each group lists its
// divided pixels, so that few of its invocations draw them, side by side.
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

void store(ivec2 texel, Pixel pixel) {
    imageStore(out_color, texel, pixel.color);
#ifdef TWO_TARGETS
    imageStore(out_buffers, texel, pixel.buffers);
#endif
#ifdef MATERIALS
    imageStore(out_material, texel, pixel.material);
    imageStore(out_glow, texel, pixel.glow);
#endif
}

#ifdef FILTERED
shared int divided_count;
shared ivec2 divided_texels[GROUP * GROUP];
#endif

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy) + first_texel;
    bool inside = all(lessThan(texel, end_texel));
#ifdef FILTERED
    int number = int(gl_LocalInvocationIndex);
    if (number == 0) {
        divided_count = 0;
    }
    barrier();
    if (inside) {
        Pixel pixel = pixel_at(texel, false);
        if (pixel_divided) {
            divided_texels[atomicAdd(divided_count, 1)] = texel;
        } else {
            store(texel, pixel);
        }
    }
    barrier();
    for (int i = number; i < divided_count; i += GROUP * GROUP) {
        store(divided_texels[i], pixel_at(divided_texels[i], true));
    }
#else
    if (inside) {
        store(texel, pixel_at(texel));
    }
#endif
}
