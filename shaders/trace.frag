// An implicit object in the G-buffer: every pixel of its box sends a ray to the surface (blobtree/trace.py).
//@ include gbuffer.glsl
uniform sampler2D tape;
uniform ivec2 tape_span;  // first texel, one past the last
uniform vec3 box_lower;
uniform vec3 box_upper;
uniform float tolerance;  // distance to the surface at which a ray has arrived

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
    float distance_ = trace_ray(eye.xyz, direction, box_lower, box_upper, tolerance, tape, tape_span);
    if (distance_ < 0.0) {
        discard;
    }
    vec3 position = eye.xyz + direction * distance_;
    vec3 normal = -field_gradient(position, tape, tape_span).yzw;
    write_surface(position, normal, interpret_color(position, 0.0, tape, tape_span).yzw);
    gl_FragDepth = window_depth(position);
}
