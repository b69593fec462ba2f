// Owner, image coordinates and colour of decals at a surface point. All formulas and loops are those of
// decals/field/ownership.py; GLSL adds the image look-up.

//@ include decal_data.glsl

#ifdef POSED
// Steps of this pixel in the rest pose, where decals lie; `is_posed` is false on objects without one.
bool is_posed;
vec3 rest_right;
vec3 rest_up;
// The same steps in the pose, and the normal there.
vec3 posed_right;
vec3 posed_up;
vec3 posed_normal;

// A direction along the surface at rest, with normal n, as a unit one along the posed surface.
vec3 posed_direction(vec3 along, vec3 n) {
    float area = dot(cross(rest_right, rest_up), n);
    vec3 moved = dot(cross(along, rest_up), n) * posed_right + dot(cross(rest_right, along), n) * posed_up;
    moved = (area < 0.0 ? -moved : moved) / max(abs(area), 1e-30);
    moved -= dot(moved, posed_normal) * posed_normal;
    return moved / max(length(moved), 1e-30);
}
#endif

#ifdef MATERIALS
// Sums over the decals of a pixel with materials, each by the part of it that is seen: of normals and 1, of roughness,
// metalness and 1, and of emission and occlusion.
uniform sampler2DArray decal_materials;  // image i: 2i alpha times x, y, roughness, metalness; 2i + 1 emission, occlusion
float material_left;                     // part of the pixel that upper decals leave
vec4 material_normals;
vec2 material_values;
vec4 material_glow;
#endif
#ifdef RELIEF
vec3 relief_normal;  // at this pixel
#endif

//@ slot functions

struct DecalHit {
    int owner;    // -1: none
    float field;  // F of the owner after contact
    vec2 uv;
};

vec4 decal_texel(int i) {
    return fetch_decal_records(ivec2(i & 4095, i >> 12), 0);
}

DecalHit decal_hit(int owner, vec3 q, vec3 n) {
    if (owner < 0) {
        return DecalHit(-1, 0.0, vec2(0.0));
    }
    vec3 pushed = contact_at(q, n, owner, decal_contact);
    return DecalHit(owner, 1.0 - pushed.x, uv_at(q, n, owner, pushed));
}

// The topmost decal.
DecalHit decal_at(vec3 q, vec3 n) {
    if (decal_single_layer) {
        vec4 found = single_layer_at(q, n, decal_contact);
        int owner = int(found.x);
        if (owner < 0) {
            return DecalHit(-1, 0.0, vec2(0.0));
        }
        return DecalHit(owner, 1.0 - found.y, uv_at(q, n, owner, found.yzw));
    }
    return decal_hit(owner_at(q, n, decal_contact), q, n);
}

#ifdef MATERIALS
// Add the maps of a decal's image, averaged with alpha: part of the pixel, normal there, frame of the decal.
void add_maps(vec4 maps, vec4 glow, float alpha, float part, vec3 n, vec3 n_p, vec3 u) {
    vec2 tilt = maps.xy / alpha;
    // The axis u, turned as the normal is on the way to the point; the inverse of `unroll_step`.
    vec3 axis = normalize(u - dot(u, n) / max(1.0 + dot(n_p, n), 1e-4) * (n_p + n));
#ifdef RELIEF
    axis = normalize(axis - dot(axis, relief_normal) * relief_normal);
    n = relief_normal;
#endif
#ifdef POSED
    if (is_posed) {
        axis = posed_direction(axis, n);
        n = posed_normal;
    }
#endif
    vec3 normal = tilt.x * axis + tilt.y * cross(n, axis) + sqrt(max(1.0 - dot(tilt, tilt), 1e-4)) * n;
    material_normals += part * alpha * vec4(normalize(normal), 1.0);
    material_values += part * maps.zw;
    material_glow += part * glow;
}

// The same at a place with derivatives.
void add_material(vec3 place, vec2 dx, vec2 dy, float alpha, float opacity, vec3 n, vec3 n_p, vec3 u) {
    vec4 maps = textureGrad(decal_materials, vec3(place.xy, 2.0 * place.z), dx, dy);
    if (maps.z <= 0.0 || alpha <= 0.0) {
        return;  // no material
    }
    vec4 glow = textureGrad(decal_materials, vec3(place.xy, 2.0 * place.z + 1.0), dx, dy);
    add_maps(maps, glow, alpha, material_left * opacity, n, n_p, u);
}

void clear_materials() {
    material_normals = vec4(0.0);
    material_values = vec2(0.0);
    material_glow = vec4(0.0);
}
#endif

// Premultiplied linear colour of one decal. The derivatives are those of its undeformed image, rolled out, so no
// edge between decals, or of an object, shows in them: `right` and `up` are the sides of the pixel on the surface.
vec4 decal_paint(DecalHit hit, vec3 q, vec3 n, vec3 right, vec3 up) {
    if (!in_image(hit.uv)) {
        return vec4(0.0);
    }
    vec4 u = decal_texel(4 * hit.owner + 2);
    vec4 tint = decal_texel(4 * hit.owner + 3);
    float shown = opacity_at(q, n, hit.owner);
    vec4 color = vec4(1.0);
    if (u.w >= 0.0) {
        float s = decal_texel(4 * hit.owner).w;
        vec3 n_p = decal_texel(4 * hit.owner + 1).xyz;
        float scale = 0.5 / (RIM * s);
        vec2 dx = scale * tangent_coordinates(unroll_step(right, n_p, n), n_p, u.xyz);
        vec2 dy = scale * tangent_coordinates(unroll_step(up, n_p, n), n_p, u.xyz);
        color = textureGrad(decal_images, vec3(hit.uv, u.w), dx, dy);
#ifdef MATERIALS
        add_material(vec3(hit.uv, u.w), dx, dy, color.a, shown, n, n_p, u.xyz);
#endif
    }
    return shown * color * vec4(tint.rgb, 1.0);
}

// Premultiplied linear colour of all decals at a point over each other, from the topmost (`hit`) down; no cap.
vec4 color_from(DecalHit hit, vec3 q, vec3 n, vec3 right, vec3 up) {
#ifdef MATERIALS
    material_left = 1.0;
    clear_materials();
#endif
    vec4 color = vec4(0.0);
    if (!decal_layered) {
        return hit.owner < 0 ? color : decal_paint(hit, q, n, right, up);
    }
    while (hit.owner >= 0 && color.a < OPAQUE) {
#ifdef MATERIALS
        material_left = 1.0 - color.a;
#endif
        color += (1.0 - color.a) * decal_paint(hit, q, n, right, up);
        int below = owner_below(q, n, rank_of(hit.owner, decal_records), next_number_below(hit.owner, decal_records),
            decal_contact);
        hit = decal_hit(below, q, n);
    }
    return color;
}
