// The camera's axes, and the direction toward the studio's key light.
//@ include camera.glsl
const vec3 KEY_DIRECTION = vec3(-0.55, 0.75, 0.70);  // right, up, back

// Axes of the camera: right, up, back.
mat3 camera_frame() {
    vec3 right = normalize(ray_right.xyz);
    vec3 up = normalize(ray_up.xyz);
    return mat3(right, up, cross(right, up));
}
