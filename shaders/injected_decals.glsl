// Decals in a fragment shader of VTK: inserted before its main(), which calls decal_over for every colour that its
// lights are multiplied with. Positions and normals are those of the decals' space; the caller gives the
// CameraBlock for that space and the picture being drawn.
uniform int surface_receivers;  // mask of the actor, see decals/receivers.py
//@ include color.glsl
//@ include decals.glsl

// Premultiplied linear colour of all decals at a point of the surface.
vec4 injected_decals(vec3 position, vec3 normal) {
    vec3 n = normal / max(length(normal), 1e-30);
    DecalHit hit = decal_at(position, n);
    return decal_color(hit, position, n, ray_direction(gl_FragCoord.xy));
}

// A surface's sRGB colour under decals, scaled by the strength of a kind of light; unchanged without decals.
vec3 decal_over(vec3 color, float strength, vec4 decals) {
    if (decals.a <= 0.0 || strength <= 0.0) {
        return color;
    }
    return strength * to_srgb(to_linear(color / strength) * (1.0 - decals.a) + decals.rgb);
}
