// The same pass as pixels.frag as a compute shader, for GLSL 4.30 on: an invocation a pixel.
// MARKED: list the pixels of which the body sets `pixel_divided`, with its `pixel_parts`, 1 to 4 along each side.
// LISTED: draw the listed pixels.
#ifdef LISTED
layout(local_size_x = LIST_GROUP) in;
#else
layout(local_size_x = GROUP, local_size_y = GROUP) in;
#endif
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
    uint list_pixels[];   // number of a pixel by rows (28 bits), parts up and to the right (2 bits each)
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
        uint groups = (group_begin + group_count - 1u) / uint(LIST_GROUP) + 1u;
        atomicMax(list_groups[0], min(groups, MAX_LIST_GROUPS));
    }
    barrier();
    if (listed) {
        uint pixel = uint(texel.y * imageSize(out_color).x + texel.x);
        uvec2 parts = uvec2(pixel_parts - 1);
        list_pixels[group_begin + number] = pixel << 4 | parts.y << 2 | parts.x;
    }
}
#endif

void main() {
#ifdef LISTED
    uint members = uint(LIST_GROUP);
    for (uint first = gl_WorkGroupID.x * members; first < list_count; first += gl_NumWorkGroups.x * members) {
        // the last group draws its last pixel several times
        uint listed = list_pixels[min(first + gl_LocalInvocationIndex, list_count - 1u)];
        uint pixel = listed >> 4, width = uint(imageSize(out_color).x);
        pixel_parts = ivec2(listed & 3u, listed >> 2 & 3u) + 1;
        draw_pixel(ivec2(pixel % width, pixel / width));
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
