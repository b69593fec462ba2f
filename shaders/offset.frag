// A moved BlobTree in the G-buffer and the rest buffer as a fragment shader, drawn over the back of its box.
//@ include gbuffer.glsl
//@ include offset.glsl
layout(location = 3) out vec4 r_position;
layout(location = 4) out vec4 r_right;
layout(location = 5) out vec4 r_up;

void main() {
    Offset found = offset_pixel(gl_FragCoord.xy);
    if (found.surface.position.w <= 0.0) {
        discard;
    }
    write_surface(found.surface);
    r_position = found.rest;
    r_right = found.rest_right;
    r_up = found.rest_up;
    gl_FragDepth = window_depth(found.surface.position.xyz);
}
