"""Where a decal acts: its facing rule, objects and sheet that it lies on, and its fades by angle and depth.

A decal fades by the angle θ between its normal and that of the surface, from full at half its fade angle to
nothing at the fade angle, and in the same way by the distance of the point from its tangent plane. It acts
only where it has not faded away: the fade angle replaces the fixed limit of the facing rule.

A point and the centre of a decal may each lie above or below the tangent plane of the other. On one bend both
are below, or both above; on two parallel sheets that face the same way, or beyond a wall that crosses, one is
above and the other below. A decal that keeps to its sheet does not act there.
"""

# ruff: noqa: SIM102  (Warp evaluates both sides of `and`)
# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

import warp as wp

from decals.index.lookup import IndexedDecals
from decals.record import (
    NO_FIELD,
    REACH_SQUARED,
    RECORD,
    RIM_RADIUS,
    SHEET_HEIGHT,
    facing_limit,
    field_complement,
    visible_radius,
    xyz,
)

wp.set_module_options({"enable_backward": False})


@wp.func
def acts(w: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.bool:
    """Return True if a decal colours surface with this normal at the offset w from its centre."""
    facing = index.records[RECORD * decal + 1]
    limit = facing_limit(facing[3])
    if index.limited:
        own = index.limits[decal]
        if ((index.surface >> int(own[3])) & 1) == 0:
            return False
        if own[0] > own[1]:
            limit = own[1]
        if own[2] > 0.0:
            if wp.abs(wp.dot(w, xyz(facing))) >= own[2] * RIM_RADIUS * index.records[RECORD * decal][3]:
                return False
        if own[3] - wp.floor(own[3]) > 0.25:
            least = SHEET_HEIGHT * visible_radius(decal, index.records)
            if wp.dot(w, xyz(facing)) * wp.dot(w, n_q) > least * least:
                return False
    return wp.dot(xyz(facing), n_q) > limit


@wp.func
def complement_of(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.float32:
    """Return the complement e of a decal's field at q; NO_FIELD out of reach, or where it does not act."""
    ball = index.records[RECORD * decal]
    w = q - xyz(ball)
    squared = wp.dot(w, w)
    size = ball[3] * ball[3]
    if squared >= REACH_SQUARED * size:  # most candidates return here, before any division
        return NO_FIELD
    if not acts(w, n_q, decal, index):
        return NO_FIELD
    return field_complement(squared / size)


@wp.func
def smooth_step(t: wp.float32) -> wp.float32:
    """Return 0 up to t = 0, 1 from t = 1 on, and a smooth rise between."""
    x = wp.clamp(t, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)


@wp.func
def fade_at(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.float32:
    """Return the part of its opacity, 0 to 1, that the fades of a decal leave at q."""
    if not index.limited:
        return 1.0
    own = index.limits[decal]
    normal = xyz(index.records[RECORD * decal + 1])
    fade = wp.float32(1.0)
    if own[0] > own[1]:
        fade = smooth_step((wp.dot(normal, n_q) - own[1]) / (own[0] - own[1]))
    if own[2] > 0.0:
        depth = wp.abs(wp.dot(q - xyz(index.records[RECORD * decal]), normal))
        fade = fade * smooth_step(2.0 - 2.0 * depth / (own[2] * visible_radius(decal, index.records)))
    return fade


@wp.func
def opacity_at(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, index: IndexedDecals) -> wp.float32:
    """Return the opacity of a decal at q: its own, times the part that its fades leave."""
    return index.records[RECORD * decal + 3][3] * fade_at(q, n_q, decal, index)
