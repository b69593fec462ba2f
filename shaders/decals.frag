// The pass over the G-buffer: for every pixel the decal that owns it, its colour over the object's, and light.
// DECALS: there are decals; the slot holds decals.glsl. BUFFERS: also write what was found, for tests and picking.
//@ include camera.glsl
//@ include light.glsl
//@ include ambient.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_color;

//@ slot decals optional

layout(location = 0) out vec4 out_light;  // linear, premultiplied
#ifdef BUFFERS
layout(location = 1) out vec4 out_decal;  // owner or -1, field F, uv
#endif

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(g_position, texel, 0);
    vec4 decal = vec4(-1.0, 0.0, 0.0, 0.0);
    vec4 light = vec4(0.0);
    if (position.w > 0.0) {
        vec4 side = texelFetch(g_normal, texel, 0);
        vec3 normal = side.xyz;
        vec3 albedo = texelFetch(g_color, texel, 0).rgb;
        vec3 ray = ray_direction(gl_FragCoord.xy);
#ifdef DECALS
        DecalHit hit = decal_at(position.xyz, normal);
        vec4 color = decal_color(hit, position.xyz, normal, ray);
        albedo = albedo * (1.0 - color.a) + color.rgb;
        decal = vec4(float(hit.owner), hit.field, hit.uv);
#endif
        vec3 toward_eye = -normalize(ray);
        vec3 seen = visible_normal(side.w * normal, toward_eye);
        float open_ = openness(g_position, texel, position.xyz, seen, ray);
        light = vec4(clamp(shade(albedo, seen, toward_eye, open_), 0.0, 1.0), 1.0);
    }
    out_light = light;
#ifdef BUFFERS
    out_decal = decal;
#endif
}
