// A pass over all pixels as a fragment shader, for GLSL 3.30 on. The slot gives `Pixel pixel_at(ivec2 texel)`.
// TWO_TARGETS: the pixel has a second part, `buffers`.
//@ slot body

layout(location = 0) out vec4 out_color;
#ifdef TWO_TARGETS
layout(location = 1) out vec4 out_buffers;
#endif

void main() {
    Pixel pixel = pixel_at(ivec2(gl_FragCoord.xy));
    out_color = pixel.color;
#ifdef TWO_TARGETS
    out_buffers = pixel.buffers;
#endif
}
