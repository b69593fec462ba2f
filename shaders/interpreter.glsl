// The tape's interpreter, blobtree/tapes/interpreter.py in GLSL: one composition per reading. Defines:
// INTERPRET, FIELD (its type), LEAF, UNSTRETCH, UNWARP, COMBINE, PRIMITIVE_COLOR (what LEAF gets for it).
// Slots: the registers, and a case per instruction that occurs (decals/render/tape_shader.py).
FIELD INTERPRET(vec3 q, vec3 heading, float reach, sampler2D tape, ivec2 span) {
    FIELD accumulator = FIELD(0.0);
    //@ slot registers optional
    vec3 place = q;
    vec3 aim = heading;
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
#undef UNSTRETCH
#undef UNWARP
#undef COMBINE
#undef PRIMITIVE_COLOR
