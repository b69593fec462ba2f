"""Elastic contact: images are compressed towards contact lines, along rays from their centres. None folds.

Owners, cells and nested decals are those of radial contact (`decals.field.radial`). Lengths are in visible
radii of the owner. On a ray from its centre, t is the distance of a point, and R_j < 1 the distance of the
radical plane of neighbour j. Alone, this neighbour moves the image outward by

    δ_j = (1 − R_j) x_j^P,   x_j = max(1 − (1 − t/R_j)/y_j, 0),   P = stiffness + ROUNDING/(1 − R_j).

So the rim of the image lies on the plane, the slope along the ray is at least 1, and nothing moves nearer to
the centre than (1 − y_j) R_j. With the width y_j (`push_width`), every point that a neighbour moves lies in
its reach: the candidates of the point itself suffice. Several neighbours act together as

    r = t + (1 − t) Z/(1 + Z),   Z = √(Σ z_j²),   z_j = δ_j/(1 − t − δ_j).

For one neighbour that is t + δ_j. r is 1 on the rim and on every plane, and nowhere else. Inside the cell it
is smooth, also between rays to both sides of a corner, where planes meet each other or the rim. With m planes
on a ray the slope is at least 1/√m, so no image folds, whatever the sizes.

A smaller decal i that is nested with the owner parts its image, as a stone parts grass. At q = p_i + w, with
d = |w|/ρ_i and b = ρ_i in radii of the owner, the point of the image moves towards p_i by the gradient of

    s_i = A b² u³/10,   u = (1 − d²/1.6)/(1 − 1/1.6),   A = PARTING (1 − b²),

a bump that ends where i stops to reach; inside its rim, a paraboloid continues it. On that rim the image
moves by A ρ_i, so only what lies within (1 − A) ρ_i of the centre stays hidden. Several bumps join to
S = (Σ s_i⁶)^⅙. As S curves by at most PARTING·k^⅙ < 1 for k < 540 of them, the map is the gradient of a
convex function and does not fold. The displacement is multiplied by 1 − r²: rims and contact lines stay.
With pushes of planes, its smallness prevents folds: tests and benchmark find none.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.image_place import image_reaches
from decals.field.mapping import tangent_coordinates, unroll_step
from decals.field.radial import (
    NO_OWNER,
    RIM_SQUARED,
    comes_next,
    is_above,
    lies_on_top,
    nested_owner,
    power,
    size_above,
)
from decals.field.receivers import acts, complement_of
from decals.index.lookup import IndexedDecals, cell_range, rank_range
from decals.record import (
    NO_FIELD,
    REACH_SQUARED,
    RECORD,
    RIM_RADIUS,
    apart,
    balls_nested,
    field_complement,
    rank_of,
    visible_radius,
    xyz,
)

wp.set_module_options({"enable_backward": False})

ROUNDING = 0.1
"""Part of the exponent that makes the push of a plane fade in smoothly where the plane enters the rim."""

REACH_MARGIN = 0.6
"""A little less than REACH_SQUARED/RIM_SQUARED − 1 = 0.6027, by which the squared reach exceeds the rim's."""

MIN_SPARE = 1.0e-6
"""Smallest divisor 1 − R; larger exponents would not be finite."""

MIN_REMAINDER = 1.0e-12
"""Smallest divisor 1 − t − δ, which is 0 on contact lines; z² stays finite."""

MIN_DISTANCE = 1.0e-30
"""Smallest divisor of the direction of a ray."""

PARTING = 0.35
"""Share of its way by which the image moves on the rim of a much smaller nested decal, towards its centre."""

RIM_BUMP = 0.375
"""Height 1 − d²/(1 + REACH_MARGIN) of a bump's base on the rim, d = 1."""

MAX_KEPT = 8
"""Number of decals or complements that are kept. Where more act, the index is traversed a second time."""


# -- geometry of two balls ------------------------------------------------------------------------------


@wp.func
def push_width(squared: wp.float32, radius: wp.float32, other: wp.float32) -> wp.float32:
    """Return the part y of the way to its plane on which a neighbour pushes, from 0 to 1.

    `squared` is the squared distance D² of the centres. On every ray that meets the plane before the rim, the
    squared distance to the neighbour at the share 1 − y of the way is at most
    ρ_j² + y (D² − ρ_j² − (1 − y) ρ²). This is (1 + REACH_MARGIN) ρ_j², which the neighbour reaches.
    """
    gap = squared - other * other - radius * radius
    margin = 2.0 * REACH_MARGIN * other * other
    return wp.min(margin / (gap + wp.sqrt(gap * gap + 2.0 * margin * radius * radius)), 1.0)


@wp.func
def plane_push(
    ray: wp.vec3,
    distance: wp.float32,
    apart: wp.vec3,
    radius: wp.float32,
    other: wp.float32,
    stiffness: wp.float32,
) -> wp.float32:
    """Return the push δ of one neighbour at a distance in visible radii on a unit ray; 0 for none."""
    squared = wp.dot(apart, apart)
    between = squared + (radius - other) * (radius + other)
    ahead = 2.0 * radius * wp.dot(ray, apart)
    if between >= ahead:  # the ray meets the rim before the plane
        return 0.0
    end = between / ahead
    x = 1.0 - (1.0 - distance / end) / push_width(squared, radius, other)
    if x <= 0.0 or between <= 0.0:
        return 0.0
    if balls_nested(apart, radius, other):
        return 0.0
    spare = 1.0 - end
    return spare * wp.pow(wp.min(x, 1.0), stiffness + ROUNDING / wp.max(spare, MIN_SPARE))


@wp.func
def square_of_push(distance: wp.float32, push: wp.float32) -> wp.float32:
    """Return z² of a push δ, which adds to those of other neighbours."""
    z = push / wp.max(1.0 - distance - push, MIN_REMAINDER)
    return z * z


@wp.func
def pushed_distance(distance: wp.float32, squares: wp.float32) -> wp.float32:
    """Return r at a distance in visible radii, under the sum of squares of all pushes z."""
    z = wp.sqrt(squares)
    if z > 1.0:  # exact towards contact lines
        return 1.0 - (1.0 - distance) / (1.0 + z)
    return distance + (1.0 - distance) * (z / (1.0 + z))


@wp.func
def pushed_along_ray(distance: wp.float32, squares: wp.float32) -> wp.float32:
    """Return E = 1 − F at a distance in visible radii, under the sum of squares of all pushes z."""
    r = pushed_distance(distance, squares)
    return field_complement(r * r * RIM_SQUARED)


@wp.func
def bump_of(w: wp.vec3, radius: wp.float32, other: wp.float32) -> wp.vec4:
    """Return gradient and height of the bump of a smaller nested decal, at w from its centre; 0 out of reach.

    Lengths are in radii of the owner, so the gradient is the displacement of the image.
    """
    share = other / radius
    squared = wp.dot(w, w) / (other * other)
    amount = PARTING * (1.0 - share * share)
    if squared < 1.0:
        gradient = -(amount / radius) * w
        return wp.vec4(gradient[0], gradient[1], gradient[2], amount * share * share * (0.6 - 0.5 * squared))
    u = wp.max(1.0 - squared / (1.0 + REACH_MARGIN), 0.0) / RIM_BUMP
    outer = -(amount * u * u / radius) * w
    return wp.vec4(outer[0], outer[1], outer[2], 0.1 * amount * share * share * u * u * u)


@wp.func
def join_bumps(first: wp.vec4, second: wp.vec4) -> wp.vec4:
    """Return gradient and height of (s⁶ + t⁶)^⅙ for two bumps; the second may be 0."""
    if second[3] <= 0.0:
        return first
    largest = wp.max(first[3], second[3])
    a = first[3] / largest
    b = second[3] / largest
    a2 = a * a
    b2 = b * b
    a5 = a2 * a2 * a
    b5 = b2 * b2 * b
    joined = wp.pow(a5 * a + b5 * b, 1.0 / 6.0)
    per5 = wp.pow(joined, -5.0)
    result = (a5 * per5) * first + (b5 * per5) * second
    return wp.vec4(result[0], result[1], result[2], largest * joined)


# -- the same of decals ---------------------------------------------------------------------------------


@wp.func
def bump_at(
    q: wp.vec3, n_q: wp.vec3, own_ball: wp.vec4, ball: wp.vec4, decal: wp.int32, index: IndexedDecals
) -> wp.vec4:
    """Return gradient and height at q of the bump of a decal under its owner's image; 0 for none."""
    if ball[3] < own_ball[3]:
        radius = RIM_RADIUS * own_ball[3]
        other = RIM_RADIUS * ball[3]
        if balls_nested(xyz(ball) - xyz(own_ball), radius, other):
            if lies_on_top(n_q, decal, index.records):
                return bump_of(q - xyz(ball), radius, other)
    return wp.vec4(0.0, 0.0, 0.0, 0.0)


@wp.func
def image_shift(bump: wp.vec4, n_q: wp.vec3, owner: wp.int32, index: IndexedDecals) -> wp.vec2:
    """Return the displacement that a bump causes in the owner's image, in its radii."""
    if bump[3] <= 0.0:
        return wp.vec2(0.0, 0.0)
    normal = xyz(index.records[RECORD * owner + 1])
    step = wp.vec3(bump[0], bump[1], bump[2])
    along = unroll_step(step - wp.dot(step, n_q) * n_q, normal, n_q)
    return tangent_coordinates(along, normal, xyz(index.records[RECORD * owner + 2]))


@wp.func
def sum_of_pushes(
    q: wp.vec3, n_q: wp.vec3, owner: wp.int32, ray: wp.vec3, distance: wp.float32, index: IndexedDecals
) -> wp.vec3:
    """Return (Σ z², shift) of all neighbours of a contact decal, in a traversal of the index."""
    rank = wp.int32(0)
    if index.layered:
        rank = rank_of(owner, index.records)
    radius = visible_radius(owner, index.records)
    squares = wp.float32(0.0)
    bump = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for level in range(index.level_count):
        span = rank_range(q, rank, level, index)
        for j in range(span[0], span[1]):
            if index.ids[j] != owner and complement_of(q, n_q, index.ids[j], index) < NO_FIELD:
                push = plane_push(
                    ray,
                    distance,
                    apart(owner, index.ids[j], index.records),
                    radius,
                    visible_radius(index.ids[j], index.records),
                    index.stiffness,
                )
                if push > 0.0:
                    squares += square_of_push(distance, push)
                if index.nested:
                    own_ball = index.records[RECORD * owner]
                    ball = index.records[RECORD * index.ids[j]]
                    bump = join_bumps(bump, bump_at(q, n_q, own_ball, ball, index.ids[j], index))
    shift = wp.vec2(0.0, 0.0)
    if index.nested:
        shift = image_shift(bump, n_q, owner, index)
    return wp.vec3(squares, shift[0], shift[1])


@wp.func
def elastic_contact(q: wp.vec3, n_q: wp.vec3, owner: wp.int32, index: IndexedDecals) -> wp.vec3:
    """Return (E, shift) of a contact decal at q, compressed along its ray and parted by all neighbours."""
    w = (q - xyz(index.records[RECORD * owner])) / visible_radius(owner, index.records)
    distance = wp.length(w)
    ray = w / wp.max(distance, MIN_DISTANCE)
    sums = sum_of_pushes(q, n_q, owner, ray, distance, index)
    return wp.vec3(pushed_along_ray(wp.min(distance, 1.0), sums[0]), sums[1], sums[2])


@wp.func
def kept_owner(
    q: wp.vec3,
    n_q: wp.vec3,
    first: wp.vec4i,
    last: wp.vec4i,
    closest: wp.int32,
    index: IndexedDecals,
) -> wp.int32:
    """Return the topmost decal of `decals.field.radial.nested_owner`, given all candidates at q."""
    a = first
    b = last
    closest_ball = index.records[RECORD * closest]
    tried = wp.int32(closest)
    while True:
        tried_ball = index.records[RECORD * tried]
        radius = RIM_RADIUS * tried_ball[3]
        own = power(q - xyz(tried_ball), radius)
        inside = bool(tried != closest)
        if inside:
            inside = lies_on_top(n_q, tried, index.records)
        lower = wp.int32(NO_OWNER)
        lower_size = wp.float32(0.0)
        for _kept in range(MAX_KEPT):
            decal = a[0]
            a = wp.vec4i(a[1], a[2], a[3], b[0])
            b = wp.vec4i(b[1], b[2], b[3], decal)
            if decal >= 0 and decal != tried:
                ball = index.records[RECORD * decal]
                offset = q - xyz(ball)
                if field_complement(wp.dot(offset, offset) / (ball[3] * ball[3])) <= 0.5:
                    if inside and power(offset, RIM_RADIUS * ball[3]) < own:
                        inside = balls_nested(xyz(ball) - xyz(tried_ball), radius, RIM_RADIUS * ball[3])
                    if comes_next(
                        ball, decal, lower_size, lower, tried_ball[3], tried, closest_ball, closest
                    ):
                        lower = decal
                        lower_size = ball[3]
        if inside:
            return tried
        if lower < 0:
            return closest
        tried = lower
    return closest


@wp.func
def single_layer_elastic(q: wp.vec3, n_q: wp.vec3, index: IndexedDecals) -> wp.vec4:
    """Return (owner, E, shift) at q; (NO_OWNER, 0) outside all rims. The decals must not be layered.

    They are those of `cell_owner` and `elastic_contact`. One traversal of the index finds the candidates,
    and of the holders of q, whose rims contain it, the number, the topmost, and the one of least power. This
    one is the owner, unless it is nested with another holder above it that faces the surface well, and whose
    image reaches q. Only sets with nested decals (`IndexedDecals.nested`) are searched for such a holder.
    """
    closest = wp.int32(NO_OWNER)
    least = wp.float32(0.0)
    topmost = wp.int32(NO_OWNER)
    topmost_ball = wp.vec4(0.0, 0.0, 0.0, 0.0)
    holders = wp.int32(0)
    count = wp.int32(0)
    a = wp.vec4i(NO_OWNER, NO_OWNER, NO_OWNER, NO_OWNER)
    b = wp.vec4i(NO_OWNER, NO_OWNER, NO_OWNER, NO_OWNER)
    for level in range(index.level_count):
        span = cell_range(q, level, index)
        for j in range(span[0], span[1]):
            decal = index.ids[j]
            ball = index.records[RECORD * decal]
            offset = q - xyz(ball)
            squared = wp.dot(offset, offset)
            size = ball[3] * ball[3]
            if squared < REACH_SQUARED * size:
                if acts(offset, n_q, decal, index):
                    b = wp.vec4i(a[3], b[0], b[1], b[2])
                    a = wp.vec4i(decal, a[0], a[1], a[2])
                    count += 1
                    if field_complement(squared / size) <= 0.5:
                        holders += 1
                        if topmost < 0 or size_above(ball[3], decal, topmost_ball[3], topmost):
                            topmost = decal
                            topmost_ball = ball
                        own = power(offset, RIM_RADIUS * ball[3])
                        if (
                            closest < 0
                            or own < least
                            or (own == least and is_above(decal, closest, index.records))
                        ):
                            least = own
                            closest = decal
    if closest < 0:
        return wp.vec4(float(NO_OWNER), 0.0, 0.0, 0.0)
    owner = wp.int32(closest)
    own_ball = index.records[RECORD * closest]
    if index.nested and topmost != closest:
        if holders == 2:
            offset = xyz(topmost_ball) - xyz(own_ball)
            if balls_nested(offset, RIM_RADIUS * own_ball[3], RIM_RADIUS * topmost_ball[3]):
                if lies_on_top(n_q, topmost, index.records):
                    owner = topmost
        elif count <= MAX_KEPT:
            owner = kept_owner(q, n_q, a, b, closest, index)
        traversing = bool(holders > 2 and count > MAX_KEPT)
        searching = bool(traversing or owner != closest)
        while searching:
            if traversing:  # rarely
                owner = nested_owner(q, n_q, closest, owner, index)
            searching = bool(owner != closest and not image_reaches(q, n_q, owner, index))
            traversing = True
        own_ball = index.records[RECORD * owner]
    radius = RIM_RADIUS * own_ball[3]
    w = (q - xyz(own_ball)) / radius
    distance = wp.length(w)
    ray = w / wp.max(distance, MIN_DISTANCE)
    squares = wp.float32(0.0)
    bump = wp.vec4(0.0, 0.0, 0.0, 0.0)
    for _kept in range(wp.min(count, MAX_KEPT)):
        other = a[0]
        a = wp.vec4i(a[1], a[2], a[3], b[0])
        b = wp.vec4i(b[1], b[2], b[3], NO_OWNER)
        if other != owner:
            ball = index.records[RECORD * other]
            between = xyz(ball) - xyz(own_ball)
            push = plane_push(ray, distance, between, radius, RIM_RADIUS * ball[3], index.stiffness)
            if push > 0.0:
                squares += square_of_push(distance, push)
            if index.nested:
                bump = join_bumps(bump, bump_at(q, n_q, own_ball, ball, other, index))
    shift = wp.vec2(0.0, 0.0)
    if index.nested:
        shift = image_shift(bump, n_q, owner, index)
    if count > MAX_KEPT:
        sums = sum_of_pushes(q, n_q, owner, ray, distance, index)
        squares = sums[0]
        shift = wp.vec2(sums[1], sums[2])
    return wp.vec4(float(owner), pushed_along_ray(wp.min(distance, 1.0), squares), shift[0], shift[1])
