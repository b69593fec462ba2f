// Decals over the colours of VTK: inserted before main() of a fragment shader, behind the code of decals.hosts. Called
// for every colour that its lights are multiplied with.
//@ include color.glsl

// A surface's sRGB colour under decals, scaled by the strength of a kind of light; unchanged without decals.
vec3 decal_over(vec3 color, float strength, vec4 decals) {
    if (decals.a <= 0.0 || strength <= 0.0) {
        return color;
    }
    return strength * to_srgb(to_linear(color / strength) * (1.0 - decals.a) + decals.rgb);
}
