// A pass over all pixels as a fragment shader, for GLSL 3.30 on. The slot gives `Pixel pixel_at(ivec2 texel)`.
// TWO_TARGETS: the pixel has a second part, `buffers`. MATERIALS: two more, `material` and `glow`.
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

void main() {
    Pixel pixel = pixel_at(ivec2(gl_FragCoord.xy));
    out_color = pixel.color;
#ifdef TWO_TARGETS
    out_buffers = pixel.buffers;
#endif
#ifdef MATERIALS
    out_material = pixel.material;
    out_glow = pixel.glow;
#endif
}
