// What decals do to the surfaces of a picture of a page, behind the code of decals: the point and the number of the
// decal, the normal, and field, stretch and fold of its image (decals/field/jacobian.py).
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform isampler2D object_masks;  // see decals/receivers.py
uniform float measure_step;       // of differences
layout(location = 0) out vec4 measured_point;
layout(location = 1) out vec4 measured_normal;  // and 1 where there is a surface
layout(location = 2) out vec4 measured_image;   // field after contact, stretch, 1 where it is mirrored

const float LEAST_SHARE = 1e-12;  // least one of two sides of an image, in larger ones squared

// Change of the normal along the surface, from the pixels beside this one.
vec3 turn_along(vec3 way, vec3 normal, ivec2 texel) {
    vec3 sides[2];
    vec3 turns[2];
    for (int k = 0; k < 2; k++) {
        ivec2 beside = texel + (k == 0 ? ivec2(1, 0) : ivec2(0, 1));
        ivec2 before = 2 * texel - beside;
        ivec2 last = textureSize(g_position, 0) - 1;
        vec4 one = texelFetch(g_position, clamp(beside, ivec2(0), last), 0);
        vec4 other = texelFetch(g_position, clamp(before, ivec2(0), last), 0);
        if (one.w <= 0.0 || other.w <= 0.0) {
            return vec3(0.0);
        }
        sides[k] = one.xyz - other.xyz;
        turns[k] = texelFetch(g_normal, clamp(beside, ivec2(0), last), 0).xyz
            - texelFetch(g_normal, clamp(before, ivec2(0), last), 0).xyz;
    }
    float aa = dot(sides[0], sides[0]);
    float bb = dot(sides[1], sides[1]);
    float ab = dot(sides[0], sides[1]);
    vec2 along = vec2(dot(way, sides[0]), dot(way, sides[1]));
    float determinant = aa * bb - ab * ab;
    if (determinant <= 0.0) {
        return vec3(0.0);
    }
    vec2 share = vec2(bb * along.x - ab * along.y, aa * along.y - ab * along.x) / determinant;
    return share.x * turns[0] + share.y * turns[1];
}

// Change of the place in an image along a way, central, or one-sided beside another owner.
vec2 image_change(vec3 point, vec3 normal, vec3 way, vec3 turn, int number, vec2 middle) {
    vec2 ends[2];
    float sides = 0.0;
    for (int k = 0; k < 2; k++) {
        float sign = k == 0 ? 1.0 : -1.0;
        float field;
        vec2 uv;
        bool same = decal_owner(point + sign * way, normalize(normal + sign * turn), field, uv) == number;
        ends[k] = same ? uv : middle;
        sides += same ? 1.0 : 0.0;
    }
    return (ends[0] - ends[1]) / max(sides, 1.0);
}

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(g_position, texel, 0);
    vec3 normal = texelFetch(g_normal, texel, 0).xyz;
    measured_point = vec4(0.0, 0.0, 0.0, -1.0);
    measured_normal = measured_image = vec4(0.0);
    if (position.w <= 0.0) {
        return;
    }
    int object = int(position.w) - 1;
    decal_surface_receivers = texelFetch(object_masks, ivec2(object & 4095, object >> 12), 0).x;
    float field;
    vec2 uv;
    int number = decal_owner(position.xyz, normal, field, uv);
    vec2 image = vec2(0.0);
    if (number >= 0) {
        vec3 right = normalize(cross(normal, abs(normal.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0)));
        vec3 ways[2] = vec3[2](measure_step * right, measure_step * cross(normal, right));
        vec2 changes[2];
        for (int k = 0; k < 2; k++) {
            vec3 turn = turn_along(ways[k], normal, texel);
            changes[k] = image_change(position.xyz, normal, ways[k], turn, number, uv) / measure_step;
        }
        float squares = dot(changes[0], changes[0]) + dot(changes[1], changes[1]);
        float area = changes[0].x * changes[1].y - changes[0].y * changes[1].x;
        float larger = 0.5 * (squares + sqrt(max(squares * squares - 4.0 * area * area, 0.0)));
        image = vec2(larger / max(abs(area), LEAST_SHARE * max(larger, 1e-30)), area < 0.0 ? 1.0 : 0.0);
    }
    measured_point = vec4(position.xyz, float(number));
    measured_normal = vec4(normal, 1.0);
    measured_image = vec4(field, image, 0.0);
}
