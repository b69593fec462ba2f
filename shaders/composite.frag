// Our picture in somebody else's frame: colour, blended by how much of the pixel is covered, and depth.
//@ include color.glsl
uniform sampler2D light;  // linear, premultiplied alpha
uniform sampler2D depth;
uniform int samples;      // texels a pixel along each axis; 0: fewer than one, magnified
uniform vec2 corner;      // of the picture in the frame, in pixels
uniform vec2 size;        // in pixels

out vec4 color;

void main() {
    vec2 pixel = gl_FragCoord.xy - corner;
    vec2 texel = pixel / size * vec2(textureSize(light, 0));
    ivec2 first = samples > 0 ? ivec2(pixel) * samples : ivec2(floor(texel - 0.5));
    int count = samples > 0 ? samples : 2;
    ivec2 last = textureSize(light, 0) - 1;
    vec4 sum = vec4(0.0);
    float nearest = 1.0;
    for (int j = 0; j < count; j++) {
        for (int i = 0; i < count; i++) {
            ivec2 at = clamp(first + ivec2(i, j), ivec2(0), last);
            vec2 part = 1.0 - abs(texel - 0.5 - vec2(first + ivec2(i, j)));  // bilinear
            float weight = samples > 0 ? 1.0 / float(samples * samples) : part.x * part.y;
            sum += weight * texelFetch(light, at, 0);
            nearest = min(nearest, texelFetch(depth, at, 0).r);
        }
    }
    if (sum.a <= 0.0) {
        discard;
    }
    color = vec4(to_srgb(sum.rgb / sum.a), sum.a);
    gl_FragDepth = nearest;
}
