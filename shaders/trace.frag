// An implicit object in the G-buffer as a fragment shader, for GLSL 3.30 on: drawn over the back of its box.
//@ include gbuffer.glsl
//@ include trace.glsl

void main() {
    Hit hit = trace_pixel(gl_FragCoord.xy);
    bool missed = hit.distance < 0.0;
    Surface surface;
    if (!missed) {
        surface = surface_of(hit);
    }
    if (loops_ended() || missed) {
        discard;
    }
    write_surface(surface);
    gl_FragDepth = window_depth(hit.position);
}
