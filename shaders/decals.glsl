// Which decal owns a surface point, where in its image the point lies, and what colour that is.
// The formulas come from decals/contact.py, mapping.py and lookup.py; the loops are those of decals/evaluate.py.
uniform sampler2D decal_records;  // decal i: texels 3i (position, s), 3i + 1 (normal, facing limit), 3i + 2 (u, image)
uniform sampler2D index_levels;
uniform isampler2D index_table;
uniform isampler2D index_ids;
uniform int index_level_count;
uniform int index_mask;
uniform int decal_mapping;
uniform sampler2DArray decal_images;  // linear, premultiplied

//@ slot functions

struct DecalHit {
    int owner;    // -1: none
    float field;  // F of the owner after contact
    vec2 uv;
};

vec4 data_texel(sampler2D data, int i) {
    return texelFetch(data, ivec2(i & 1023, i >> 10), 0);
}

int data_texel(isampler2D data, int i) {
    return texelFetch(data, ivec2(i & 1023, i >> 10), 0).x;
}

ivec2 candidates(vec3 q, int level) {
    return cell_range(q, level, index_levels, index_table, index_mask, index_ids);
}

// e of a decal at q, or NOWHERE where it does not act.
float complement_at(int decal, vec3 q, vec3 n) {
    vec4 sphere = data_texel(decal_records, 3 * decal);
    vec3 w = (q - sphere.xyz) / sphere.w;
    float z = dot(w, w);
    if (z >= 1.0) {
        return NOWHERE;
    }
    vec4 facing = data_texel(decal_records, 3 * decal + 1);
    return dot(facing.xyz, n) > facing.w ? field_complement(z) : NOWHERE;
}

DecalHit decal_at(vec3 q, vec3 n) {
    int owner = -1;
    float e_k = NOWHERE;
    for (int level = 0; level < index_level_count; level++) {
        ivec2 span = candidates(q, level);
        for (int j = span.x; j < span.y; j++) {
            int decal = data_texel(index_ids, j);
            float e = complement_at(decal, q, n);
            if (e < e_k || (e == e_k && decal < owner)) {
                e_k = e;
                owner = decal;
            }
        }
    }
    if (e_k > 0.5) {
        return DecalHit(-1, 0.0, vec2(0.0));
    }
    float push = 0.0;
    for (int level = 0; level < index_level_count; level++) {
        ivec2 span = candidates(q, level);
        for (int j = span.x; j < span.y; j++) {
            int decal = data_texel(index_ids, j);
            if (decal != owner) {
                push = add_push(push, contact_push(complement_at(decal, q, n), e_k));
            }
        }
    }
    float complement = contact_complement(e_k, push);
    vec3 p = data_texel(decal_records, 3 * owner).xyz;
    vec3 n_p = data_texel(decal_records, 3 * owner + 1).xyz;
    vec3 u = data_texel(decal_records, 3 * owner + 2).xyz;
    vec2 offset = tangent_coordinates(surface_offset(q - p, n_p, n, decal_mapping), n_p, u);
    return DecalHit(owner, 1.0 - complement, contact_uv(offset, rim_distance(complement)));
}

// What q moves by, on the surface's tangent plane, when its ray (through `ray`) moves by `step`.
vec3 surface_step(vec3 q, vec3 n, vec3 ray, vec3 step_) {
    float slope = dot(n, ray);
    float least = 0.05 * length(ray);
    slope = slope < 0.0 ? min(slope, -least) : max(slope, least);
    return dot(q - eye.xyz, ray) / dot(ray, ray) * (step_ - ray * (dot(n, step_) / slope));
}

// Premultiplied linear colour of a hit. The derivatives are those of the undeformed image of the one decal that owns
// the pixel, so no edge between decals, or of an object, ever shows in them.
vec4 decal_color(DecalHit hit, vec3 q, vec3 n, vec3 ray) {
    if (hit.owner < 0) {
        return vec4(0.0);
    }
    float s = data_texel(decal_records, 3 * hit.owner).w;
    vec3 n_p = data_texel(decal_records, 3 * hit.owner + 1).xyz;
    vec4 u = data_texel(decal_records, 3 * hit.owner + 2);
    float scale = 0.5 / (RIM * s);
    vec2 dx = scale * tangent_coordinates(surface_step(q, n, ray, ray_right.xyz), n_p, u.xyz);
    vec2 dy = scale * tangent_coordinates(surface_step(q, n, ray, ray_up.xyz), n_p, u.xyz);
    return textureGrad(decal_images, vec3(hit.uv, u.w), dx, dy);
}
