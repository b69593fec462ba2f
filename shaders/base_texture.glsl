// Light of a mesh's texture.
uniform sampler2D base_texture;  // decoded to linear light
uniform bvec2 mirrored;          // axes along which every second copy is a mirror image

// `right`, `up`: steps of the coordinates to the next pixels.
vec3 texture_light(vec2 coordinates, vec2 right, vec2 up) {
    vec2 folded = 1.0 - abs(mod(coordinates, 2.0) - 1.0);
    vec2 place = vec2(mirrored.x ? folded.x : coordinates.x, mirrored.y ? folded.y : coordinates.y);
    return textureGrad(base_texture, place, right, up).rgb;
}
