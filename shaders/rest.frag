// The rest pose behind each pixel of a posed mesh: place, normal, and the footprint of the pixel. The derivatives are
// those within one triangle, because the coordinates of its neighbours are extrapolated.
//@ include octahedron.glsl
uniform int object_id;  // index in the scene

in vec3 rest_position;
in vec3 rest_normal;

layout(location = 0) out vec4 r_position;  // xyz, object_id + 1
layout(location = 1) out vec4 r_right;     // xyz: step in the rest pose to the next pixel on the right
layout(location = 2) out vec4 r_up;        // xyz: step to the next pixel above; w of both: normal, see octahedron.glsl

void main() {
    r_position = vec4(rest_position, float(object_id + 1));
    vec2 normal = on_octahedron(rest_normal);
    r_right = vec4(dFdx(rest_position), normal.x);
    r_up = vec4(dFdy(rest_position), normal.y);
}
