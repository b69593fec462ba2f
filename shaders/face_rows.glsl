// Faces of a mesh and the numbers of their vertices, for compute shaders: position, normal, colour, coordinates; and
// the nearest face at each pixel. Without one, both entries are NO_FACE.
layout(std430, binding = 1) readonly buffer Rows {
    float rows[];
};
layout(std430, binding = 2) readonly buffer Faces {
    int faces[];
};

// Place in `rows` of a corner of a face.
int corner_at(int face, int corner) {
    return ROW_LENGTH * faces[3 * face + corner];
}

vec3 vector_at(int place) {
    return vec3(rows[place], rows[place + 1], rows[place + 2]);
}

layout(binding = 0, r32ui) uniform uimage2D face_depth;   // bits of the depth, which rise with it
layout(binding = 1, r32ui) uniform uimage2D face_number;
