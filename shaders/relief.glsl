// Relief of decals without triangles: parallax occlusion mapping (Tatarchuk 2006). A ray is followed over the tangent
// plane of the surface at a pixel, and heights are looked up through contact and image mapping. Lookups are bounded
// in number and, as long as they last, in length.
//@ include key_light.glsl
uniform sampler2DArray decal_reliefs;  // heights in radii, times alpha; alpha. Behind all images: slopes
uniform int relief_images;
uniform int relief_cells;              // along each side of an image, of which slopes are known
uniform float relief_stretch;          // of images by contact and mapping, at most
uniform vec4 cone_lengths;             // on the surface, up to which slopes hold
uniform vec2 relief_range;             // lowest and highest point of the relief, in model units, the surface included
uniform float relief_step;             // greatest step along the surface
uniform vec4 relief_light;             // w = 0: the studio's key; 1: toward light at infinity; 2: where a light is

const int RELIEF_STEPS = 40;      // to the relief, or toward the light, at most
const int RELIEF_HALVINGS = 8;    // of the last step
const float SHADOW_EDGE = 0.06;   // of the range: depth below the relief at which a shadow is full
const float LEAST_SLOPE = 0.08;   // least cosine between the normal and the ray, or the light

const float NORMAL_ROUNDING = 1e-3;  // of the normal that the light pass reads, at most

const int RIM_KNOTS = 32;
const bool RELIEF_STEPPED = decal_layered || decal_nested || decal_limited;  // decals begin within images of others
uniform vec4 rim_slopes[RIM_KNOTS + 1];  // to neighbours, by the distance from the rim

// By which heights rise at most over the surface, up to each of the lengths, from where one was looked up last.
vec4 relief_slopes;

// Slopes to neighbours of a decal at a distance from its rim; knots lie closer near the rim.
vec4 slopes_beyond(float rim) {
    float share = min(rim / (relief_stretch * cone_lengths.w), 1.0);
    return relief_stretch * rim_slopes[int(float(RIM_KNOTS) * sqrt(share))];
}

// Slopes of cones that contain the heights of an image around a place (see decals/rendering/materials.py).
vec4 slopes_within(vec2 uv, float image) {
    ivec2 cell = clamp(ivec2(uv * float(relief_cells)), ivec2(0), ivec2(relief_cells - 1));
    vec2 size = vec2(textureSize(decal_reliefs, 0).xy);
    float number = float((int(image) * relief_cells + cell.y) * relief_cells + cell.x);
    float columns = floor(0.5 * size.x);
    float row = floor((number + 0.5) / columns);
    float layer = floor((row + 0.5) / size.y);
    ivec3 place = ivec3(vec3(2.0 * (number - row * columns), row - layer * size.y, layer)) + ivec3(0, 0, relief_images);
    vec2 near = texelFetch(decal_reliefs, place, 0).xy;
    return relief_stretch * vec4(near, texelFetch(decal_reliefs, place + ivec3(1, 0, 0), 0).xy);
}

// Height over the surface at q: of all decals over each other, from the topmost down.
float relief_height(vec3 q, vec3 n) {
    float height = 0.0;
    float left = 1.0;
    DecalHit hit = decal_at(q, n);
    relief_slopes = slopes_beyond(0.0);
    if (hit.owner >= 0) {
        relief_slopes = vec4(0.0);
    }
    while (hit.owner >= 0 && left > 1.0 - OPAQUE) {
        float image = decal_texel(4 * hit.owner + 2).w;
        float shown = opacity_at(q, n, hit.owner);
        float radius = RIM * decal_texel(4 * hit.owner).w;
        vec4 slopes = slopes_beyond(RELIEF_STEPPED ? 0.0 : radius * max(1.0 - 2.0 * length(hit.uv - 0.5), 0.0));
        vec2 texel = vec2(0.0, 1.0);
        if (image >= 0.0) {
            texel = textureLod(decal_reliefs, vec3(hit.uv, image), 0.0).xy;
            vec4 within = slopes_within(hit.uv, image);
            slopes = texel.x < 0.0 ? slopes + within : max(slopes, within);
        }
        relief_slopes = max(relief_slopes, slopes);
        if (in_image(hit.uv)) {
            height += left * shown * radius * texel.x;
            left *= 1.0 - shown * texel.y;
        }
        if (!decal_layered) {
            break;
        }
        int below = owner_below(q, n, rank_of(hit.owner, decal_records), next_number_below(hit.owner, decal_records),
            decal_contact);
        hit = decal_hit(below, q, n);
    }
    return height;
}

// Movement over the surface per height of a direction that points away from it.
vec3 relief_slant(vec3 direction, vec3 n) {
    float slope = dot(direction, n);
    return (direction - slope * n) / max(slope, LEAST_SLOPE);
}

// Strides over the surface, each but the last ending outside. A ray moves over it by `slant` while it rises by 1, climbing
// or falling. The gap is that over the height that was looked up last.
float steps_outside(float gap, float slant, float climb, float stride) {
    if (RELIEF_STEPPED) {
        return 1.0;  // heights of decals over others may begin anywhere
    }
    vec4 rates = max(slant * relief_slopes - climb, 1e-20);
    vec4 ways = min(slant * gap / rates, cone_lengths);
    return max(ceil(max(max(ways.x, ways.y), max(ways.z, ways.w)) / max(stride, 1e-20)), 1.0);
}

// The surface point below the relief that the ray through a pixel meets; w: the height there.
vec4 relief_point(vec3 q, vec3 n, vec3 ray) {
    vec3 slant = relief_slant(-normalize(ray), n);
    float range = relief_range.y - relief_range.x;
    float steps = clamp(ceil(length(slant) * range / relief_step), 1.0, float(RELIEF_STEPS));
    float high = relief_range.y;
    float low = relief_range.x;
    float z = high;
    int halvings = 0;
    float stride = range / steps;
    float strides = 1.0;
    bool below = false;
    for (int i = 0; i <= RELIEF_STEPS + RELIEF_HALVINGS; i++) {
        if (below) {
            z = 0.5 * (low + high);
        } else {
            z = max(high - strides * stride, relief_range.x);
        }
        float gap = z - relief_height(q + z * slant, n);
        if (gap <= 0.0 || z <= relief_range.x) {
            high = min(high, z + stride);  // all strides before the last one end outside
            below = true;
            low = z;
        } else {
            high = z;
            strides = steps_outside(gap, length(slant), -1.0, length(slant) * stride);
        }
        halvings += below ? 1 : 0;
        if (halvings > RELIEF_HALVINGS) {
            break;
        }
    }
    z = 0.5 * (low + high);
    return vec4(q + z * slant, z);
}

// Normal of the relief over q, by differences.
vec3 relief_normal_at(vec3 q, vec3 n) {
    vec3 right = normalize(abs(n.x) < 0.6 ? cross(n, vec3(1.0, 0.0, 0.0)) : cross(n, vec3(0.0, 1.0, 0.0)));
    vec3 up = cross(n, right);
    float reach = 0.25 * relief_step;
    vec4 heights = vec4(0.0);
    for (int i = 0; i < 4; i++) {
        vec3 way = (i < 2 ? right : up) * (i % 2 == 0 ? reach : -reach);
        heights[i] = relief_height(q + way, n);
    }
    return normalize(2.0 * reach * n - (heights.x - heights.y) * right - (heights.z - heights.w) * up);
}

// Unit direction toward the light.
vec3 relief_light_way(vec3 q) {
    vec3 toward = relief_light.w == 0.0 ? camera_frame() * KEY_DIRECTION : relief_light.xyz;
    return normalize(relief_light.w > 1.5 ? toward - q : toward);
}

// False if a material with this normal reflects nothing of the light, so that shadows change nothing.
bool relief_faces_light(vec3 normal, vec3 q, vec3 toward_eye) {
    return dot(visible_normal(normal, toward_eye), relief_light_way(q)) > -NORMAL_ROUNDING;
}

// The part of the light that reaches the relief at height z over q, from 0 to 1.
float relief_light_at(vec3 q, float z, vec3 n) {
    vec3 slant = relief_slant(relief_light_way(q), n);
    float range = relief_range.y - relief_range.x;
    float hidden = 0.0;
    float steps = clamp(ceil(length(slant) * (relief_range.y - z) / relief_step), 1.0, float(RELIEF_STEPS));
    float i = 1.0;
    while (i < steps) {
        float rise = (relief_range.y - z) * i / steps;
        if (hidden >= min(relief_range.y - z - rise, SHADOW_EDGE * range)) {
            break;  // nothing hides more, or the shadow is full
        }
        float gap = z + rise - relief_height(q + rise * slant, n);
        hidden = max(hidden, -gap);
        i += steps_outside(gap + hidden, length(slant), 1.0, length(slant) * (relief_range.y - z) / steps);
    }
    return 1.0 - clamp(hidden / (SHADOW_EDGE * range), 0.0, 1.0);
}
