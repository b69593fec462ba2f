// Light on surface with material maps: glTF's metallic-roughness model (glTF 2.0, appendix B) in linear light.
// Lights are given by what a white diffuse surface that faces them reflects; radiance is that, times pi.
struct Material {
    vec3 albedo;
    vec3 normal;      // unit, toward the eye
    float roughness;
    float metallic;
    float occlusion;
    vec3 emission;
};

//@ include camera.glsl
const float DIELECTRIC = 0.04;     // reflectance of surface that is no metal, head on
const float MIN_ROUGHNESS = 0.045;
const float MIN_FACING = 1e-3;     // least cosine between the normal and the direction to the eye

vec3 reflectance(Material m) {
    return mix(vec3(DIELECTRIC), m.albedo, m.metallic);
}

float facing(Material m, vec3 toward_eye) {
    return max(dot(m.normal, toward_eye), MIN_FACING);
}

// Light reflected from one direction: Lambert, and GGX with Smith's height-correlated shadowing.
vec3 direct_light(Material m, vec3 toward_eye, vec3 toward_light, vec3 light) {
    float lit = dot(m.normal, toward_light);
    if (lit <= 0.0) {
        return vec3(0.0);
    }
    float alpha = m.roughness * m.roughness;
    float squared = alpha * alpha;
    vec3 halfway = normalize(toward_eye + toward_light);
    vec3 across = cross(m.normal, halfway);
    float along = dot(m.normal, halfway);
    float spread = squared * along * along + dot(across, across);  // without the cancellation in 1 - cos^2
    float seen = facing(m, toward_eye);
    float visible = 0.5 / (lit * sqrt(seen * seen * (1.0 - squared) + squared)
        + seen * sqrt(lit * lit * (1.0 - squared) + squared));
    vec3 base = reflectance(m);
    vec3 mirrored = base + (1.0 - base) * pow(1.0 - clamp(dot(toward_eye, halfway), 0.0, 1.0), 5.0);
    vec3 diffuse = (1.0 - mirrored) * (1.0 - m.metallic) * m.albedo;
    return lit * light * (diffuse + mirrored * squared / (spread * spread) * visible);
}

// What the environment reflects: the slot defines, of a Material with diffuse light `ambient` in a part `open_` of the
// directions, `vec3 environment_light(Material m, vec3 toward_eye, vec3 ambient, float open_, mat3 frame)`. The frame
// turns directions into those of the environment.
//@ slot environment

// Khronos PBR Neutral tone mapper: colours up to 0.76 stay but for a small offset, brighter ones fade to white.
vec3 tone_mapped(vec3 color) {
    const float START = 0.8 - DIELECTRIC;
    float least = min(color.r, min(color.g, color.b));
    color -= least < 0.08 ? least - 6.25 * least * least : DIELECTRIC;
    float peak = max(color.r, max(color.g, color.b));
    if (peak < START) {
        return color;
    }
    float room = 1.0 - START;
    float shown = 1.0 - room * room / (peak + room - START);
    return mix(vec3(shown), color * (shown / peak), 1.0 / (0.15 * (peak - shown) + 1.0));
}
