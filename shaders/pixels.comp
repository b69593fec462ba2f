// The same pass as pixels.frag as a compute shader, for GLSL 4.30 on: an invocation a pixel.
// MARKED: list the pixels of which the body sets `pixel_divided`. LISTED: draw the listed pixels.
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

void draw_pixel(ivec2 texel) {
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

#if defined(MARKED) || defined(LISTED)
const uint MAX_LIST_GROUPS = 65535u;  // that every driver runs
layout(std430, binding = 0) buffer PixelList {
    uint list_groups[3];  // that draw the list
    uint list_count;
    uint list_texels[];   // x, and 65536 times y
};
#endif

#ifdef MARKED
shared uint group_count;
shared uint group_begin;

void list_pixel(ivec2 texel, bool listed) {
    group_count = 0u;
    barrier();
    uint number = listed ? atomicAdd(group_count, 1u) : 0u;
    barrier();
    if (gl_LocalInvocationIndex == 0u && group_count > 0u) {
        group_begin = atomicAdd(list_count, group_count);
        uint groups = (group_begin + group_count - 1u) / uint(GROUP * GROUP) + 1u;
        atomicMax(list_groups[0], min(groups, MAX_LIST_GROUPS));
    }
    barrier();
    if (listed) {
        list_texels[group_begin + number] = uint(texel.x) | uint(texel.y) << 16;
    }
}
#endif

void main() {
#ifdef LISTED
    uint members = uint(GROUP * GROUP);
    for (uint first = gl_WorkGroupID.x * members; first < list_count; first += gl_NumWorkGroups.x * members) {
        // the last group draws its last pixel several times
        uint texel = list_texels[min(first + gl_LocalInvocationIndex, list_count - 1u)];
        draw_pixel(ivec2(texel & 65535u, texel >> 16));
    }
#else
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy) + first_texel;
    bool inside = all(lessThan(texel, end_texel));
    if (inside) {
        draw_pixel(texel);
    }
#ifdef MARKED
    list_pixel(texel, inside && pixel_divided);
#endif
#endif
}
