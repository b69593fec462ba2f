// Entries of trees with operators that read gradients (blobtree/tape/directed.py): their interpreters carry more.
vec3 interpret_bound(vec3 q, vec3 direction, float reach, sampler2D tape, ivec2 span) {
    return interpret_directed_bound(q, direction, reach, tape, span)[0].xyz;
}

vec4 interpret_color(vec3 q, vec3 direction, float reach, sampler2D tape, ivec2 span) {
    return interpret_directed_color(q, direction, reach, tape, span)[0];
}

// The gradient is the change of the value along the axes.
vec4 interpret_gradient(vec3 q, vec3 direction, float reach, sampler2D tape, ivec2 span) {
    mat2x4 f = interpret_along(q, vec3(1.0, 0.0, 0.0), reach, tape, span);
    float by_y = interpret_along(q, vec3(0.0, 1.0, 0.0), reach, tape, span)[1].x;
    float by_z = interpret_along(q, vec3(0.0, 0.0, 1.0), reach, tape, span)[1].x;
    return vec4(f[0].x, f[1].x, by_y, by_z);
}
