// Colours of pixels that the invocations of a compute shader's group draw together. Whole pixels and parts of pixels
// stand in one queue, from which each invocation in turn takes one. So none waits while others draw many parts.
const int MEMBERS = LIST_GROUP;

shared ivec2 member_texels[MEMBERS];
shared ivec2 member_parts[MEMBERS];                              // into which each member's pixel is divided
shared int member_begins[MEMBERS];                               // place of the first of them in the queue
shared int queue[MEMBERS * (1 + SIDE_PARTS * SIDE_PARTS)];       // the members whose parts these are
shared int queue_end;
shared vec4 part_colors[MEMBERS];  // of the parts that are drawn at once
#ifdef MATERIALS
shared Maps part_maps[MEMBERS];
#endif

void add_parts(int member, ivec2 parts) {
    int count = parts.x * parts.y;
    int begin = atomicAdd(queue_end, count);
    member_parts[member] = parts;
    member_begins[member] = begin;
    for (int i = begin; i < begin + count; i++) {
        queue[i] = member;
    }
}

// Premultiplied linear colour of the decals at an invocation's pixel, in `pixel_parts` or more. All invocations of the
// group must call it at once.
vec4 shared_color(ivec2 texel) {
    int member = int(gl_LocalInvocationIndex);
    vec4 sum = vec4(0.0);
#ifdef MATERIALS
    clear_materials();
    Maps maps = material_sums();
#endif
    barrier();  // the group may have drawn other pixels before
    member_texels[member] = texel;
    queue_end = 0;
    barrier();
    if (pixel_parts == ivec2(1)) {  // first, because they may have to be divided
        add_parts(member, pixel_parts);
    }
    barrier();
    if (pixel_parts != ivec2(1)) {
        add_parts(member, pixel_parts);
    }
    barrier();
    for (int first = 0, last = 0; first < queue_end; first = last) {
        last = min(first + MEMBERS, queue_end);
        barrier();  // no invocation adds parts before all have read their number
        vec4 color = vec4(0.0);
#ifdef MATERIALS
        clear_materials();
#endif
        if (first + member < last) {
            int pixel = queue[first + member];
            ivec2 parts = member_parts[pixel];
            color = part_color(surface_at(member_texels[pixel]), first + member - member_begins[pixel], parts);
            if (parts != member_parts[pixel]) {
                add_parts(pixel, parts);
            }
        }
        part_colors[member] = color;
#ifdef MATERIALS
        part_maps[member] = material_sums();
#endif
        barrier();
        int begin = member_begins[member];
        int end = begin + member_parts[member].x * member_parts[member].y;
        for (int i = max(begin, first); i < min(end, last); i++) {
            sum += part_colors[i - first];
#ifdef MATERIALS
            maps.normals += part_maps[i - first].normals;
            maps.values += part_maps[i - first].values;
            maps.glow += part_maps[i - first].glow;
#endif
        }
    }
#ifdef MATERIALS
    material_normals = maps.normals;
    material_values = maps.values;
    material_glow = maps.glow;
#endif
    return sum / float(member_parts[member].x * member_parts[member].y);
}
