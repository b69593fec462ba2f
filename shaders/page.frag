// The picture of a page: decals and light on the surfaces that gbuffer.glsl holds, behind the code of decals
// (decals/pages/programs.py). PICK: the number of the decal at one pixel in its place. Slots as those of light_pass.glsl.
//@ include camera.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_color;
uniform isampler2D object_masks;  // see decals/receivers.py

void receive(vec4 position) {
    int object = int(position.w) - 1;
    decal_surface_receivers = texelFetch(object_masks, ivec2(object & 4095, object >> 12), 0).x;
}
#ifdef PICK
uniform ivec2 corner;  // the pixel
layout(location = 0) out int number;

void main() {
    vec4 position = texelFetch(g_position, corner, 0);
    number = -1;
    if (position.w > 0.0) {
        float field;
        vec2 uv;
        receive(position);
        number = decal_owner(position.xyz, texelFetch(g_normal, corner, 0).xyz, field, uv);
    }
}
#else
//@ include color.glsl
//@ include footprint.glsl
uniform vec4 rim;                     // centre and radius of the decal that is marked; radius 0: none
const vec3 RIM_COLOR = vec3(0.043, 0.341, 0.816);
layout(location = 0) out vec4 color;  // sRGB, premultiplied

//@ slot material optional

//@ slot lighting

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(g_position, texel, 0);
    color = vec4(0.0);
#ifdef ENVIRONMENT_SHOWN
    color = vec4(to_srgb(environment_behind(texel)), 1.0);
#endif
    if (position.w <= 0.0) {
        return;
    }
    receive(position);
    vec4 normal = texelFetch(g_normal, texel, 0);
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 right = surface_step(position.xyz, normal.xyz, ray, ray_right.xyz);
    vec3 up = surface_step(position.xyz, normal.xyz, ray, ray_up.xyz);
    decal_Material decals = decal_material(position.xyz, normal.xyz, right, up);
    vec3 albedo = texelFetch(g_color, texel, 0).rgb * (1.0 - decals.color.a) + decals.color.rgb;
    vec3 light = lit_color(texel, position.xyz, normal.w * normal.xyz, albedo);
#ifdef MATERIAL_LIGHT
    float part = min(decals.part, 1.0);
    if (part > 0.0) {
        float roughness = max(decals.roughness, MIN_ROUGHNESS);
        Material material = Material(
            albedo, normal.w * decals.normal, roughness, decals.metallic, decals.occlusion, decals.emission / part);
        light = mix(light, material_color(texel, position.xyz, normal.w * normal.xyz, material), part);
    }
#endif
    color = vec4(to_srgb(light), 1.0);
    float away = abs(distance(position.xyz, rim.xyz) - rim.w);
    if (rim.w > 0.0 && away < ray_spread(position.xyz, ray) * length(ray_right.xyz)) {
        color.rgb = RIM_COLOR;
    }
}
#endif
