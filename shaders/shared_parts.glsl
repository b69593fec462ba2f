// Colours of pixels that the invocations of a compute shader's group draw together: first each its own pixel, then in
// turn the parts of those that must be divided. So no invocation waits while others draw many parts.
const int MEMBERS = GROUP * GROUP;

shared ivec2 pixel_texels[MEMBERS];
shared ivec2 pixel_parts[MEMBERS];
shared int pixel_begins[MEMBERS];                         // number of a pixel's first part
shared int part_pixels[MEMBERS * SIDE_PARTS * SIDE_PARTS];
shared int part_count;
shared vec4 part_colors[MEMBERS];  // of the parts that are drawn at once
#ifdef MATERIALS
shared Maps part_maps[MEMBERS];
#endif

// Premultiplied linear colour of the decals at an invocation's pixel. All invocations of the group must call it at once.
vec4 shared_color(ivec2 texel) {
    int member = int(gl_LocalInvocationIndex);
    int begin = 0, end = 0;  // parts of this pixel
    vec4 sum = vec4(0.0);
#ifdef MATERIALS
    clear_materials();
    Maps maps = material_sums();
#endif
    barrier();  // the group may have drawn other pixels before
    pixel_texels[member] = texel;
    part_count = 0;
    barrier();
    for (int first = -MEMBERS; first < part_count; first += MEMBERS) {
        bool whole = first < 0;
        bool drawn = whole || first + member < part_count;
        ivec2 parts = ivec2(1);
        vec4 color = vec4(0.0);
#ifdef MATERIALS
        clear_materials();
#endif
        if (drawn) {
            int pixel = whole ? member : part_pixels[first + member];
            int number = 0;
            if (!whole) {
                parts = pixel_parts[pixel];
                number = first + member - pixel_begins[pixel];
            }
            color = part_color(surface_at(pixel_texels[pixel]), number, parts);
        }
        part_colors[member] = color;
#ifdef MATERIALS
        part_maps[member] = material_sums();
#endif
        barrier();  // no invocation adds parts before all have compared their number
        int count = parts.x * parts.y;
        int from = whole ? member : max(begin - first, 0), to = whole ? member + 1 : min(end - first, MEMBERS);
        if (whole && count > 1) {
            begin = atomicAdd(part_count, count);
            end = begin + count;
            pixel_parts[member] = parts;
            pixel_begins[member] = begin;
            for (int i = begin; i < end; i++) {
                part_pixels[i] = member;
            }
            to = from;
        }
        for (int i = from; i < to; i++) {
            sum += part_colors[i];
#ifdef MATERIALS
            maps.normals += part_maps[i].normals;
            maps.values += part_maps[i].values;
            maps.glow += part_maps[i].glow;
#endif
        }
        barrier();
    }
#ifdef MATERIALS
    material_normals = maps.normals;
    material_values = maps.values;
    material_glow = maps.glow;
#endif
    return sum;
}
