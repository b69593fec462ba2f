// The light pass, body of pixels.frag and pixels.comp: painted surface under light. The slot holds studio_light.glsl,
// lights.glsl or image_light.glsl; all define `vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo)`, and,
// of a Material in place of the albedo, `material_color`. PHYSICAL: the slot material is material.glsl. MATERIAL_LIGHT:
// some decals have materials. RELIEF: some have relief. ENVIRONMENT_SHOWN: the environment is seen behind the objects.
//@ include camera.glsl
//@ include pixel.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_paint;  // rgb: linear albedo, decals included
#ifdef MATERIAL_LIGHT
uniform sampler2D g_material;  // as `material` and `glow` of the decal pass
uniform sampler2D g_glow;
#endif
#ifdef RELIEF
float relief_lit = 1.0;  // part of the first light, or of the studio's key, that reaches the relief
#endif

//@ slot material optional

//@ slot lighting

// color: linear light, premultiplied
Pixel pixel_at(ivec2 texel) {
    vec4 position = texelFetch(g_position, texel, 0);
    if (position.w <= 0.0) {
#ifdef ENVIRONMENT_SHOWN
        return Pixel(vec4(environment_behind(texel), 1.0));
#endif
        return Pixel(vec4(0.0));
    }
    vec4 normal = texelFetch(g_normal, texel, 0);
    vec3 albedo = texelFetch(g_paint, texel, 0).rgb;
    vec3 light = lit_color(texel, position.xyz, normal.w * normal.xyz, albedo);
#ifdef MATERIAL_LIGHT
    vec4 maps = texelFetch(g_material, texel, 0);
    float part = min(length(maps.xyz), 1.0);
#ifdef RELIEF
    relief_lit = floor(0.5 * maps.w) / RELIEF_LEVELS;
    maps.w -= 2.0 * floor(0.5 * maps.w);
#endif
    if (part > 0.0) {
        vec4 glow = texelFetch(g_glow, texel, 0);
        float metallic = texelFetch(g_paint, texel, 0).w;
        vec3 bent = normal.w * normalize(maps.xyz);
        Material material = Material(albedo, bent, max(maps.w, MIN_ROUGHNESS), metallic, glow.w, glow.rgb / part);
        light = mix(light, material_color(texel, position.xyz, normal.w * normal.xyz, material), part);
    }
#endif
    return Pixel(vec4(light, 1.0));
}
