// A mesh with decals in a page, behind the code of decals (decals/pages/contents.py). PICK: the number of the decal
// at a pixel, in place of its colour. MATERIAL_LIGHT: some decals have materials.
in vec3 position;
in vec3 normal;
in vec3 light;  // linear base colour
uniform bool lit;
out vec4 color;
#ifdef PICK

void main() {
    float field;
    vec2 uv;
    int number = decal_owner(position, normal, field, uv) + 1;
    color = vec4(number & 255, number >> 8 & 255, number >> 16, 255) / 255.0;
}
#else
//@ include color.glsl
//@ include footprint.glsl
//@ slot material optional
//@ include studio_shade.glsl

void main() {
    vec3 outside = normal / max(length(normal), 1e-30);
    vec3 ray = ray_direction(gl_FragCoord.xy);
    vec3 right = surface_step(position, outside, ray, ray_right.xyz);
    vec3 up = surface_step(position, outside, ray, ray_up.xyz);
    decal_Material decals = decal_material(position, outside, right, up);
    vec3 albedo = light * (1.0 - decals.color.a) + decals.color.rgb;
    if (!lit) {
        color = vec4(to_srgb(albedo), 1.0);
        return;
    }
    vec3 toward_eye = -normalize(ray);
    float side = gl_FrontFacing ? 1.0 : -1.0;
    vec3 seen = clamp(shade(albedo, visible_normal(side * outside, toward_eye), toward_eye, 1.0), 0.0, 1.0);
#ifdef MATERIAL_LIGHT
    float roughness = max(decals.roughness, MIN_ROUGHNESS);
    vec3 emission = decals.emission / max(decals.part, 1e-4);
    Material material = Material(
        albedo, side * decals.normal, roughness, decals.metallic, decals.occlusion, emission);
    seen = mix(seen, shade_material(material, toward_eye, 1.0), min(decals.part, 1.0));
#endif
    color = vec4(to_srgb(seen), 1.0);
}
#endif
