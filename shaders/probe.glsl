// A short pass whose work is like that of the decal pass, for the measurement of both backends: dependent fetches
// around the pixel, with a little arithmetic at each.
//@ include pixel.glsl
uniform sampler2D noise;

const int STEPS = 48;
const int MASK = 63;  // the noise is a square of 64 texels

Pixel pixel_at(ivec2 texel) {
    ivec2 at = texel >> 2;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < STEPS; i++) {
        vec4 value = texelFetch(noise, at & MASK, 0);
        if (dot(value, value) > 0.25) {
            sum += exp(-value) * inversesqrt(1.0 + sum * sum);
        }
        at += ivec2(value.xy * 7.0);
    }
    return Pixel(sum / float(STEPS));
}
