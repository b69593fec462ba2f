// Soft studio light that stays with the camera: a key from its upper left, a weak fill from the right, and a
// sky over a darker ground, SKY_COLOR and GROUND_COLOR of decals/rendering/studio.py. All in linear light.
//@ include camera.glsl
//@ include key_light.glsl
const vec3 FILL_DIRECTION = vec3(0.85, 0.10, 0.45);
const vec3 KEY_COLOR = vec3(1.00, 0.97, 0.92);
const vec3 FILL_COLOR = vec3(0.13, 0.14, 0.17);
const float KEY_STRENGTH = 0.86;
const float WRAP = 0.12;       // how far the key reaches beyond its own terminator
const float KEY_SOFTNESS = 0.6;  // how far the key's light, too, is kept out of corners
const float GLOSS = 60.0;      // Blinn-Phong exponent
const float SHEEN = 0.22;      // strength of the highlight

// `n` points toward the eye; `open_` is the part of the sky that the surroundings leave open, from 0 to 1.
vec3 shade(vec3 albedo, vec3 n, vec3 toward_eye, float open_) {
    mat3 frame = camera_frame();
    vec3 up = frame[1];
    vec3 key = normalize(frame * KEY_DIRECTION);
    vec3 fill = normalize(frame * FILL_DIRECTION);

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

#ifdef MATERIAL_LIGHT
// The same light on a material, whose normal may point away from the eye.
vec3 shade_material(Material m, vec3 toward_eye, float open_) {
    m.normal = visible_normal(m.normal, toward_eye);
    mat3 frame = camera_frame();
    vec3 key = normalize(frame * KEY_DIRECTION);
    vec3 fill = normalize(frame * FILL_DIRECTION);
    vec3 ambient = mix(GROUND_COLOR, SKY_COLOR, 0.5 + 0.5 * dot(m.normal, frame[1]));
    vec3 light = mix(1.0, open_, KEY_SOFTNESS) * direct_light(m, toward_eye, key, KEY_STRENGTH * KEY_COLOR);
#ifdef RELIEF
    light *= relief_lit;
#endif
    light += open_ * direct_light(m, toward_eye, fill, FILL_COLOR);
    light += environment_light(m, toward_eye, ambient, open_, transpose(frame));
    return tone_mapped(light + m.emission);
}
#endif
