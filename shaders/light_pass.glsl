// The light pass, body of pixels.frag and pixels.comp: painted surface under light. The slot holds studio_light.glsl
// or lights.glsl; both define `vec3 lit_color(ivec2 texel, vec3 position, vec3 normal, vec3 albedo)`.
//@ include pixel.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_paint;  // rgb: linear albedo, decals included

//@ slot lighting

// color: linear light, premultiplied
Pixel pixel_at(ivec2 texel) {
    vec4 position = texelFetch(g_position, texel, 0);
    if (position.w <= 0.0) {
        return Pixel(vec4(0.0));
    }
    vec4 normal = texelFetch(g_normal, texel, 0);
    vec3 albedo = texelFetch(g_paint, texel, 0).rgb;
    return Pixel(vec4(lit_color(texel, position.xyz, normal.w * normal.xyz, albedo), 1.0));
}
