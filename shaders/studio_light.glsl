// Studio light on the G-buffer: it reaches each pixel by the part of the sky that the surroundings leave open.
//@ include ambient.glsl
//@ include studio_shade.glsl

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo) {
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 toward_eye = -normalize(ray);
    vec3 visible = visible_normal(normal, toward_eye);
    float open_ = openness(g_position, texel, position, visible, ray);
    return clamp(shade(albedo, visible, toward_eye, open_), 0.0, 1.0);
}

#ifdef MATERIAL_LIGHT
// The same light on a material: `normal` is that of the surface, toward the eye or not.
vec3 material_color(ivec2 texel, vec3 position, vec3 normal, Material m) {
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 toward_eye = -normalize(ray);
    return shade_material(m, toward_eye, openness(g_position, texel, position, visible_normal(normal, toward_eye), ray));
}
#endif
