// Result of a pass at a pixel.
struct Pixel {
    vec4 color;
#ifdef TWO_TARGETS
    vec4 buffers;
#endif
};
