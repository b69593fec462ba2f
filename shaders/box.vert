// The twelve triangles of a box, counter-clockwise from outside: draw them with front faces culled, and every
// pixel whose ray meets the box gets exactly one fragment, also when the eye is inside.
//@ include camera.glsl
uniform vec3 box_lower;
uniform vec3 box_upper;

const int CORNERS[36] = int[36](
    0, 4, 6,  0, 6, 2,   1, 3, 7,  1, 7, 5,   // x lower, x upper
    0, 1, 5,  0, 5, 4,   2, 6, 7,  2, 7, 3,   // y lower, y upper
    0, 2, 3,  0, 3, 1,   4, 5, 7,  4, 7, 6);  // z lower, z upper

void main() {
    int corner = CORNERS[gl_VertexID];
    vec3 choice = vec3(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
    gl_Position = view_projection * vec4(mix(box_lower, box_upper, choice), 1.0);
    gl_Position.z = min(gl_Position.z, gl_Position.w);  // a far plane before the back of the box must not clip it
}
