// Which decal owns a surface point, where in its image the point lies, and what colour that is. All formulas and
// loops are those of decals/ownership.py; GLSL adds the image look-up.
//@ include footprint.glsl
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

DecalHit decal_at(vec3 q, vec3 n) {
    int owner = owner_at(q, n, decal_records, index_level_count, index_levels, index_table, index_mask, index_ids);
    if (owner < 0) {
        return DecalHit(-1, 0.0, vec2(0.0));
    }
    float complement = complement_at(
        q, n, owner, decal_records, index_level_count, index_levels, index_table, index_mask, index_ids);
    return DecalHit(owner, 1.0 - complement, uv_at(q, n, owner, complement, decal_mapping, decal_records));
}

vec4 decal_texel(int i) {
    return texelFetch(decal_records, ivec2(i & 1023, i >> 10), 0);
}

// Premultiplied linear colour of a hit. The derivatives are those of the undeformed image of the one decal that owns
// the pixel, so no edge between decals, or of an object, ever shows in them.
vec4 decal_color(DecalHit hit, vec3 q, vec3 n, vec3 ray) {
    if (hit.owner < 0) {
        return vec4(0.0);
    }
    float s = decal_texel(3 * hit.owner).w;
    vec3 n_p = decal_texel(3 * hit.owner + 1).xyz;
    vec4 u = decal_texel(3 * hit.owner + 2);
    float scale = 0.5 / (RIM * s);
    vec2 dx = scale * tangent_coordinates(surface_step(q, n, ray, ray_right.xyz), n_p, u.xyz);
    vec2 dy = scale * tangent_coordinates(surface_step(q, n, ray, ray_up.xyz), n_p, u.xyz);
    return textureGrad(decal_images, vec3(hit.uv, u.w), dx, dy);
}
