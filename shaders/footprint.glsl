// Ray differentials (Igehy 1999): what part of a surface a pixel covers, from the camera alone. Differences between
// neighbouring pixels would see the edges between objects instead.
//@ include camera.glsl
const float MOST_GRAZING = 0.05;  // cosine below which footprints grow no longer

// What q moves by, on the surface's tangent plane, when its ray (through `ray`) moves by `step`.
vec3 surface_step(vec3 q, vec3 n, vec3 ray, vec3 step_) {
    float slope = dot(n, ray);
    float least = MOST_GRAZING * length(ray);
    slope = slope < 0.0 ? min(slope, -least) : max(slope, least);
    return ray_spread(q, ray) * (step_ - ray * (dot(n, step_) / slope));
}
