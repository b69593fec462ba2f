// Decals for shaders of other programs, see decals/hosts/shader.py. FRAGMENT: also with the sides of the pixel by
// derivatives.

uniform int surface_receivers;  // mask of the object, see decals/receivers.py
//@ include decals.glsl
//@ include tangent_step.glsl

// What a light needs of the decals at a point. A host mixes the maps with its own by `part`, and adds the emission.
struct DecalMaterial {
    vec4 color;       // as that of decal_color
    float part;       // part of the pixel that decals with maps cover
    vec3 normal;      // unit
    float roughness;
    float metallic;
    float occlusion;
    vec3 emission;    // linear, times `part`
};

vec3 unit_normal(vec3 normal) {
    return normal / max(length(normal), 1e-30);
}

// The topmost decal at a point, -1 on bare surface; its field after contact, and the place in its image.
int decal_owner(vec3 position, vec3 normal, out float field, out vec2 uv) {
    DecalHit hit = decal_at(position, unit_normal(normal));
    field = hit.field;
    uv = hit.uv;
    return hit.owner;
}

// Premultiplied linear colour of all decals at a point, by the sides of the pixel on the surface.
vec4 decal_color(vec3 position, vec3 normal, vec3 right, vec3 up) {
    vec3 n = unit_normal(normal);
    return color_from(decal_at(position, n), position, n, right, up);
}

// The same with the maps of materials.
DecalMaterial decal_material(vec3 position, vec3 normal, vec3 right, vec3 up) {
    vec4 color = decal_color(position, normal, right, up);
    DecalMaterial material = DecalMaterial(color, 0.0, unit_normal(normal), 1.0, 0.0, 1.0, vec3(0.0));
#ifdef MATERIALS
    float part = material_normals.w;
    if (part > 0.0) {
        vec3 bent = normalize(material_normals.xyz);
        vec2 values = material_values / part;
        material = DecalMaterial(color, part, bent, values.x, values.y, material_glow.a / part, material_glow.rgb);
    }
#endif
    return material;
}
#ifdef FRAGMENT

// A side of the pixel on the tangent plane from that on the triangle; the ray leads from the eye to the point.
vec3 pixel_side(vec3 side, vec3 normal, vec3 ray) {
    return tangent_step(side - dot(side, ray) / max(dot(ray, ray), 1e-30) * ray, unit_normal(normal), ray);
}

// The same by derivatives: call them where all pixels of the triangle do.
vec4 decal_color(vec3 position, vec3 normal, vec3 ray) {
    vec3 right = pixel_side(dFdx(position), normal, ray);
    return decal_color(position, normal, right, pixel_side(dFdy(position), normal, ray));
}

DecalMaterial decal_material(vec3 position, vec3 normal, vec3 ray) {
    vec3 right = pixel_side(dFdx(position), normal, ray);
    return decal_material(position, normal, right, pixel_side(dFdy(position), normal, ray));
}

// The same without the ray, less sharp or less smooth where the triangles are seen at small angles.
vec4 decal_color(vec3 position, vec3 normal) {
    return decal_color(position, normal, dFdx(position), dFdy(position));
}

DecalMaterial decal_material(vec3 position, vec3 normal) {
    return decal_material(position, normal, dFdx(position), dFdy(position));
}
#endif
