// What a pass finds at a pixel.
struct Pixel {
    vec4 color;
#ifdef TWO_TARGETS
    vec4 buffers;
#endif
};
