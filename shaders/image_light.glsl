// The environment of a picture, and lights of the scene in front of it, on surface of glTF's model in linear light.
//@ include ambient.glsl
//@ include light_rows.glsl
uniform mat3 environment_frame;  // the scene's directions to those of the picture: right, up, back
const float PLAIN_ROUGHNESS = 0.5;  // of surface without maps

vec3 material_color(ivec2 texel, vec3 position, vec3 normal, Material m) {
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 toward_eye = -normalize(ray);
    float open_ = openness(g_position, texel, position, visible_normal(normal, toward_eye), ray);
    m.normal = visible_normal(m.normal, toward_eye);
    vec3 ambient = environment_ambient(environment_frame * m.normal);
    vec3 light = environment_light(m, toward_eye, ambient, open_, environment_frame);
    return tone_mapped(m.emission + light + lights_on(m, position, toward_eye));
}

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo) {
    return material_color(texel, position, normal, Material(albedo, normal, PLAIN_ROUGHNESS, 0.0, 1.0, vec3(0.0)));
}

#ifdef ENVIRONMENT_SHOWN
uniform sampler2D environment_picture;

// Linear light of the environment at a pixel.
vec3 environment_behind(ivec2 texel) {
    vec3 direction = environment_frame * normalize(ray_direction(vec2(texel) + 0.5));
    vec3 light = textureLod(environment_picture, panorama_place(direction), 0.0).rgb;
    return tone_mapped(environment_strength * light);
}
#endif
