// The light pass, body of pixels.frag and pixels.comp: painted surface under studio light.
//@ include camera.glsl
//@ include pixel.glsl
//@ include light.glsl
//@ include ambient.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_paint;  // rgb: linear albedo, decals included

// color: linear light, premultiplied
Pixel pixel_at(ivec2 texel) {
    vec4 position = texelFetch(g_position, texel, 0);
    if (position.w <= 0.0) {
        return Pixel(vec4(0.0));
    }
    vec4 side = texelFetch(g_normal, texel, 0);
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    vec3 toward_eye = -normalize(ray);
    vec3 seen = visible_normal(side.w * side.xyz, toward_eye);
    float open_ = openness(g_position, texel, position.xyz, seen, ray);
    vec3 albedo = texelFetch(g_paint, texel, 0).rgb;
    return Pixel(vec4(clamp(shade(albedo, seen, toward_eye, open_), 0.0, 1.0), 1.0));
}
