// From a tile at `samples` times the size to the picture: box filter in linear light, background, sRGB.
//@ include color.glsl
uniform sampler2D light;    // linear, premultiplied alpha, samples × samples texels a pixel
uniform int samples;
uniform ivec2 first;        // sample of the tile with which the pixels begin
uniform float first_row;    // of this tile in the picture, from below
uniform float rows;         // of the whole picture
uniform vec4 background_top;     // sRGB and alpha, not premultiplied
uniform vec4 background_bottom;

out vec4 pixel;

void main() {
    ivec2 corner = first + ivec2(gl_FragCoord.xy) * samples;
    vec4 sum = vec4(0.0);
    for (int j = 0; j < samples; j++) {
        for (int i = 0; i < samples; i++) {
            sum += texelFetch(light, corner + ivec2(i, j), 0);
        }
    }
    sum /= float(samples * samples);
    vec4 behind = mix(background_bottom, background_top, (first_row + gl_FragCoord.y) / rows);
    vec4 seen = sum + (1.0 - sum.a) * behind.a * vec4(to_linear(behind.rgb), 1.0);
    pixel = seen.a > 0.0 ? vec4(to_srgb(seen.rgb / seen.a), seen.a) : vec4(0.0);
}
