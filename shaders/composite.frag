// Our picture in VTK's frame, which may be larger: colour, blended by the covered part of the pixel, and depth.
uniform sampler2D color;  // sRGB, premultiplied alpha; filtered bilinearly, to its edges
uniform sampler2D depth;
uniform vec2 corner;      // of the picture in the frame, in pixels
uniform vec2 size;        // in pixels

out vec4 pixel;

void main() {
    vec2 at = (gl_FragCoord.xy - corner) / size;
    pixel = texture(color, at);
    if (pixel.a <= 0.0) {
        discard;
    }
    gl_FragDepth = texture(depth, at).r;
}
