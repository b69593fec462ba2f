// A mesh's vertices, split at creases, with area-weighted normals.
//@ include camera.glsl
in vec3 vertex_position;
in vec3 vertex_normal;
in vec3 vertex_color;

out vec3 position;
out vec3 normal;
out vec3 color;

invariant gl_Position;  // rest.vert draws at equal depths

void main() {
    position = vertex_position;
    normal = vertex_normal;
    color = vertex_color;
    gl_Position = view_projection * vec4(vertex_position, 1.0);
}
