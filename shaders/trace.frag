// An implicit object in the G-buffer: every pixel of its box sends a ray to the surface (blobtree/trace.py).
//@ include gbuffer.glsl
uniform sampler2D tape;
uniform sampler2D tape_colors;
uniform int tape_length;  // texels
uniform vec3 box_lower;
uniform vec3 box_upper;
uniform float tolerance;  // distance to the surface at which a ray has arrived

vec4 tape_texel(sampler2D data, int i) {
    return texelFetch(data, ivec2(i & 1023, i >> 10), 0);
}

//@ slot library
//@ slot dispatch
//@ slot readings

vec2 field_bound(vec3 q, float reach, sampler2D tape_) {
    return interpret_bound(q, reach, tape_, tape_);
}

vec4 field_gradient(vec3 q, sampler2D tape_) {
    return interpret_gradient(q, 0.0, tape_, tape_);
}

void main() {
    vec3 direction = normalize(ray_direction(gl_FragCoord.xy));
    float distance_ = trace_ray(eye.xyz, direction, box_lower, box_upper, tolerance, tape);
    if (distance_ < 0.0) {
        discard;
    }
    vec3 position = eye.xyz + direction * distance_;
    vec3 normal = -field_gradient(position, tape).yzw;
    write_surface(position, normal, interpret_color(position, 0.0, tape, tape_colors).yzw);
    gl_FragDepth = window_depth(position);
}
