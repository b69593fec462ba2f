// Colour of decals averaged over a pixel, from one look-up of its decals: images by their footprints through mapping
// and contact, rims, contact lines and edges of layers by the shares of the pixel on both sides of them. The formulas
// are those of decals/field/pixel_filter.py. A pixel is the parallelogram around q with the sides `right` and `up`.
//@ include decals.glsl
const bool PARTED = decal_nested && decal_contact == ELASTIC;  // small decals part the images of larger ones
const int MANY = 100;
const int MAX_BOUNDARIES = 2;  // through a pixel whose shares are computed
const int SIDE_PARTS = 4;      // parts of each side of pixels with more, if both sides are about equally long
const float MAX_SIDE = 0.15;   // of a pixel or a part of one, in visible radii
ivec2 pixel_parts = ivec2(1);  // along the sides of a listed pixel, as far as its first drawing has found them
const vec3 EVERYWHERE = vec3(1.0, 0.0, 0.0);  // line with the whole pixel on its inner side
const float MAX_TAPS = 8.0;    // look-ups of an image along one side of a pixel
const float SPACING = 0.67;   // of look-ups, relative to the shorter side
const float SHARPNESS = 0.6;   // texels of a look-up relative to the distance between look-ups

// A branch, as a loop: some drivers run the body of an `if` even where no pixel needs it.
#define WHERE(condition) for (bool needed_ = condition; needed_; needed_ = false)

struct Place {
    vec2 uv;
    vec2 uv_right;
    vec2 uv_up;
    vec3 arc;  // length along the surface from the centre, and its changes, in visible radii
};

// The rim of a decal as a line through the pixel.
vec3 rim_line(vec3 arc, vec3 right, vec3 up) {
    float bend = dot(right, right) + dot(up, up) - dot(arc.yz, arc.yz);  // a circle's distance from its tangent
    return pixel_line(1.0 - arc.x - max(bend, 0.0) / (24.0 * max(arc.x, 0.25)), -arc.yz);
}

// The same for the chord, of a decal by its ball.
vec3 ball_line(vec3 q, vec3 right, vec3 up, vec4 ball) {
    vec3 w = (q - ball.xyz) / (RIM * ball.w);
    float chord = max(length(w), 1e-6);
    float scale = 1.0 / (RIM * ball.w);
    return rim_line(vec3(chord, vec2(dot(w, right), dot(w, up)) * (scale / chord)), scale * right, scale * up);
}

// The contact line of a decal with another one.
vec3 contact_line(vec3 q, vec3 right, vec3 up, vec4 ball, vec4 other) {
    vec3 a = q - ball.xyz, b = q - other.xyz;
    float value;
    vec3 slope;
    if (has_cells(decal_contact)) {
        value = dot(b - a, b + a) + RIM * RIM * (ball.w - other.w) * (ball.w + other.w);
        slope = 2.0 * (b - a);
    } else {
        value = dot(b, b) / (other.w * other.w) - dot(a, a) / (ball.w * ball.w);
        slope = 2.0 * (b / (other.w * other.w) - a / (ball.w * ball.w));
    }
    return pixel_line(value, vec2(dot(slope, right), dot(slope, up)));
}

// Elastic contact: z² of a neighbour, after its gradient by w, which is relative to the centre, in visible radii.
vec4 push_of(vec3 w, vec4 ball, vec4 other) {
    return push_gradient(w, other.xyz - ball.xyz, RIM * ball.w, RIM * other.w, decal_stiffness);
}

// Where a point lies in a decal's image. `pushes`: in elastic contact the sum of those of all neighbours; in other modes
// its last number is the distance after contact.
Place place_of(int decal, vec4 ball, vec3 q, vec3 n, vec3 right, vec3 up, vec4 pushes) {
    float per_radius = 1.0 / (RIM * ball.w);
    vec3 w = per_radius * (q - ball.xyz);
    vec3 x = per_radius * right, y = per_radius * up;
    float chord = length(w);
    vec2 chords = vec2(dot(w, x), dot(w, y)) / max(chord, 1e-6);
    vec3 rim = vec3(pushes.w, chords);
    if (decal_contact == ELASTIC) {
        rim = pushed_steps(chord, chords, vec3(pushes.w, dot(pushes.xyz, x), dot(pushes.xyz, y)));
    }
    Place place;
    image_steps(w, x, y, decal_texel(4 * decal + 1).xyz, n, decal_texel(4 * decal + 2).xyz, rim, decal_mapping, place.uv,
        place.uv_right, place.uv_up, place.arc);
    return place;
}

// Bumps of nested decals at a point, and at its neighbours to the right and above.
struct Bumps {
    vec4 here;
    vec4 right;
    vec4 up;
};

void add_bump(inout Bumps bumps, vec3 q, vec3 n, vec3 right, vec3 up, vec4 ball, vec4 other_ball, int other) {
    bumps.here = join_bumps(bumps.here, bump_at(q, n, ball, other_ball, other));
    bumps.right = join_bumps(bumps.right, bump_at(q + right, n, ball, other_ball, other));
    bumps.up = join_bumps(bumps.up, bump_at(q + up, n, ball, other_ball, other));
}

vec2 parted_uv(vec2 uv, vec4 bump, vec3 n, int decal) {
    vec2 from_centre = uv - 0.5;
    return uv + max(0.5 - 2.0 * dot(from_centre, from_centre), 0.0) * image_shift(bump, n, decal);
}

// The place in an image that nested decals part.
void part_image(inout Place place, Bumps bumps, vec3 n, int decal) {
    vec2 uv = parted_uv(place.uv, bumps.here, n, decal);
    place.uv_right = parted_uv(place.uv + place.uv_right, bumps.right, n, decal) - uv;
    place.uv_up = parted_uv(place.uv + place.uv_up, bumps.up, n, decal) - uv;
    place.uv = uv;
}

#ifdef MATERIALS
// Sums of decals.glsl.
struct Maps {
    vec4 normals;
    vec2 values;
    vec4 glow;
};

Maps material_sums() {
    return Maps(material_normals, material_values, material_glow);
}
#endif

// Premultiplied linear colour of a decal around a place, of which a part of the pixel is seen. Where the image has more than one texel a pixel, several
// look-ups along each side, more along the longer one, form a box.
vec4 image_average(int decal, Place place, vec3 q, vec3 n, float part) {
    float shown = opacity_at(q, n, decal);
    vec4 u = decal_texel(4 * decal + 2);
    vec4 tint = decal_texel(4 * decal + 3);
    vec4 color = vec4(1.0);
    if (u.w >= 0.0) {
        vec2 texels = vec2(textureSize(decal_images, 0).xy);
        vec2 sides = vec2(length(texels * place.uv_right), length(texels * place.uv_up));
        float cell = SPACING * max(min(sides.x, sides.y), 1.0);
        vec2 taps = clamp(floor(sides / cell + 0.7), 1.0, MAX_TAPS);
        vec2 right = place.uv_right / taps.x, up = place.uv_up / taps.y;
        float texel = SHARPNESS * max(sides.x / taps.x, sides.y / taps.y);
        float level = max(round(log2(max(texel, 1e-6))), 0.0);  // whole: some drivers then read one level only
        vec2 uv = place.uv - 0.5 * ((taps.x - 1.0) * right + (taps.y - 1.0) * up);
        color = vec4(0.0);
        float column = 0.0;
#ifdef MATERIALS
        vec4 maps = vec4(0.0), glow = vec4(0.0);
        float squares = 0.0;  // of tilts
#endif
        for (float left = taps.x * taps.y; left > 0.0; left -= 1.0) {
            vec4 tap = textureLod(decal_images, vec3(uv, u.w), level);
            color += tap;
#ifdef MATERIALS
            vec4 map_tap = textureLod(decal_materials, vec3(uv, 2.0 * u.w), level);
            maps += map_tap;
            glow += textureLod(decal_materials, vec3(uv, 2.0 * u.w + 1.0), level);
            squares += dot(map_tap.xy, map_tap.xy) / max(tap.a, 1e-4);
#endif
            column += 1.0;
            uv += column == taps.x ? up - (taps.x - 1.0) * right : right;
            column = column == taps.x ? 0.0 : column;
        }
        color /= taps.x * taps.y;
#ifdef MATERIALS
        maps /= taps.x * taps.y;
        if (maps.z > 0.0 && color.a > 0.0) {
            // Normals that differ within a pixel spread highlights as roughness does: alpha^2 grows by their variance.
            vec2 tilt = maps.xy / color.a;
            float variance = max(squares / (color.a * taps.x * taps.y) - dot(tilt, tilt), 0.0);
            float rough = maps.z / color.a;
            maps.z = color.a * min(pow(rough * rough * rough * rough + variance, 0.25), 1.0);
            add_maps(maps, glow / (taps.x * taps.y), color.a, material_left * part * shown, n,
                decal_texel(4 * decal + 1).xyz, u.xyz);
        }
#endif
    }
    return shown * color * vec4(tint.rgb, 1.0);
}

// `pushes` of a decal across a contact line; of the nearest two neighbours, for others are farther.
vec4 contact_with(vec4 ball, ivec2 others, vec3 q) {
    vec3 w = (q - ball.xyz) / (RIM * ball.w);
    if (decal_contact != ELASTIC) {
        return vec4(0.0, 0.0, 0.0, others.x < 0 ? min(length(w), 1.0) : 1.0);
    }
    vec4 pushes = vec4(0.0);
    for (int i = 0; i < 2 && others.x >= 0; i++) {
        pushes += push_of(w, ball, decal_texel(4 * others.x));
        others = ivec2(others.y, -1);
    }
    return pushes;
}

// Centre of what is left of a pixel under a part of it, in sides.
vec2 centre_under(vec2 centre, float alpha, vec2 part) {
    return clamp((centre - alpha * part) / max(1.0 - alpha, 1e-4), -0.5, 0.5);
}

// Premultiplied colour of the decals of one layer that share the pixel, with their owner at q. `boundaries` counts the
// rims and contact lines through the pixel, and is MANY where nested decals or several layers make others than these.
// `centre` is that of what upper layers leave of the pixel, then of what these decals leave.
vec4 layer_average(int owner, vec3 q, vec3 n, vec3 right, vec3 up, inout vec2 centre, out int boundaries) {
    vec4 ball = decal_texel(4 * owner);
    float per_radius = 1.0 / (RIM * ball.w);
    vec3 w = per_radius * (q - ball.xyz);
    int rank = decal_layered ? rank_of(owner, decal_records) : 0;
    bool touches = !decal_layered || is_contact_rank(rank);
    vec4 pushes = vec4(0.0);
    Bumps bumps = Bumps(vec4(0.0), vec4(0.0), vec4(0.0));
    ivec2 beside = ivec2(-1);
    vec3 first_line = EVERYWHERE, second_line = EVERYWHERE;  // contact lines with `beside`
    int above = -1, below = -1, rival = -1, nested_count = 0, lower_rims = 0;
    float least = 0.0;  // power of `rival`, the strongest neighbour
    bool above_nested = false;
    vec3 above_line = -0.5 * EVERYWHERE;
    float half_pixel = 0.5 * (length(right) + length(up));
    boundaries = 0;
    for (int level = 0; level < index_level_count; level++) {
        ivec2 span = cell_range(q, level);
        for (int j = span.x; j < span.y; j++) {
            int other = texelFetch(index_ids, ivec2(j & 4095, j >> 12), 0).x;
            vec4 other_ball = decal_texel(4 * other);
            vec3 offset = q - other_ball.xyz;
            float reach = max(REACH * other_ball.w, RIM * other_ball.w + half_pixel);
            if (other == owner || dot(offset, offset) >= reach * reach || !acts(offset, n, other)) {
                continue;
            }
            float other_power = power(offset, RIM * other_ball.w);
            bool outside = other_power > 0.0;
            int other_rank = decal_layered ? rank_of(other, decal_records) : 0;
            bool together = touches && other_rank == rank;
            bool nested = decal_nested && together
                && balls_nested(other_ball.xyz - ball.xyz, RIM * ball.w, RIM * other_ball.w);
            if (!together || nested) {
                bool higher = nested ? is_above(other, owner, decal_records) && lies_on_top(n, other, decal_records)
                                     : other_rank > rank || (other_rank == rank && other > owner);
                nested_count += nested ? 1 : 0;
                if (PARTED && nested) {
                    add_bump(bumps, q, n, right, up, ball, other_ball, other);
                }
                vec3 line = ball_line(q, right, up, other_ball);
                lower_rims += !higher && abs(line.x) < 0.5 ? 1 : 0;
                if (higher && (nested || outside)) {
                    boundaries += line.x > -0.5 ? 1 : 0;
                    above_nested = line.x > above_line.x ? nested : above_nested;
                    above = line.x > above_line.x ? other : above;
                    above_line.x = max(line.x, above_line.x);
                } else if (nested && !outside) {
                    below = other;
                }
                continue;
            }
            rival = other_power < least ? other : rival;
            least = min(other_power, least);
            if (decal_contact == ELASTIC) {
                pushes += push_of(w, ball, other_ball);
            }
            vec3 line = contact_line(q, right, up, ball, other_ball);
            if (line.x < 0.5) {
                bool corner = decal_nested && ball_line(q, right, up, other_ball).x < 0.5;
                boundaries += corner || half_pixel > MAX_SIDE * RIM * other_ball.w ? MANY : 1;
            }
            if (line.x < min(first_line.x, 0.5)) {
                second_line = first_line;
                first_line = line;
                beside = ivec2(other, beside.x);
            } else if (line.x < min(second_line.x, 0.5)) {
                second_line = line;
                beside.y = other;
            }
        }
    }
    WHERE (above >= 0) {  // its image may end before its ball
        vec4 above_ball = decal_texel(4 * above);
        float per_above = 1.0 / (RIM * above_ball.w);
        Place place = place_of(above, above_ball, q, n, right, up, vec4(0.0));
        above_line = rim_line(place.arc, per_above * right, per_above * up);
        bool ends = above_line.x <= -0.5;
        WHERE (above_nested && rival >= 0) {
            vec4 rival_ball = decal_texel(4 * rival);
            if (!balls_nested(rival_ball.xyz - above_ball.xyz, RIM * above_ball.w, RIM * rival_ball.w)) {
                float inside = contact_line(q, right, up, above_ball, rival_ball).x;
                ends = ends || inside <= -0.5;
                boundaries += abs(inside) < 0.5 ? MANY : 0;
            }
        }
        bool cut = place.arc.x <= 1.0 && power(q - above_ball.xyz, RIM * above_ball.w) <= 0.0;  // by other decals
        boundaries -= ends ? 1 : 0;
        above = ends || cut ? -1 : above;
    }
    if (decal_contact != ELASTIC) {
        pushes.w = contact_distance(contact_at(q, n, owner, decal_contact).x);
    }
    // The one above, the owner, and those beside it or the one below in turn; in one loop, because some drivers run
    // code once even where no pixel needs it.
    vec3 owner_part = vec3(1.0, 0.0, 0.0);
    vec4 over = vec4(0.0), color = vec4(0.0);
    float hidden = 0.0;  // by the one above: if that is nested, its transparent parts hide the others as well
    vec2 covered = vec2(0.0);  // sum of the centres of parts, times alpha
    ivec2 others = beside;
    for (int decal = above < 0 ? owner : above; decal >= 0;) {
        bool first = decal == owner, across = decal == beside.x || decal == beside.y;
        vec4 own_ball = decal_texel(4 * decal);
        vec3 part = vec3(1.0, 0.0, 0.0);
        ivec2 neighbours = ivec2(-1);
        WHERE (!first) {
            vec3 line = EVERYWHERE, other_line = EVERYWHERE;
            vec3 rim = decal == above ? above_line : ball_line(q, right, up, own_ball);
            if (across) {
                int third = decal == beside.x ? beside.y : beside.x;
                neighbours = ivec2(owner, third);
                line = contact_line(q, right, up, own_ball, ball);
                if (third >= 0) {
                    other_line = contact_line(q, right, up, own_ball, decal_texel(4 * third));
                }
            }
            part = inner_part(rim, line, other_line);
        }
        vec3 at = first ? q : q + part.y * right + part.z * up;
        vec4 contact = first ? pushes : contact_with(own_ball, neighbours, at);
        Place place = place_of(decal, own_ball, at, n, right, up, contact);
        if (PARTED) {
            Bumps own_bumps = bumps;
            if (!first) {
                own_bumps = Bumps(vec4(0.0), vec4(0.0), vec4(0.0));
                if (decal == below) {
                    add_bump(own_bumps, at, n, right, up, own_ball, ball, owner);
                }
            }
            if (own_bumps.here.w > 0.0) {
                part_image(place, own_bumps, n, decal);
            }
        }
        WHERE (first) {
            vec3 rim = rim_line(place.arc, per_radius * right, per_radius * up);
            boundaries += rim.x < 0.5 ? (lower_rims > 0 ? MANY : 1) : 0;
            boundaries += (above >= 0 && boundaries > 1) || (below >= 0 && beside.x >= 0) ? MANY : 0;
            part.yz = centre;
            if (boundaries > (above < 0 ? 0 : 1)) {
                part = inner_part(rim, first_line, second_line);
            }
            place.uv += part.y * place.uv_right + part.z * place.uv_up;
            owner_part = part;
            if (below >= 0) {  // the owner lies on it
                others = ivec2(part.x < 1.0 ? below : -1, -1);
            }
        }
        if (!first && decal != above && !across) {
            part.x = min(part.x, 1.0 - owner_part.x);
        }
        vec4 own_color = part.x * image_average(decal, place, at, n, part.x);
        if (decal == above) {
            over = own_color;
            hidden = above_nested ? part.x : over.a;
#ifdef MATERIALS
            material_left *= 1.0 - hidden;
#endif
            centre = centre_under(centre, hidden, part.yz);
            decal = owner;
            continue;
        }
        color += own_color;
        covered += own_color.a * part.yz;
        decal = others.x;
        others = ivec2(others.y, -1);
    }
    centre = centre_under(centre, color.a, covered / max(color.a, 1e-4));
    boundaries += boundaries > 0 && nested_count > 0 && nested_count + boundaries > 2 ? MANY : 0;
    return over + (1.0 - hidden) * color;
}

// The decal with the largest part of a pixel whose centre no decal covers, or -1.
int nearest_rim(vec3 q, vec3 n, vec3 right, vec3 up) {
    int nearest = -1;
    float largest = -0.5;
    for (int level = 0; level < index_level_count; level++) {
        ivec2 span = cell_range(q, level);
        for (int j = span.x; j < span.y; j++) {
            int decal = texelFetch(index_ids, ivec2(j & 4095, j >> 12), 0).x;
            vec4 ball = decal_texel(4 * decal);
            float inside = ball_line(q, right, up, ball).x;
            if (inside > largest && acts(q - ball.xyz, n, decal)) {
                nearest = decal;
                largest = inside;
            }
        }
    }
    return nearest;
}

// Middle of part number `i` of a pixel in `parts`, in sides of the pixel from its own middle.
vec2 part_middle(int i, ivec2 parts) {
    return (vec2(float(i % parts.x), float(i / parts.x)) + 0.5) / vec2(parts) - 0.5;
}

// The owner of a pixel or a part of one; the decal with the largest share where none covers the middle.
int part_owner(vec3 q, vec3 n, vec3 right, vec3 up) {
    int owner = decal_single_layer ? int(single_layer_at(q, n, decal_contact).x) : owner_at(q, n, decal_contact);
    WHERE (owner < 0) {
        owner = nearest_rim(q, n, right, up);
    }
    return owner;
}

// Parts along both sides of a pixel, so that none of them is long beside the owner.
ivec2 parts_beside(int owner, vec3 right, vec3 up) {
    float longest = MAX_SIDE * RIM * decal_texel(4 * owner).w;
    return ivec2(clamp(ceil(vec2(length(right), length(up)) / longest), 1.0, float(SIDE_PARTS)));
}

// Parts of a pixel with many boundaries: SIDE_PARTS², in shape close to squares.
ivec2 parts_at_boundaries(vec3 right, vec3 up) {
    float ratio = length(up) / max(length(right), 1e-30);
    int across = ratio > 2.0 ? SIDE_PARTS / 2 : ratio < 0.5 ? 2 * SIDE_PARTS : SIDE_PARTS;
    return ivec2(across, SIDE_PARTS * SIDE_PARTS / across);
}

// Premultiplied linear colour of the owner and the decals below it, averaged over a pixel or a part of one. `share` is
// that of the part, `boundaries` those through it.
vec4 layers_average(int owner, vec3 q, vec3 n, vec3 right, vec3 up, float share, out int boundaries) {
    vec4 color = vec4(0.0);
    vec2 centre = vec2(0.0);
    boundaries = 0;
    while (owner >= 0 && color.a < OPAQUE) {
        int more;
#ifdef MATERIALS
        material_left = (1.0 - color.a) * share;
#endif
        color += (1.0 - color.a) * layer_average(owner, q, n, right, up, centre, more);
        boundaries = boundaries > 0 && more > 0 ? MANY : boundaries + more;
        if (!decal_layered) {
            break;
        }
        vec3 left = q + centre.x * right + centre.y * up;  // upper decals may cover q alone
        owner = owner_below(left, n, rank_of(owner, decal_records), next_number_below(owner, decal_records),
            decal_contact);
    }
    return color;
}

// Premultiplied linear colour of part number `i` of a pixel in `parts`. A whole pixel with many boundaries, or with sides
// that are long beside its owner, sets `parts` instead.
vec4 part_color(Surface surface, int i, inout ivec2 parts) {
    vec3 right = surface.right / float(parts.x), up = surface.up / float(parts.y);
    vec2 at = part_middle(i, parts);
    vec3 q = surface.position + at.x * surface.right + at.y * surface.up;
    float share = 1.0 / float(parts.x * parts.y);
    bool whole = parts == ivec2(1);
    int owner = part_owner(q, surface.normal, right, up);
    if (whole && owner >= 0) {
        parts = parts_beside(owner, right, up);
        owner = parts == ivec2(1) || decal_layered ? owner : -1;  // parts of layers may need more
    }
    int boundaries;
    vec4 color = layers_average(owner, q, surface.normal, right, up, share, boundaries);
    if (whole && boundaries > MAX_BOUNDARIES) {
        parts = parts_at_boundaries(surface.right, surface.up);
    }
    return color;
}

#ifndef SHARED
// Premultiplied linear colour of all decals over each other, averaged over a pixel, which may be divided.
vec4 exact_color(Surface surface) {
    vec4 sum = vec4(0.0);
    ivec2 parts = ivec2(1);
#ifdef MATERIALS
    clear_materials();
#endif
    for (int i = 0; i < parts.x * parts.y; i++) {
        ivec2 before = parts;
        vec4 color = part_color(surface, i, parts);
        if (parts != before) {
            i = -1;
#ifdef MATERIALS
            clear_materials();
#endif
            continue;
        }
        sum += color;
    }
    return sum / float(parts.x * parts.y);
}
#endif

#ifdef MARKED
// True after `inner_color` of pixels that need `exact_color`: those through which a rim or contact line may go, and those
// with long sides.
bool pixel_divided = false;

// Premultiplied linear colour of a pixel that lies inside one decal or on bare surface. One traversal keeps all
// candidates.
vec4 inner_color(vec3 q, vec3 n, vec3 right, vec3 up) {
    const int KEPT = 8;  // in the components of `a` and `b`
    int owner = -1, count = 0;
    float least = 0.0, margin = 0.5 * (length(right) + length(up));
    ivec4 a = ivec4(-1), b = ivec4(-1);
    for (int level = 0; level < index_level_count; level++) {
        ivec2 span = cell_range(q, level);
        for (int j = span.x; j < span.y; j++) {
            int decal = texelFetch(index_ids, ivec2(j & 4095, j >> 12), 0).x;
            vec4 ball = decal_texel(4 * decal);
            vec3 offset = q - ball.xyz;
            float squared = dot(offset, offset);
            float reach = max(REACH * ball.w, RIM * ball.w + margin);
            if (squared < reach * reach && acts(offset, n, decal)) {
                b = ivec4(a.w, b.xyz);
                a = ivec4(decal, a.xyz);
                count++;
                float own = squared - RIM * RIM * ball.w * ball.w;
                own /= has_cells(decal_contact) ? 1.0 : ball.w * ball.w;
                owner = own < least ? decal : owner;
                least = min(own, least);
            }
        }
    }
    pixel_divided = count > (owner < 0 ? 0 : KEPT);
    if (owner < 0) {
        return vec4(0.0);
    }
    vec4 ball = decal_texel(4 * owner);
    float radius = RIM * ball.w;
    vec3 w = (q - ball.xyz) / radius;
    vec4 pushes = vec4(0.0);
    bool nested = count > KEPT;  // or not known: another decal may be the owner
    for (int i = min(count, KEPT); i > 0; i--) {
        int other = a.x;
        a = ivec4(a.yzw, b.x);
        b = ivec4(b.yzw, -1);
        if (other != owner) {
            vec4 other_ball = decal_texel(4 * other);
            pixel_divided = pixel_divided || contact_line(q, right, up, ball, other_ball).x < 0.5;
            nested = nested || (decal_nested && balls_nested(other_ball.xyz - ball.xyz, radius, RIM * other_ball.w));
            pushes += push_of(w, ball, other_ball);
        }
    }
    if (decal_contact != ELASTIC) {
        pushes.w = contact_distance(contact_at(q, n, owner, decal_contact).x);
    }
    Place place = place_of(owner, ball, q, n, right, up, pushes);
    pixel_parts = nested ? ivec2(1) : parts_beside(owner, right, up);
    pixel_divided = pixel_divided || nested || pixel_parts != ivec2(1)
        || rim_line(place.arc, right / radius, up / radius).x < 0.5;
    return image_average(owner, place, q, n, 1.0);
}
#endif

#ifndef SHARED
// The colour of a pixel. MARKED: by the quicker way, where it is enough.
vec4 filtered_color(Surface surface) {
#ifdef MARKED
#ifdef MATERIALS
    material_left = 1.0;
    clear_materials();
#endif
    pixel_divided = decal_layered;
    return decal_layered ? vec4(0.0) : inner_color(surface.position, surface.normal, surface.right, surface.up);
#else
    return exact_color(surface);
#endif
}
#endif
