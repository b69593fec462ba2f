// The software rasteriser ends all loops of a pixel after a number of turns, without an error: then a loop of two
// turns has one (decals/rendering/loop_guard.py). To be included once, and called behind all other loops.
#ifdef GUARDED
layout(binding = 3, r32ui) writeonly uniform uimage2D ended_loops;
uniform int guard_turns;  // 2; a number here would be unrolled

bool loops_ended() {
    int turns = 0;
    while (turns < guard_turns) {
        turns += 1;
    }
    if (turns == guard_turns) {
        return false;
    }
    imageStore(ended_loops, ivec2(0), uvec4(1u));
    return true;
}
#else
bool loops_ended() {
    return false;
}
#endif
