"""Reading the records of decals, as `Decals.packed` lays them out."""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

from blobtree.formulas.kernels import RIM
from decals.field.contact import NOWHERE, REACH, field_complement
from decals.model import FACING_LIMIT as MODEL_FACING_LIMIT
from decals.model import RECORD as MODEL_RECORD
from decals.model import Interaction

wp.set_module_options({"enable_backward": False})

RECORD = MODEL_RECORD
FACING_LIMIT = MODEL_FACING_LIMIT
NO_LIMIT = -2.0
RIM_RADIUS = float(RIM)
REACH_SQUARED = REACH * REACH
KINDS = 3
"""Mask of a rank's `Interaction`."""


@wp.func
def xyz(v: wp.vec4) -> wp.vec3:
    """First three components."""
    return wp.vec3(v[0], v[1], v[2])


@wp.func
def rank_of(decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.int32:
    """Rank of a decal."""
    return int(decals[RECORD * decal + 1][3])


@wp.func
def is_sheet(rank: wp.int32) -> wp.bool:
    """Whether the decals of this rank are a sheet of contact decals."""
    return (rank & KINDS) == Interaction.CONTACT


@wp.func
def facing_limit(packed_rank: wp.float32) -> wp.float32:
    """Smallest cosine between the normals of decal and surface; a half more means a decal that spills."""
    if packed_rank - wp.floor(packed_rank) > 0.25:
        return NO_LIMIT
    return FACING_LIMIT


@wp.func
def faces(n_q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.bool:
    """Whether a decal colours surface with this normal."""
    facing = decals[RECORD * decal + 1]
    return wp.dot(xyz(facing), n_q) > facing_limit(facing[3])


@wp.func
def complement_of(q: wp.vec3, n_q: wp.vec3, decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """Complement e of a decal's field at q; NOWHERE where it is out of reach or faces away."""
    ball = decals[RECORD * decal]
    w = q - xyz(ball)
    squared = wp.dot(w, w)
    size = ball[3] * ball[3]
    if squared >= REACH_SQUARED * size:  # most candidates end here, without a division
        return NOWHERE
    if not faces(n_q, decal, decals):
        return NOWHERE
    return field_complement(squared / size)


@wp.func
def apart(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.vec3:
    """From one decal's centre to another's."""
    return xyz(decals[RECORD * other]) - xyz(decals[RECORD * decal])


@wp.func
def visible_radius(decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """Where the rim of an undeformed decal lies."""
    return RIM_RADIUS * decals[RECORD * decal][3]
