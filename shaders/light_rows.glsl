// Lights of a scene, and, with PHYSICAL, what a Material reflects of them in linear light.
//@ include color.glsl
const int MAX_LIGHTS = 32;
// Four rows a light: position, 1 (0: at infinity); direction, cosine of its cone (-2: none); colour, the cone's
// exponent; attenuation.
uniform vec4 lights[4 * MAX_LIGHTS];
uniform int light_count;
uniform mat4 light_frame;  // the scene's coordinates to those of the lights

// Strength of a light at a position, and the direction in which it travels there.
float light_strength(int i, vec3 position, out vec3 direction) {
    vec4 origin = lights[4 * i], axis = lights[4 * i + 1], color = lights[4 * i + 2];
    direction = axis.xyz;
    float strength = 1.0;
    if (origin.w > 0.0) {
        direction = position - origin.xyz;
        float distance_ = length(direction);
        direction /= distance_;
        strength /= dot(lights[4 * i + 3].xyz, vec3(1.0, distance_, distance_ * distance_));
        float along = dot(direction, axis.xyz);
        if (axis.w > -1.5) {
            strength *= along >= axis.w ? pow(along, color.w) : 0.0;
        }
    }
    return strength;
}

#ifdef PHYSICAL
// Position and directions are the scene's.
vec3 lights_on(Material m, vec3 position, vec3 eye_direction) {
    vec3 light = vec3(0.0);
    mat3 frame = mat3(light_frame);
    vec3 point = (light_frame * vec4(position, 1.0)).xyz;
    vec3 toward_eye = normalize(frame * eye_direction);
    m.normal = normalize(transpose(inverse(frame)) * m.normal);
    for (int i = 0; i < light_count; i++) {
        vec3 direction;
        float strength = light_strength(i, point, direction);
#ifdef RELIEF
        strength *= i == 0 ? relief_lit : 1.0;
#endif
        light += direct_light(m, toward_eye, -direction, to_linear(strength * lights[4 * i + 2].rgb));
    }
    return light;
}
#endif
