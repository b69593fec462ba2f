// Ray differentials (Igehy 1999): the footprint of a pixel on a surface, from the camera alone. Differences between
// neighbouring pixels would cross the edges between objects.
//@ include camera.glsl
//@ include tangent_step.glsl

// Movement of q on the surface's tangent plane when the direction of its ray moves by `step_`.
vec3 surface_step(vec3 q, vec3 n, vec3 ray, vec3 step_) {
    return ray_spread(q, ray) * tangent_step(step_, n, ray);
}
