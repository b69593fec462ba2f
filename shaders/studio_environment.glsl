// The studio's environment, as lobes that stay with the camera, see decals/rendering/studio.py.
// Before it stand its constants.

// Radiance around a direction, seen through a lobe of this sharpness.
vec3 lobes_around(vec3 direction, float sharpness) {
    float kept = sharpness / (sharpness + 1.0);  // of the mean direction, by the width of the lobe
    vec3 light = mix(GROUND_COLOR, SKY_COLOR, 0.5 + 0.5 * kept * direction.y);
    for (int i = 0; i < ENVIRONMENT_LOBES; i++) {
        float own = environment_axes[i].w;
        float both = own * sharpness / (own + sharpness);
        light += both / own * exp(both * (dot(direction, environment_axes[i].xyz) - 1.0)) * environment_colors[i];
    }
    return light;
}

// Mirrored light by Karis' fit of the integral over the lobe (Physically Based Shading on Mobile, 2014). The frame is
// the camera's.
vec3 environment_light(Material m, vec3 toward_eye, vec3 ambient, float open_, mat3 frame) {
    float seen = facing(m, toward_eye);
    float alpha = m.roughness * m.roughness;
    vec3 bounced = 2.0 * dot(m.normal, toward_eye) * m.normal - toward_eye;
    vec3 radiance = lobes_around(frame * bounced, 0.5 / (alpha * alpha * seen));
    vec4 r = m.roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float scale = min(r.x * r.x, exp2(-9.28 * seen)) * r.x + r.y;
    vec2 fit = vec2(-1.04, 1.04) * scale + r.zw;
    vec3 mirrored = reflectance(m) * fit.x + fit.y;
    vec3 diffuse = (1.0 - mirrored) * (1.0 - m.metallic) * m.albedo * ambient;
    return m.occlusion * open_ * (diffuse + mirrored * radiance);
}
