// The ray through a pixel against an implicit object (blobtree/tracing/rays.py); body of trace.frag and trace.comp.
#ifdef MANY_KINDS
#pragma optionNV(inline none)  // else NVIDIA's compiler copies functions into their callers, for minutes
#endif
//@ include camera.glsl
//@ include surface.glsl
//@ include loop_guard.glsl
// blobtree.tracing.tree_cells.TracingCells
uniform sampler2D tape;
uniform int tape_start;
uniform isampler2D blocks;
uniform vec3 grid_lower;
uniform float block_size;
uniform ivec3 grid_counts;
uniform float tolerance;

vec4 tape_texel(sampler2D data, int i) {
    return texelFetch(data, ivec2(i & 4095, i >> 12), 0);
}

//@ slot library
//@ slot dispatch
//@ slot evaluators

vec3 field_bound(vec3 q, vec3 direction, float reach, sampler2D tape_, ivec2 span) {
    return interpret_bound(q, direction, reach, tape_, span);
}

vec4 field_gradient(vec3 q, sampler2D tape_, ivec2 span) {
    return interpret_gradient(q, vec3(0.0), 0.0, tape_, span);
}

// First intersection of the ray through a position in pixels, such as gl_FragCoord.xy.
struct Hit {
    float distance;  // along the ray, below 0 for a miss
    vec3 direction;  // unit
    vec3 position;
    ivec2 span;      // of the tape in the block of the hit
};

Hit trace_pixel(vec2 pixel, float start) {
    vec3 origin = ray_origin(pixel);
    vec3 direction = normalize(ray_direction(pixel));
    vec3 hit = trace_ray(origin, direction, start);
    vec3 position = origin + direction * hit.x;
    float depth = window_depth(position);
    if (depth < 0.0 || depth > 1.0) {
        hit.x = -1.0;  // a clipping plane hides it
    }
    return Hit(hit.x, direction, position, ivec2(hit.yz));
}

Surface surface_of(Hit hit) {
    vec3 normal = -field_gradient(hit.position, tape, hit.span).yzw;
    return surface_at(hit.position, normal, interpret_color(hit.position, vec3(0.0), 0.0, tape, hit.span).yzw, true);
}
