// An implicit object in the G-buffer: every pixel of its box sends a ray to the surface (blobtree/trace.py).
//@ include gbuffer.glsl
// blobtree.trace.TracingCells
uniform sampler2D tape;
uniform isampler2D nodes;
uniform vec3 grid_lower;
uniform float block_size;
uniform int grid_depth;
uniform float tolerance;

vec4 tape_texel(sampler2D data, int i) {
    return texelFetch(data, ivec2(i & 1023, i >> 10), 0);
}

//@ slot library
//@ slot dispatch
//@ slot readings

vec2 field_bound(vec3 q, float reach, sampler2D tape_, ivec2 span) {
    return interpret_bound(q, reach, tape_, span);
}

vec4 field_gradient(vec3 q, sampler2D tape_, ivec2 span) {
    return interpret_gradient(q, 0.0, tape_, span);
}

void main() {
    vec3 direction = normalize(ray_direction(gl_FragCoord.xy));
    vec3 origin = ray_origin(gl_FragCoord.xy);
    vec3 hit = trace_ray(origin, direction, grid_lower, block_size, grid_depth, tolerance, tape, nodes);
    if (hit.x < 0.0) {
        discard;
    }
    ivec2 span = ivec2(hit.yz);
    vec3 position = origin + direction * hit.x;
    float depth = window_depth(position);
    if (depth < 0.0 || depth > 1.0) {
        discard;  // a clipping plane hides it
    }
    vec3 normal = -field_gradient(position, tape, span).yzw;
    write_surface(position, normal, interpret_color(position, 0.0, tape, span).yzw);
    gl_FragDepth = depth;
}
