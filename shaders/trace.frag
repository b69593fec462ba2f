// An implicit object in the G-buffer as a fragment shader, for GLSL 3.30 on: drawn over the back of its box.
//@ include gbuffer.glsl
//@ include trace.glsl

void main() {
    Hit hit = trace_pixel(gl_FragCoord.xy);
    if (hit.distance < 0.0) {
        discard;
    }
    write_surface(surface_of(hit));
    gl_FragDepth = window_depth(hit.position);
}
