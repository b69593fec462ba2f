// Depth of the surface in the G-buffer, for objects that were not rasterised.
//@ include camera.glsl
uniform sampler2D g_position;

void main() {
    vec4 position = texelFetch(g_position, ivec2(gl_FragCoord.xy), 0);
    if (position.w <= 0.0) {
        discard;
    }
    gl_FragDepth = window_depth(position.xyz);
}
