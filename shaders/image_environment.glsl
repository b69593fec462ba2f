// The environment of a picture, prefiltered for lobes of GGX, see decals/rendering/prefiltering.py. Before it stand its
// constants. Directions are those of the picture: right, up, back.
uniform sampler2D environment_levels;  // grids of directions one below the other, from mirrors on; then a table
uniform float environment_strength;

// Place in a panorama: from its left to its right edge, and from above to below, both from 0 to 1.
vec2 panorama_place(vec3 d) {
    float across = abs(d.x) + abs(d.z);
    return vec2(0.5 + 0.15915494 * atan(d.x, across > 0.0 ? -d.z : 1.0), 0.31830989 * atan(length(d.xz), d.y));
}

vec4 level_texel(vec2 texel) {
    return textureLod(environment_levels, (texel + 0.5) / vec2(textureSize(environment_levels, 0)), 0.0);
}

vec3 level_light(vec2 place, int level) {
    ivec2 grid = ENVIRONMENT_GRIDS[level];
    return level_texel(vec2(0.0, grid.x) + float(grid.y) * vec2(2.0, 1.0) * place).rgb;
}

// Mean light that white diffuse surface receives; its lobe is that of the roughest level.
vec3 environment_ambient(vec3 direction) {
    return environment_strength * level_light(panorama_place(direction), ENVIRONMENT_LEVELS - 1);
}

// Rough lobes turn from the mirrored direction toward the normal (Lagarde and de Rousiers 2014).
vec3 lobe_light(Material m, vec3 toward_eye, mat3 frame) {
    float alpha = m.roughness * m.roughness;
    vec3 bounced = 2.0 * dot(m.normal, toward_eye) * m.normal - toward_eye;
    vec3 direction = frame * mix(m.normal, bounced, (1.0 - alpha) * (sqrt(1.0 - alpha) + alpha));
    vec2 place = panorama_place(direction);
    float level = log2(1.0 + alpha * (exp2(float(ENVIRONMENT_LEVELS - 1)) - 1.0));
    int sharper = min(int(level), ENVIRONMENT_LEVELS - 2);
    vec3 light = mix(level_light(place, sharper), level_light(place, sharper + 1), level - float(sharper));
    return environment_strength * light;
}

// The split sum (Karis 2013). Diffuse light is what the interface lets through on the way in, as under lights.
vec3 environment_light(Material m, vec3 toward_eye, vec3 ambient, float open_, mat3 frame) {
    vec2 entry = vec2(ENVIRONMENT_TABLE.yz - 1) * vec2(facing(m, toward_eye), m.roughness);
    vec3 part = level_texel(vec2(0.0, ENVIRONMENT_TABLE.x) + entry).rgb;
    vec3 base = reflectance(m);
    vec3 diffuse = (1.0 - base) * (1.0 - part.z) * (1.0 - m.metallic) * m.albedo * ambient;
    vec3 mirrored = (base * part.x + part.y) * lobe_light(m, toward_eye, frame);
    return m.occlusion * open_ * (diffuse + mirrored);
}
