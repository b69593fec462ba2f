// The G-buffer's targets, which every kind of object writes for each pixel that it covers.
//@ include surface.glsl
layout(location = 0) out vec4 g_position;
layout(location = 1) out vec4 g_normal;
layout(location = 2) out vec4 g_color;

void write_surface(Surface surface) {
    g_position = surface.position;
    g_normal = surface.normal;
    g_color = surface.color;
}
