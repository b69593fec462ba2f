// Our picture in VTK's frame: colour, blended by the covered part of the pixel, and depth.
// SAMPLES: texels a pixel along each axis; 0: fewer than one, magnified. As a constant it halves the loops' cost.
//@ include color.glsl
uniform sampler2D light;  // linear, premultiplied alpha; filtered bilinearly, to its edges
uniform sampler2D depth;
uniform vec2 corner;      // of the picture in the frame, in pixels
uniform vec2 size;        // in pixels

out vec4 color;

void main() {
    vec2 pixel = gl_FragCoord.xy - corner;
#if SAMPLES > 0
    const int COUNT = SAMPLES;
    ivec2 first = ivec2(pixel) * SAMPLES;
    vec4 sum = vec4(0.0);
#else
    const int COUNT = 2;
    ivec2 first = ivec2(floor(pixel / size * vec2(textureSize(depth, 0)) - 0.5));
    vec4 sum = textureLod(light, pixel / size, 0.0);
#endif
    ivec2 last = textureSize(depth, 0) - 1;
    float nearest = 1.0;
    for (int j = 0; j < COUNT; j++) {
        for (int i = 0; i < COUNT; i++) {
            ivec2 at = clamp(first + ivec2(i, j), ivec2(0), last);
            nearest = min(nearest, texelFetch(depth, at, 0).r);
#if SAMPLES > 0
            sum += 1.0 / float(SAMPLES * SAMPLES) * texelFetch(light, at, 0);
#endif
        }
    }
    if (sum.a <= 0.0) {
        discard;
    }
    color = vec4(to_srgb(sum.rgb / sum.a), sum.a);
    gl_FragDepth = nearest;
}
