// Result of a pass at a pixel.
#ifdef RELIEF
const float RELIEF_LEVELS = 64.0;
#endif

struct Pixel {
    vec4 color;
#ifdef TWO_TARGETS
    vec4 buffers;
#endif
#ifdef MATERIALS
    // xyz: normal, as long as the part with materials is large; w: roughness, and with relief two for each of
    // RELIEF_LEVELS of the light that reaches it
    vec4 material;
    vec4 glow;      // rgb: emission, linear; w: occlusion
#endif
};
