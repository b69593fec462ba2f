// A pass over all pixels as a fragment shader, for GLSL 3.30 on. The slot gives `Pixel pixel_at(ivec2 texel)`.
// TWO_TARGETS: the pixel has a second part, `buffers`. MATERIALS: two more, `material` and `glow`.
// FILTERED: the slot gives `Pixel pixel_at(ivec2 texel, bool exact)`. MARKED: tell which pixels are divided instead of
// drawing them exactly; a pass with LISTED then draws a list of them, pixel after pixel.
//@ slot body

layout(location = 0) out vec4 out_color;
#ifdef TWO_TARGETS
layout(location = 1) out vec4 out_buffers;
#endif
#ifdef MATERIALS
#ifdef TWO_TARGETS
layout(location = 2) out vec4 out_material;
layout(location = 3) out vec4 out_glow;
#else
layout(location = 1) out vec4 out_material;
layout(location = 2) out vec4 out_glow;
#endif
#endif

#ifdef MARKED
layout(location = MARKED) out float out_divided;
#endif
#ifdef LISTED
uniform isampler2D listed_texels;
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
#if defined(LISTED)
    texel = texelFetch(listed_texels, texel, 0).xy;
    Pixel pixel = pixel_at(texel, true);
#elif defined(FILTERED)
    Pixel pixel = pixel_at(texel, false);
#ifdef MARKED
    out_divided = pixel_divided ? 1.0 : 0.0;
#else
    if (pixel_divided) {
        pixel = pixel_at(texel, true);
    }
#endif
#else
    Pixel pixel = pixel_at(texel);
#endif
    out_color = pixel.color;
#ifdef TWO_TARGETS
    out_buffers = pixel.buffers;
#endif
#ifdef MATERIALS
    out_material = pixel.material;
    out_glow = pixel.glow;
#endif
}
