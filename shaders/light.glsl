// Soft studio light that stays with the camera: a key from its upper left, a weak fill from the right, and a
// sky over a darker ground. All in linear light.
//@ include camera.glsl
const vec3 KEY_COLOR = vec3(1.00, 0.97, 0.92);
const vec3 FILL_COLOR = vec3(0.13, 0.14, 0.17);
const vec3 SKY_COLOR = vec3(0.40, 0.42, 0.45);
const vec3 GROUND_COLOR = vec3(0.16, 0.14, 0.13);
const float KEY_STRENGTH = 0.72;
const float WRAP = 0.20;       // how far the key reaches beyond its own terminator
const float GLOSS = 40.0;      // Blinn-Phong exponent
const float SHEEN = 0.055;     // reflectance face on; Schlick raises it toward grazing

vec3 shade(vec3 albedo, vec3 normal, vec3 toward_eye) {
    vec3 right = normalize(ray_right.xyz);
    vec3 up = normalize(ray_up.xyz);
    vec3 back = cross(right, up);
    vec3 key = normalize(-0.55 * right + 0.75 * up + 0.70 * back);
    vec3 fill = normalize(0.85 * right + 0.10 * up + 0.45 * back);
    vec3 n = dot(normal, toward_eye) < 0.0 ? -normal : normal;

    float lit = max((dot(n, key) + WRAP) / (1.0 + WRAP), 0.0);
    vec3 ambient = mix(GROUND_COLOR, SKY_COLOR, 0.5 + 0.5 * dot(n, up));
    vec3 diffuse = albedo * (KEY_STRENGTH * lit * KEY_COLOR + max(dot(n, fill), 0.0) * FILL_COLOR + ambient);

    vec3 halfway = normalize(key + toward_eye);
    float grazing = pow(1.0 - max(dot(n, toward_eye), 0.0), 5.0);
    float gloss = pow(max(dot(n, halfway), 0.0), GLOSS) * step(0.0, dot(n, key));
    vec3 mirror = SHEEN * gloss * 6.0 * KEY_COLOR + 0.25 * grazing * ambient;
    return diffuse + mirror;
}
