// Screen-space obscurance from the G-buffer around a pixel, after McGuire, Osman, Bukowski and Hennessy (HPG 2011):
// taps on a spiral that is turned differently at each sample.
//@ include camera.glsl
uniform ivec2 tile_corner;      // of this tile in the picture, in samples
uniform ivec2 tile_size;
uniform float ambient_radius;   // in the world: farther surface hides nothing
uniform int ambient_limit;      // in samples: farthest tap in the G-buffer

const int TAPS = 13;
const float TURNS = 5.0;        // of the spiral of taps; prime to TAPS
const float STRENGTH = 1.7;
const float BIAS = 0.08;        // sine of the angle above the horizon from which surroundings count

// Interleaved gradient noise: neighbours differ much, so the box filter evens them out.
float noise(vec2 pixel) {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

float openness(sampler2D g_position_, ivec2 texel, vec3 q, vec3 n, vec3 ray) {
    float reach = min(ambient_radius / (ray_spread(q, ray) * length(ray_right.xyz)), float(ambient_limit));
    float turn = 6.2831853 * noise(vec2(texel + tile_corner));
    float hidden = 0.0;
    for (int i = 0; i < TAPS; i++) {
        float along = (float(i) + 0.5) / float(TAPS);
        float angle = turn + along * TURNS * 6.2831853;
        ivec2 tap = texel + ivec2(round(along * reach * vec2(cos(angle), sin(angle))));
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, tile_size))) {
            continue;
        }
        vec4 other = texelFetch(g_position_, tap, 0);
        vec3 v = other.xyz - q;
        float far = length(v) / ambient_radius;
        float above = dot(v, n) / max(length(v), 1e-30) - BIAS;
        if (other.w > 0.0 && far < 1.0) {
            hidden += max(above, 0.0) * (1.0 - far * far);
        }
    }
    return max(1.0 - STRENGTH * hidden / float(TAPS), 0.0);
}
