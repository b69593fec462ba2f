//@ include gbuffer.glsl
in vec3 position;
in vec3 normal;
in vec3 light;
#ifdef TEXTURED
uniform sampler2D base_texture;  // decoded to linear light
uniform bvec2 mirrored;          // axes along which every second copy is a mirror image
in vec2 coordinates;

vec3 texture_light() {
    vec2 folded = 1.0 - abs(mod(coordinates, 2.0) - 1.0);
    vec2 place = vec2(mirrored.x ? folded.x : coordinates.x, mirrored.y ? folded.y : coordinates.y);
    return textureGrad(base_texture, place, dFdx(coordinates), dFdy(coordinates)).rgb;
}
#endif

void main() {
    vec3 base = light;
#ifdef TEXTURED
    base *= texture_light();
#endif
    write_surface(surface_in_light(position, normal, base, gl_FrontFacing));
}
