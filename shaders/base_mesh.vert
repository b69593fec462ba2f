// A mesh's vertices with base colours in linear light, and with TEXTURED places in a texture.
//@ include camera.glsl
in vec3 vertex_position;
in vec3 vertex_normal;
in vec3 vertex_light;
#ifdef TEXTURED
in vec2 vertex_coordinates;
#endif

out vec3 position;
out vec3 normal;
out vec3 light;
#ifdef TEXTURED
out vec2 coordinates;
#endif

invariant gl_Position;  // rest.vert draws at equal depths

void main() {
    position = vertex_position;
    normal = vertex_normal;
    light = vertex_light;
#ifdef TEXTURED
    coordinates = vertex_coordinates;
#endif
    gl_Position = view_projection * vec4(vertex_position, 1.0);
}
