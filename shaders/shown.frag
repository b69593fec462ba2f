// Pixels of a picture that stays on the card: sRGB with premultiplied alpha, and the depth of the nearest sample.
//@ include color.glsl
uniform sampler2D light;  // linear, premultiplied alpha
uniform sampler2D depth;
uniform int samples;      // texels a pixel along each axis

layout(location = 0) out vec4 color;
layout(location = 1) out float nearest;

void main() {
    ivec2 first = ivec2(gl_FragCoord.xy) * samples;
    vec4 sum = vec4(0.0);
    nearest = 1.0;
    for (int j = 0; j < samples; j++) {
        for (int i = 0; i < samples; i++) {
            sum += texelFetch(light, first + ivec2(i, j), 0);
            nearest = min(nearest, texelFetch(depth, first + ivec2(i, j), 0).r);
        }
    }
    color = sum.a > 0.0 ? vec4(to_srgb(sum.rgb / sum.a), 1.0) * sum.a / float(samples * samples) : vec4(0.0);
}
