// A surface under the lights of a scene: what VTK's shader of polygons makes of a diffuse material. As in VTK, sums
// are of display values, not of linear light.
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

vec3 light_at(int i, vec3 position, vec3 n) {
    vec3 direction;
    float strength = light_strength(i, position, direction);
    return max(strength * dot(n, -direction), 0.0) * lights[4 * i + 2].rgb;
}

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo) {
    vec3 light = vec3(light_count == 0 ? 1.0 : 0.0);
    vec3 point = (light_frame * vec4(position, 1.0)).xyz;
    vec3 n = normalize(transpose(inverse(mat3(light_frame))) * normal);
    for (int i = 0; i < light_count; i++) {
        light += light_at(i, point, n);
    }
    return to_linear(to_srgb(albedo) * light);
}

#ifdef MATERIAL_LIGHT
// The same lights on a material, in linear light, with what it mirrors of the studio's environment.
vec3 material_color(ivec2 texel, vec3 position, vec3 normal, Material m) {
    if (light_count == 0) {
        return m.albedo + m.emission;
    }
    vec3 eye_direction = -normalize(ray_direction(vec2(texel) + 0.5));
    vec3 right = normalize(ray_right.xyz);
    vec3 up = normalize(ray_up.xyz);
    m.normal = visible_normal(m.normal, eye_direction);
    mat3 to_camera = transpose(mat3(right, up, cross(right, up)));
    vec3 light = m.emission + environment_light(m, eye_direction, vec3(0.0), 1.0, to_camera);
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
    return tone_mapped(light);
}
#endif
