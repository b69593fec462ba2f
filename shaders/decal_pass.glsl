// The decal pass, body of pixels.frag and pixels.comp: for every pixel of the G-buffer the decals that cover it, over
// the object's own colour. DECALS: there are decals; the slot holds decals.glsl. POSED: some objects are posed, and the
// textures of rest.frag say where their pixels lie in the rest pose. TWO_TARGETS: also write owner, field and uv.
// LIMITED: decals have receivers or fades. MATERIALS: some images have maps; color.w is then the metalness.
// RELIEF: some images have heights; the slot relief holds relief.glsl. With POSED, the posed objects are trees that
// offset.glsl has moved.
// FILTERED: average the decals over each pixel; the slot holds filtered_decals.glsl. With MARKED, pixels may be left
// `pixel_divided`: they must be drawn again without it. With SHARED, invocations of a group draw their pixels together.
//@ include footprint.glsl
//@ include pixel.glsl
uniform sampler2D g_position;
uniform sampler2D g_normal;
uniform sampler2D g_color;
#ifdef POSED
//@ include octahedron.glsl
uniform sampler2D r_position;
uniform sampler2D r_right;
uniform sampler2D r_up;
#endif

#ifdef LIMITED
uniform isampler2D object_masks;
#endif
int surface_receivers = -1;  // mask of the object at this pixel, see decals/receivers.py

// Surface at a pixel: where it is seen, and its place and normal where decals lie, in the rest pose if it has one.
struct Surface {
    vec3 visible;
    vec3 position;
    vec3 normal;
#ifdef FILTERED
    vec3 right;  // sides of the pixel, at `position`
    vec3 up;
#endif
};

//@ slot decals optional
//@ slot relief optional

#ifdef DECALS
// The surface at a pixel of an object; sets the variables of decals.glsl that depend on it.
Surface surface_at(ivec2 texel) {
    Surface surface;
    vec4 visible = texelFetch(g_position, texel, 0);
    surface.visible = surface.position = visible.xyz;
#ifdef LIMITED
    int object = int(visible.w) - 1;
    surface_receivers = texelFetch(object_masks, ivec2(object & 4095, object >> 12), 0).x;
#endif
    surface.normal = texelFetch(g_normal, texel, 0).xyz;
#ifdef FILTERED
    vec3 ray = ray_direction(vec2(texel) + 0.5);
    surface.right = surface_step(visible.xyz, surface.normal, ray, ray_right.xyz);
    surface.up = surface_step(visible.xyz, surface.normal, ray, ray_up.xyz);
#endif
#ifdef POSED
    vec4 rest = texelFetch(r_position, texel, 0);
    is_posed = rest.w == visible.w;
    if (is_posed) {
        surface.position = rest.xyz;
        vec4 right = texelFetch(r_right, texel, 0);
        vec4 up = texelFetch(r_up, texel, 0);
        rest_right = right.xyz;
        rest_up = up.xyz;
#ifdef FILTERED
        surface.right = rest_right;
        surface.up = rest_up;
#endif
#ifdef MATERIALS
        vec3 toward = ray_direction(vec2(texel) + 0.5);
        posed_normal = surface.normal;
        posed_right = surface_step(visible.xyz, posed_normal, toward, ray_right.xyz);
        posed_up = surface_step(visible.xyz, posed_normal, toward, ray_up.xyz);
#endif
        surface.normal = off_octahedron(vec2(right.w, up.w));
    }
#endif
    return surface;
}
#endif

//@ slot shared optional

// color: linear albedo, w = 1 on objects; buffers: owner or -1, field F, uv
Pixel pixel_at(ivec2 texel) {
    Pixel pixel;
#ifdef MATERIALS
    pixel.material = pixel.glow = vec4(0.0);
#endif
    pixel.color = texelFetch(g_color, texel, 0);  // half the bytes of a position, which the background need not read
    vec4 buffers = vec4(-1.0, 0.0, 0.0, 0.0);
#ifdef DECALS
    if (pixel.color.w > 0.0) {
#ifdef SHARED
        vec4 color = shared_color(texel);
#else
        Surface surface = surface_at(texel);
#ifdef FILTERED
        vec4 color = filtered_color(surface);
#else
        vec3 position = surface.position;
        vec3 normal = surface.normal;
#ifdef RELIEF
        relief_normal = normal;
        float height = dot(surface.visible - position, normal);
        bool raised = true;
#ifdef POSED
        if (!is_posed)  // offset.glsl moved the others
#endif
        {
            raised = dot(ray_direction(vec2(texel) + 0.5), normal) < 0.0;  // none on the inside of a surface
            if (raised) {
                vec4 found = relief_point(position, normal, ray_direction(vec2(texel) + 0.5));
                position = found.xyz;
                height = found.w;
                relief_normal = relief_normal_at(position, normal);
            }
        }
#endif
        DecalHit hit = decal_at(position, normal);  // before the steps, which would take registers meanwhile
        vec3 ray = ray_direction(vec2(texel) + 0.5);
        vec3 right = surface_step(position, normal, ray, ray_right.xyz);
        vec3 up = surface_step(position, normal, ray, ray_up.xyz);
#ifdef POSED
        right = is_posed ? rest_right : right;
        up = is_posed ? rest_up : up;
#endif
        vec4 color = color_from(hit, position, normal, right, up);
        buffers = vec4(float(hit.owner), hit.field, hit.uv);
#endif
#endif
#ifdef MATERIALS
        float part = material_normals.w;
        if (part > 0.0) {
            pixel.material = vec4(part * normalize(material_normals.xyz), material_values.x / part);
            pixel.glow = vec4(material_glow.rgb, material_glow.a / part);
            pixel.color.w = material_values.y / part;
#ifdef RELIEF
            vec3 bent = texelFetch(g_normal, texel, 0).w * normalize(material_normals.xyz);
            bool shown = raised && relief_faces_light(bent, surface.visible, -normalize(ray_direction(vec2(texel) + 0.5)));
            float lit = shown ? relief_light_at(position, height, normal) : 1.0;
            pixel.material.w += 2.0 * round(RELIEF_LEVELS * lit);
#endif
        }
#endif
        pixel.color.rgb = pixel.color.rgb * (1.0 - color.a) + color.rgb;
    }
#endif
#ifdef TWO_TARGETS
    pixel.buffers = buffers;
#endif
    return pixel;
}
