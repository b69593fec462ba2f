// A surface under the lights of a scene: what VTK's shader of polygons makes of a diffuse material. As in VTK, sums
// are of display values, not of linear light.
//@ include light_rows.glsl

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
    return tone_mapped(light + lights_on(m, position, eye_direction));
}
#endif
