// Surface under given lights: what VTK's shader of polygons makes of a material that is diffuse alone. As there, sums
// are of display values, not of linear light.
//@ include color.glsl
const int MOST_LAMPS = 32;
// Four rows a lamp: position, 1 (0: infinitely far away); direction, cosine of its cone (-2: none); colour, the
// cone's exponent; attenuation.
uniform vec4 lamps[4 * MOST_LAMPS];
uniform int lamp_count;
uniform mat4 lamp_place;  // the scene to where the lamps are

vec3 lamp_light(int i, vec3 position, vec3 n) {
    vec4 place = lamps[4 * i], axis = lamps[4 * i + 1], colour = lamps[4 * i + 2];
    vec3 way = axis.xyz;
    float strength = 1.0;
    if (place.w > 0.0) {
        way = position - place.xyz;
        float far = length(way);
        way /= far;
        strength /= dot(lamps[4 * i + 3].xyz, vec3(1.0, far, far * far));
        float along = dot(way, axis.xyz);
        if (axis.w > -1.5) {
            strength *= along >= axis.w ? pow(along, colour.w) : 0.0;
        }
    }
    return max(strength * dot(n, -way), 0.0) * colour.rgb;
}

// All in the scene's coordinates; `albedo` and the result are linear.
vec3 under_lamps(vec3 albedo, vec3 position, vec3 normal) {
    vec3 light = vec3(lamp_count == 0 ? 1.0 : 0.0);
    vec3 place = (lamp_place * vec4(position, 1.0)).xyz;
    vec3 n = normalize(transpose(inverse(mat3(lamp_place))) * normal);
    for (int i = 0; i < lamp_count; i++) {
        light += lamp_light(i, place, n);
    }
    return to_linear(to_srgb(albedo) * light);
}
