// The picture of a page: decals and light on the surfaces that gbuffer.glsl holds, behind the code of decals
// (decals/pages/programs.py). PICK: two pixels with the decal and the surface at one place instead. Slots as those of
// light_pass.glsl.
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
uniform vec2 place;                  // in the picture, from -1 to 1
const float GRAZING = 0.05;          // cosine between ray and normal below which a point within a pixel is not sought
layout(location = 0) out vec4 picked;  // point and number of the decal; then normal, and 1 where there is a surface

void main() {
    vec2 size = vec2(textureSize(g_position, 0));
    vec2 pixel = 0.5 * (1.0 + place) * size;
    ivec2 texel = ivec2(clamp(floor(pixel), vec2(0.0), size - 1.0));
    vec4 position = texelFetch(g_position, texel, 0);
    vec3 normal = texelFetch(g_normal, texel, 0).xyz;
    picked = vec4(0.0, 0.0, 0.0, -1.0);
    if (position.w > 0.0) {
        float field;
        vec2 uv;
        receive(position);
        int number = decal_owner(position.xyz, normal, field, uv);
        // The surface in the middle of the pixel, moved along its tangent plane.
        vec3 ray = normalize(ray_direction(pixel));
        float facing = dot(ray, normal);
        float away = dot(position.xyz - eye.xyz, normal) / facing;
        vec3 point = abs(facing) < GRAZING ? position.xyz : eye.xyz + away * ray;
        picked = gl_FragCoord.x < 1.0 ? vec4(point, float(number)) : vec4(normal, 1.0);
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
