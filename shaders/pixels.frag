// A pass over all pixels as a fragment shader, for GLSL 3.30 on. The slot gives `Pixel pixel_at(ivec2 texel)`.
// TWO_TARGETS: the pixel has a second part, `buffers`. MATERIALS: two more, `material` and `glow`.
// MARKED: tell of which pixels the body sets `pixel_divided`. LISTED: draw a list of pixels, one beside the other.
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
#ifdef LISTED
    texel = texelFetch(listed_texels, texel, 0).xy;
#endif
    Pixel pixel = pixel_at(texel);
#ifdef MARKED
    out_divided = pixel_divided ? 1.0 : 0.0;
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
