// Ray differentials (Igehy 1999): the footprint of a pixel on a surface, from the camera alone. Differences between
// neighbouring pixels would cross the edges between objects.
//@ include camera.glsl
const float MIN_COSINE = 0.05;  // of the angle between ray and normal; at less, footprints grow no longer

// Movement of q on the surface's tangent plane when the direction of its ray moves by `step_`.
vec3 surface_step(vec3 q, vec3 n, vec3 ray, vec3 step_) {
    float slope = dot(n, ray);
    float least = MIN_COSINE * length(ray);
    slope = slope < 0.0 ? min(slope, -least) : max(slope, least);
    return ray_spread(q, ray) * (step_ - ray * (dot(n, step_) / slope));
}
