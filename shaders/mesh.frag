//@ include gbuffer.glsl
in vec3 position;
in vec3 normal;
in vec3 color;

void main() {
    write_surface(surface_at(position, normal, color, gl_FrontFacing));
}
