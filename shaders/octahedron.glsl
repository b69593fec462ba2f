// A unit vector as two numbers: its place on an octahedron, whose lower half is folded out (Meyer et al. 2010).
vec2 folded(vec2 place) {
    return (1.0 - abs(place.yx)) * vec2(place.x < 0.0 ? -1.0 : 1.0, place.y < 0.0 ? -1.0 : 1.0);
}

vec2 on_octahedron(vec3 n) {
    n /= max(abs(n.x) + abs(n.y) + abs(n.z), 1e-30);
    return n.z < 0.0 ? folded(n.xy) : n.xy;
}

vec3 off_octahedron(vec2 place) {
    float z = 1.0 - abs(place.x) - abs(place.y);
    return normalize(vec3(z < 0.0 ? folded(place) : place, z));
}
