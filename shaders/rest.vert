// A posed mesh's vertices, with positions and normals in the rest pose. The depth equals that of mesh.vert.
//@ include camera.glsl
in vec3 vertex_position;
in vec3 vertex_rest_position;
in vec3 vertex_rest_normal;

out vec3 rest_position;
out vec3 rest_normal;

invariant gl_Position;

void main() {
    rest_position = vertex_rest_position;
    rest_normal = vertex_rest_normal;
    gl_Position = view_projection * vec4(vertex_position, 1.0);
}
