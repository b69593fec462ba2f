// The visible surface at a pixel, as in the G-buffer: see gbuffer.glsl.
//@ include color.glsl
uniform int object_id;  // index in the scene

struct Surface {
    vec4 position;  // xyz, object_id + 1; w = 0 is background
    vec4 normal;    // xyz: unit (zero where a mesh's cancel), smooth; w: 1 if the outside is visible, else -1
    vec4 color;     // rgb: linear light; w: 1, and 0 in the background
};

Surface surface_in_light(vec3 position, vec3 normal, vec3 linear, bool outside) {
    return Surface(
        vec4(position, float(object_id + 1)),
        vec4(normal / max(length(normal), 1e-30), outside ? 1.0 : -1.0),
        vec4(linear, 1.0));
}

Surface surface_at(vec3 position, vec3 normal, vec3 srgb, bool outside) {
    return surface_in_light(position, normal, to_linear(srgb), outside);
}
