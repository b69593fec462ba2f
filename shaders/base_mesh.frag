//@ include gbuffer.glsl
in vec3 position;
in vec3 normal;
in vec3 light;
#ifdef TEXTURED
//@ include base_texture.glsl
in vec2 coordinates;
#endif

void main() {
    vec3 base = light;
#ifdef TEXTURED
    base *= texture_light(coordinates, dFdx(coordinates), dFdy(coordinates));
#endif
    write_surface(surface_in_light(position, normal, base, gl_FrontFacing));
}
