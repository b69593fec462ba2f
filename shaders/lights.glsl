// A surface under the lights of a scene: what VTK's shader of polygons makes of a diffuse material. As in VTK, sums
// are of display values, not of linear light.
//@ include color.glsl
const int MAX_LIGHTS = 32;
// Four rows a light: position, 1 (0: at infinity); direction, cosine of its cone (-2: none); colour, the cone's
// exponent; attenuation.
uniform vec4 lights[4 * MAX_LIGHTS];
uniform int light_count;
uniform mat4 light_frame;  // the scene's coordinates to those of the lights

vec3 light_at(int i, vec3 position, vec3 n) {
    vec4 origin = lights[4 * i], axis = lights[4 * i + 1], color = lights[4 * i + 2];
    vec3 direction = axis.xyz;
    float strength = 1.0;
    if (origin.w > 0.0) {
        direction = position - origin.xyz;
        float distance_ = length(direction);
        direction /= distance_;
        strength /= dot(lights[4 * i + 3].xyz, vec3(1.0, distance_, distance_ * distance_));
        float along = dot(direction, axis.xyz);
        if (axis.w > -1.5) {
            strength *= along >= axis.w ? pow(along, color.w) : 0.0;
        }
    }
    return max(strength * dot(n, -direction), 0.0) * color.rgb;
}

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo) {
    vec3 light = vec3(light_count == 0 ? 1.0 : 0.0);
    vec3 point = (light_frame * vec4(position, 1.0)).xyz;
    vec3 n = normalize(transpose(inverse(mat3(light_frame))) * normal);
    for (int i = 0; i < light_count; i++) {
        light += light_at(i, point, n);
    }
    return to_linear(to_srgb(albedo) * light);
}
