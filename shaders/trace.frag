// An implicit object in the G-buffer as a fragment shader, for GLSL 3.30 on: drawn over the back of its box.
//@ include gbuffer.glsl
//@ include trace.glsl

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    float start = resumed_way(texel);
    if (start < 0.0) {
        discard;
    }
    Hit hit = trace_pixel(gl_FragCoord.xy, start);
    if (hit.distance < 0.0) {
        complete(texel);  // reports loops that were ended
        discard;          // here: after the surface, rays take a tenth longer on graphics cards
    }
    Surface surface = surface_of(hit);
    if (!complete(texel)) {
        discard;
    }
    write_surface(surface);
    gl_FragDepth = window_depth(hit.position);
}
