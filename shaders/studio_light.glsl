// Soft studio light that stays with the camera: a key from its upper left, a weak fill from the right, and a
// sky over a darker ground. All in linear light.
//@ include camera.glsl
//@ include ambient.glsl
const vec3 KEY_COLOR = vec3(1.00, 0.97, 0.92);
const vec3 FILL_COLOR = vec3(0.13, 0.14, 0.17);
const vec3 SKY_COLOR = vec3(0.33, 0.35, 0.39);
const vec3 GROUND_COLOR = vec3(0.13, 0.11, 0.10);
const float KEY_STRENGTH = 0.86;
const float WRAP = 0.12;       // how far the key reaches beyond its own terminator
const float KEY_SOFTNESS = 0.6;  // how far the key's light, too, is kept out of corners
const float GLOSS = 60.0;      // Blinn-Phong exponent
const float SHEEN = 0.22;      // strength of the highlight

// A smooth normal may point away from the eye at a silhouette: turn it until it is just visible.
vec3 visible_normal(vec3 normal, vec3 toward_eye) {
    return normalize(normal - min(dot(normal, toward_eye) - 1e-3, 0.0) * toward_eye);
}

// `n` points toward the eye; `open_` is the part of the sky that the surroundings leave open, from 0 to 1.
vec3 shade(vec3 albedo, vec3 n, vec3 toward_eye, float open_) {
    vec3 right = normalize(ray_right.xyz);
    vec3 up = normalize(ray_up.xyz);
    vec3 back = cross(right, up);
    vec3 key = normalize(-0.55 * right + 0.75 * up + 0.70 * back);
    vec3 fill = normalize(0.85 * right + 0.10 * up + 0.45 * back);

    float lit = max((dot(n, key) + WRAP) / (1.0 + WRAP), 0.0);
    float key_open = mix(1.0, open_, KEY_SOFTNESS);
    vec3 ambient = open_ * mix(GROUND_COLOR, SKY_COLOR, 0.5 + 0.5 * dot(n, up));
    vec3 fill_light = open_ * max(dot(n, fill), 0.0) * FILL_COLOR;
    vec3 diffuse = albedo * (KEY_STRENGTH * key_open * lit * KEY_COLOR + fill_light + ambient);

    vec3 halfway = normalize(key + toward_eye);
    float grazing = pow(1.0 - max(dot(n, toward_eye), 0.0), 5.0);
    float gloss = pow(max(dot(n, halfway), 0.0), GLOSS) * step(0.0, dot(n, key));
    vec3 mirror = key_open * SHEEN * gloss * KEY_COLOR + 0.25 * grazing * ambient;
    return diffuse + mirror;
}

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo) {
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 toward_eye = -normalize(ray);
    vec3 visible = visible_normal(normal, toward_eye);
    float open_ = openness(g_position, texel, position, visible, ray);
    return clamp(shade(albedo, visible, toward_eye, open_), 0.0, 1.0);
}
