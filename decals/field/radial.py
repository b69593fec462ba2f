"""Radial contact: a point moves only along the ray from the centre of its owner, so no image folds.

Rims are balls of visible radius ρ. Two neighbours meet on their radical plane, where |q − p|² − ρ² is equal
for both; it passes through the circle in which the rims intersect. The cell of a decal is the part of its
ball on its own side of all these planes. A cell is convex and contains the centre, so every ray from the
centre leaves it once, at a distance R that changes continuously with the ray. The image is scaled along each
ray so that its rim lies at R.

Two decals are nested if one of them would keep less than MIN_KEPT_RADIUS of its radius before their plane
(`decals.record.balls_nested`).
Nested decals do not push each other. The smaller one lies above the other, and of equal ones that of the
lower number, on surface that it faces well (`lies_on_top`), as far as its image reaches (`image_reaches`).
So a small decal deep inside a large one is seen whole, and R ≥ MIN_KEPT_RADIUS·ρ: no image is compressed more
than 1/MIN_KEPT_RADIUS times. There are no gaps: every point inside a rim lies at least in the cell of the
decal of least |q − p|² − ρ².
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.field.image_place import image_reaches
from decals.field.receivers import acts, complement_of
from decals.index.lookup import IndexedDecals, rank_range
from decals.record import (
    RECORD,
    RIM_RADIUS,
    apart,
    balls_nested,
    facing_limit,
    field_complement,
    rank_of,
    visible_radius,
    xyz,
)

wp.set_module_options({"enable_backward": False})

NO_OWNER = -1
"""Owner of a point outside all rims."""

TOP_MARGIN = 0.75
"""Amount above the facing limit of the least cosine between the normals of surface and of an upper decal."""

RIM_SQUARED = RIM_RADIUS * RIM_RADIUS
MIN_ADVANCE = 1.0e-37
"""Smallest divisor in `plane_distance`."""


# -- geometry of two balls ------------------------------------------------------------------------------


@wp.func
def power(w: wp.vec3, radius: wp.float32) -> wp.float32:
    """Return the power |w|² − ρ² of a point at w from the centre: negative inside the rim."""
    return wp.dot(w, w) - radius * radius


@wp.func
def plane_distance(ray: wp.vec3, apart: wp.vec3, radius: wp.float32, other: wp.float32) -> wp.float32:
    """Return the distance along a unit ray from the centre to the radical plane of a neighbour ahead."""
    between = wp.dot(apart, apart) + (radius - other) * (radius + other)
    return 0.5 * between / wp.max(wp.dot(ray, apart), MIN_ADVANCE)


# -- the same of decals ---------------------------------------------------------------------------------


@wp.func
def power_of(q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """Return the power |q − p|² − ρ² of q with respect to a decal."""
    return power(q - xyz(decals[RECORD * decal]), visible_radius(decal, decals))


@wp.func
def size_above(size: wp.float32, decal: wp.int32, other_size: wp.float32, other: wp.int32) -> wp.bool:
    """Return True if the first of two nested decals with these sizes and numbers is the upper one."""
    return size < other_size or (size == other_size and decal < other)


@wp.func
def is_above(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Return True if the first of two nested decals is the upper one."""
    return size_above(decals[RECORD * decal][3], decal, decals[RECORD * other][3], other)


@wp.func
def are_nested(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Return True if two contact decals are nested, so that they do not push each other."""
    return balls_nested(
        apart(decal, other, decals), visible_radius(decal, decals), visible_radius(other, decals)
    )


@wp.func
def lies_on_top(n_q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Return True if a decal faces surface with this normal so well that it may lie above decals around it.

    At edges and thin walls, decals of the other side are near, and face the surface little.
    """
    facing = decals[RECORD * decal + 1]
    return wp.dot(xyz(facing), n_q) > facing_limit(facing[3]) + TOP_MARGIN


@wp.func
def comes_next(
    ball: wp.vec4,
    decal: wp.int32,
    lower_size: wp.float32,
    lower: wp.int32,
    tried_size: wp.float32,
    tried: wp.int32,
    closest_ball: wp.vec4,
    closest: wp.int32,
) -> wp.bool:
    """Return True if a decal comes before `lower` among those to try after `tried`.

    These are nested with the decal `closest` and above it, in their order from the topmost down. `tried` is
    `closest` itself before the first of them, and `lower` is negative where none is known yet.
    """
    if not size_above(ball[3], decal, closest_ball[3], closest):
        return False
    if tried != closest and not size_above(tried_size, tried, ball[3], decal):
        return False
    if lower >= 0 and not size_above(ball[3], decal, lower_size, lower):
        return False
    return balls_nested(xyz(ball) - xyz(closest_ball), RIM_RADIUS * closest_ball[3], RIM_RADIUS * ball[3])


# -- owner ----------------------------------------------------------------------------------------------


@wp.func
def nested_owner(
    q: wp.vec3, n_q: wp.vec3, closest: wp.int32, after: wp.int32, index: IndexedDecals
) -> wp.int32:
    """Return the topmost contact decal below `after` whose cell contains q, given that of least power at q.

    Only decals nested with that one can share q with it. Those above it that face the surface well are tried
    from the topmost down: each traversal finds whether q lies in the cell of one, and the next one. `after`
    is `closest` to begin at the top.
    """
    rank = wp.int32(0)
    if index.layered:
        rank = rank_of(closest, index.records)
    closest_ball = index.records[RECORD * closest]
    tried = wp.int32(after)
    while True:
        tried_ball = index.records[RECORD * tried]
        radius = RIM_RADIUS * tried_ball[3]
        own = power(q - xyz(tried_ball), radius)
        inside = bool(tried != after)
        lower = wp.int32(NO_OWNER)
        lower_size = wp.float32(0.0)
        for level in range(index.level_count):
            span = rank_range(q, rank, level, index)
            for j in range(span[0], span[1]):
                decal = index.ids[j]
                if decal != tried and complement_of(q, n_q, decal, index) <= 0.5:
                    ball = index.records[RECORD * decal]
                    if inside and power(q - xyz(ball), RIM_RADIUS * ball[3]) < own:
                        inside = balls_nested(xyz(ball) - xyz(tried_ball), radius, RIM_RADIUS * ball[3])
                    if comes_next(
                        ball, decal, lower_size, lower, tried_ball[3], tried, closest_ball, closest
                    ):
                        if lies_on_top(n_q, decal, index.records):
                            lower = decal
                            lower_size = ball[3]
        if inside:
            return tried
        if lower < 0:
            return closest
        tried = lower
    return closest


@wp.func
def cell_owner(q: wp.vec3, n_q: wp.vec3, rank: wp.int32, index: IndexedDecals) -> wp.int32:
    """Return the topmost contact decal of a rank whose cell contains q; NO_OWNER outside all rims.

    The image of an upper one must reach q.
    """
    owner = wp.int32(NO_OWNER)
    least = wp.float32(0.0)
    holders = wp.int32(0)
    for level in range(index.level_count):
        span = rank_range(q, rank, level, index)
        for j in range(span[0], span[1]):
            if complement_of(q, n_q, index.ids[j], index) <= 0.5:
                holders += 1
                own = power_of(q, index.ids[j], index.records)
                if (
                    owner < 0
                    or own < least
                    or (own == least and is_above(index.ids[j], owner, index.records))
                ):
                    least = own
                    owner = index.ids[j]
    if holders < 2 or not index.nested:
        return owner
    closest = owner
    while True:
        owner = nested_owner(q, n_q, closest, owner, index)
        if owner == closest or image_reaches(q, n_q, owner, index):
            return owner
    return owner


# -- deformation ----------------------------------------------------------------------------------------


@wp.func
def radial_complement(q: wp.vec3, n_q: wp.vec3, owner: wp.int32, index: IndexedDecals) -> wp.float32:
    """Return E = 1 − F of a contact decal at q, scaled along its ray so that the rim lies at the cell's end.

    A ray leaves the convex cell before the rim only through planes of decals whose balls contain the ray's
    point on the rim. The index lists all of them there.
    """
    rank = wp.int32(0)
    if index.layered:
        rank = rank_of(owner, index.records)
    centre = xyz(index.records[RECORD * owner])
    radius = visible_radius(owner, index.records)
    distance = wp.length(q - centre)
    if distance == 0.0:
        return 0.0
    ray = (q - centre) / distance
    edge = centre + radius * ray
    end = radius
    for level in range(index.level_count):
        span = rank_range(edge, rank, level, index)
        for j in range(span[0], span[1]):
            decal = index.ids[j]
            if decal != owner:
                offset = q - xyz(index.records[RECORD * decal])
                if acts(offset, n_q, decal, index) and not are_nested(owner, decal, index.records):
                    other = visible_radius(decal, index.records)
                    end = wp.min(end, plane_distance(ray, apart(owner, decal, index.records), radius, other))
    x = wp.min(distance / end, 1.0)
    return field_complement(x * x * RIM_SQUARED)
