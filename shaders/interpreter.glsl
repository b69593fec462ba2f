// The tape's interpreter, blobtree/tape/interpreter.py in GLSL: one composition per evaluator. Defines:
// INTERPRET, FIELD (its type), LEAF, PROFILED_LEAF, DIRECT, PULLBACK_AFFINE, PULLBACK_WARP, COMBINE,
// PRIMITIVE_COLOR (LEAF's colour).
// Slots: the registers, and a case per instruction that occurs (decals/rendering/tree.py).
FIELD INTERPRET(vec3 q, vec3 direction, float reach, sampler2D tape, ivec2 span) {
    FIELD accumulator = FIELD(0.0);
    //@ slot registers optional
    vec3 point = q;
    vec3 local_direction = direction;
    float speed = 1.0;
    int at = span.x;
    while (at < span.y) {
        vec4 header = tape_texel(tape, at);
        int operator_ = int(header.y);
        int count = int(header.z);
        at += 1;
        switch (int(header.x)) {
        //@ slot runs
        //@ slot stack optional
        //@ slot warps optional
        }
    }
    return accumulator;
}
#undef INTERPRET
#undef FIELD
#undef LEAF
#undef DIRECT
#undef PROFILED_LEAF
#undef PULLBACK_AFFINE
#undef PULLBACK_WARP
#undef COMBINE
#undef PRIMITIVE_COLOR
