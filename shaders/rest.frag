// The rest pose behind each pixel of a posed mesh: place, normal, and the footprint of the pixel. The derivatives are
// those within one triangle, because the coordinates of its neighbours are extrapolated.
uniform int object_id;  // index in the scene

in vec3 rest_position;
in vec3 rest_normal;

layout(location = 0) out vec4 r_position;  // xyz, object_id + 1
layout(location = 1) out vec4 r_normal;    // xyz: unit
layout(location = 2) out vec4 r_right;     // xyz: step in the rest pose to the next pixel on the right
layout(location = 3) out vec4 r_up;        // xyz: step to the next pixel above

void main() {
    r_position = vec4(rest_position, float(object_id + 1));
    r_normal = vec4(rest_normal / max(length(rest_normal), 1e-30), 0.0);
    r_right = vec4(dFdx(rest_position), 0.0);
    r_up = vec4(dFdy(rest_position), 0.0);
}
