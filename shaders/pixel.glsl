// Result of a pass at a pixel.
struct Pixel {
    vec4 color;
#ifdef TWO_TARGETS
    vec4 buffers;
#endif
#ifdef MATERIALS
    vec4 material;  // xyz: normal, as long as the part with materials is large; w: roughness
    vec4 glow;      // rgb: emission, linear; w: occlusion
#endif
};
