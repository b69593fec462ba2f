// Steps on the tangent plane of a surface, from pixel to pixel.
const float MIN_COSINE = 0.05;  // of the angle between ray and normal; at less, footprints grow no longer

// A step, moved along the ray onto the tangent plane with normal n.
vec3 tangent_step(vec3 step_, vec3 n, vec3 ray) {
    float slope = dot(n, ray);
    float least = MIN_COSINE * length(ray);
    slope = slope < 0.0 ? min(slope, -least) : max(slope, least);
    return step_ - ray * (dot(n, step_) / slope);
}
