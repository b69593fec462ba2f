// What every kind of object writes for each pixel that it covers.
//@ include camera.glsl
//@ include color.glsl
uniform int object_id;  // index in the scene

layout(location = 0) out vec4 g_position;  // xyz, object_id + 1; w = 0 is background
layout(location = 1) out vec4 g_normal;    // xyz: unit (zero where a mesh's cancel), smooth; w: 1 where the outside is seen, else -1
layout(location = 2) out vec4 g_color;     // rgb: linear light

void write_surface(vec3 position, vec3 normal, vec3 srgb, bool outside) {
    g_position = vec4(position, float(object_id + 1));
    g_normal = vec4(normal / max(length(normal), 1e-30), outside ? 1.0 : -1.0);
    g_color = vec4(to_linear(srgb), 1.0);
}

void write_surface(vec3 position, vec3 normal, vec3 srgb) {
    write_surface(position, normal, srgb, true);
}
