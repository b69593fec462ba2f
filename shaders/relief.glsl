// Relief of decals without triangles: parallax occlusion mapping (Tatarchuk 2006). A ray is followed over the tangent
// plane of the surface at a pixel, and heights are looked up through contact and image mapping. Lookups are bounded
// in number and, as long as they last, in length.
//@ include key_light.glsl
uniform sampler2DArray decal_reliefs;  // heights in radii, times alpha; alpha
uniform vec2 relief_range;             // lowest and highest point of the relief, in model units, the surface included
uniform float relief_step;             // greatest step along the surface
uniform vec4 relief_light;             // w = 0: the studio's key; 1: toward light at infinity; 2: where a light is

const int RELIEF_STEPS = 40;      // to the relief, or toward the light, at most
const int RELIEF_HALVINGS = 8;    // of the last step
const float SHADOW_EDGE = 0.06;   // of the range: depth below the relief at which a shadow is full
const float LEAST_SLOPE = 0.08;   // least cosine between the normal and the ray, or the light

#ifdef OFFSET
uniform sampler2DArray relief_slopes;  // by which heights rise at most from a place of image i, see offset_tree.py
uniform float relief_steepest;         // of them
uniform float relief_stretch;          // of images by contact and mapping, at most
float relief_slope;                    // from the place where a height was looked up last
#endif

// Height over the surface at q: of all decals over each other, from the topmost down.
float relief_height(vec3 q, vec3 n) {
    float height = 0.0;
    float left = 1.0;
    DecalHit hit = decal_at(q, n);
#ifdef OFFSET
    relief_slope = hit.owner < 0 ? relief_stretch * relief_steepest : 0.0;
#endif
    while (hit.owner >= 0 && left > 1.0 - OPAQUE) {
        float image = decal_texel(4 * hit.owner + 2).w;
        float shown = decal_texel(4 * hit.owner + 3).w * (decal_limited ? fade_at(q, n, hit.owner) : 1.0);
        vec2 texel = vec2(0.0, 1.0);
        if (image >= 0.0) {
            texel = textureLod(decal_reliefs, vec3(hit.uv, image), 0.0).xy;
#ifdef OFFSET
            float rim = RIM * decal_texel(4 * hit.owner).w * max(1.0 - 2.0 * length(hit.uv - 0.5), 0.0);
            float beyond = relief_range.y / (rim + relief_range.y / relief_steepest + 1e-30);  // to neighbours
            float within = textureLod(relief_slopes, vec3(hit.uv, image), 0.0).x;
            relief_slope = max(relief_slope, relief_stretch * max(within, beyond));
#endif
        }
        if (in_image(hit.uv)) {
            height += left * shown * RIM * decal_texel(4 * hit.owner).w * texel.x;
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

// The surface point below the relief that the ray through a pixel meets; w: the height there.
vec4 relief_point(vec3 q, vec3 n, vec3 ray) {
    vec3 slant = relief_slant(-normalize(ray), n);
    float range = relief_range.y - relief_range.x;
    float steps = clamp(ceil(length(slant) * range / relief_step), 1.0, float(RELIEF_STEPS));
    float high = relief_range.y;
    float low = relief_range.x;
    float z = high;
    int halvings = 0;
    bool below = false;
    for (int i = 0; i <= RELIEF_STEPS + RELIEF_HALVINGS; i++) {
        if (below) {
            z = 0.5 * (low + high);
        } else {
            z = max(high - range / steps, relief_range.x);
        }
        if (relief_height(q + z * slant, n) >= z || z <= relief_range.x) {
            below = true;
            low = z;
        } else {
            high = z;
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

// The part of the light that reaches the relief at height z over q, from 0 to 1.
float relief_light_at(vec3 q, float z, vec3 n) {
    vec3 toward = relief_light.w == 0.0 ? camera_frame() * KEY_DIRECTION : relief_light.xyz;
    toward = normalize(relief_light.w > 1.5 ? toward - q : toward);
    vec3 slant = relief_slant(toward, n);
    float range = relief_range.y - relief_range.x;
    float hidden = 0.0;
    float steps = clamp(ceil(length(slant) * (relief_range.y - z) / relief_step), 1.0, float(RELIEF_STEPS));
    for (int i = 1; i < int(steps); i++) {
        float rise = (relief_range.y - z) * float(i) / steps;
        if (hidden >= min(relief_range.y - z - rise, SHADOW_EDGE * range)) {
            break;  // nothing hides more, or the shadow is full
        }
        hidden = max(hidden, relief_height(q + rise * slant, n) - z - rise);
    }
    return 1.0 - clamp(hidden / (SHADOW_EDGE * range), 0.0, 1.0);
}
