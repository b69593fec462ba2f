// The software rasteriser ends all loops of a pixel after a number of turns, without an error: then a loop of two
// turns has one. Such a pixel is left out and reported, and drawn again by a RESUMING shader from where it was,
// until it is complete (decals/rendering/loop_guard.py). Images take time on each pixel, so other shaders have few.
#ifdef GUARDED
layout(binding = 3, r32ui) writeonly uniform uimage2D ended_loops;
uniform int guard_turns;  // 2; a number here would be unrolled

bool loops_ended() {
    int turns = 0;
    while (turns < guard_turns) {
        turns += 1;
    }
    bool ended = turns != guard_turns;
    if (ended) {
        imageStore(ended_loops, ivec2(0), uvec4(1u));
    }
    return ended;
}
#endif

#ifdef RESUMING
layout(binding = 4, r32f) uniform image2D resumed_ways;  // of each pixel: where its ray goes on; -1: complete
uniform bool resumed;                                    // false: all rays begin at their start
ivec2 traced_pixel;

// The way along its ray at which a pixel begins; -1 if the pixel is complete.
float resumed_way(ivec2 pixel) {
    traced_pixel = pixel;
    if (!resumed) {
        imageStore(resumed_ways, pixel, vec4(0.0));
    }
    return resumed ? imageLoad(resumed_ways, pixel).x : 0.0;
}

// Return t, and keep the way. Variables are of no use for that: behind an ended loop they may have other values.
float passed_way(float way, float t) {
    imageStore(resumed_ways, traced_pixel, vec4(way));
    return t;
}

// Return whether a pixel is complete.
bool complete(ivec2 pixel) {
    bool ended = loops_ended();
    if (!ended) {
        imageStore(resumed_ways, pixel, vec4(-1.0));
    }
    return !ended;
}
#else
float resumed_way(ivec2 pixel) {
    return 0.0;
}

float passed_way(float way, float t) {
    return t;
}

bool complete(ivec2 pixel) {
#ifdef GUARDED
    return !loops_ended();
#else
    return true;
#endif
}
#endif
