// The light pass under lights of somebody else's, body of pixels.frag and pixels.comp.
//@ include pixel.glsl
//@ include lamps.glsl
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
    return Pixel(vec4(under_lamps(texelFetch(g_paint, texel, 0).rgb, position.xyz, side.w * side.xyz), 1.0));
}
