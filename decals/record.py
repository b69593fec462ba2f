"""Typed functions that read packed records (`Decals.packed`), for Warp and GLSL, and `Contact`."""

# mypy: ignore-errors
# (kernel code is Python only in form: its names have Warp types)

from enum import IntEnum

import warp as wp

from blobtree.formulas.falloff import RIM
from decals.model import FACING_LIMIT as MODEL_FACING_LIMIT
from decals.model import RECORD as MODEL_RECORD
from decals.model import SHEET_HEIGHT as MODEL_SHEET_HEIGHT
from decals.model import Interaction

wp.set_module_options({"enable_backward": False})


class Contact(IntEnum):
    """Contact mode: how neighbours push the owner of a point.

    `decals.field.contact`, `decals.field.radial` and `decals.field.elastic` state the formulas. This is a
    mode of decals; `blobtree.Contact` is a node whose solids deform each other.

    Examples
    --------
    >>> import decals
    >>> list(decals.Contact)
    [<Contact.PRODUCT: 0>, <Contact.MIN: 1>, <Contact.RADIAL: 2>, <Contact.ELASTIC: 3>]
    """

    PRODUCT = 0
    """Product of the factors h of all neighbours (paper, equation 5, repaired)."""
    MIN = 1
    """Smallest factor h: only the strongest push counts, so no image is torn where three decals meet."""
    RADIAL = 2
    """Scaling along rays from the centre, in convex cells: no image folds."""
    ELASTIC = 3
    """Compression at contact lines, along rays in the cells of RADIAL: no image folds, the middle stays."""


DEFAULT_CONTACT = Contact.ELASTIC
"""The contact mode of everything that is not given one."""

DEFAULT_STIFFNESS = 2.0
"""Stiffness of elastic contact."""

NEIGHBOR_REACH = 0.575
"""Neighbour reach in influence radii. A neighbour beyond it would move r by less than 7e-5 of the rim."""

OPAQUE_ALPHA = 0.9999
"""Alpha above which decals below are left out."""

NO_FIELD = 2.0
"""Complement of a decal that does not act on a point: above every e."""

MIN_KEPT_RADIUS = 0.21
"""Smallest share of its radius that a decal keeps towards a neighbour that pushes it."""

RECORD = MODEL_RECORD
FACING_LIMIT = MODEL_FACING_LIMIT
SHEET_HEIGHT = MODEL_SHEET_HEIGHT
NO_FACING_LIMIT = -2.0
RIM_RADIUS = float(RIM)
REACH_SQUARED = NEIGHBOR_REACH * NEIGHBOR_REACH
INTERACTION_MASK = 3
"""Mask of a rank's `Interaction`."""


@wp.func
def field_complement(z: wp.float32) -> wp.float32:
    """Return the complement e = 1 − g(d) for z = d² = |q − p|²/s², to full relative precision also near 0."""
    t = wp.min(z, 1.0)
    return t * (3.0 - t * (3.0 - t))


@wp.func
def xyz(v: wp.vec4) -> wp.vec3:
    """Return the first three components."""
    return wp.vec3(v[0], v[1], v[2])


@wp.func
def rank_of(decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.int32:
    """Return the rank of a decal."""
    return int(decals[RECORD * decal + 1][3])


@wp.func
def is_contact_rank(rank: wp.int32) -> wp.bool:
    """Return True if the decals of this rank are contact decals, which push each other."""
    return (rank & INTERACTION_MASK) == Interaction.PUSH


@wp.func
def has_cells(contact: wp.int32) -> wp.bool:
    """Return True in the contact modes whose owners are those of convex cells, RADIAL and ELASTIC."""
    return contact >= Contact.RADIAL


@wp.func
def facing_limit(packed_rank: wp.float32) -> wp.float32:
    """Return the smallest cosine between the normals of decal and surface; decals that spill have none."""
    if packed_rank - wp.floor(packed_rank) > 0.25:
        return NO_FACING_LIMIT
    return FACING_LIMIT


@wp.func
def apart(decal: wp.int32, other: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.vec3:
    """Return the vector from the centre of one decal to that of another."""
    return xyz(decals[RECORD * other]) - xyz(decals[RECORD * decal])


@wp.func
def visible_radius(decal: wp.int32, decals: wp.array(dtype=wp.vec4)) -> wp.float32:
    """Return the visible radius of a decal."""
    return RIM_RADIUS * decals[RECORD * decal][3]


@wp.func
def balls_nested(apart: wp.vec3, radius: wp.float32, other: wp.float32) -> wp.bool:
    """Return True if two decals with these radii, and centres this far apart, are nested.

    With the distance D of the centres, and radii a ≤ b, that is D² − (b² − a²) ≤ 2 MIN_KEPT_RADIUS·a·D, or
    D² + (b² − a²) ≤ 2 MIN_KEPT_RADIUS·b·D. The squares of both sides need no root.
    """
    smaller = wp.min(radius, other)
    larger = wp.max(radius, other)
    squared = wp.dot(apart, apart)
    difference = (larger - smaller) * (larger + smaller)
    from_plane = squared - difference
    to_plane = squared + difference
    least = 4.0 * MIN_KEPT_RADIUS * MIN_KEPT_RADIUS * squared
    return (
        from_plane <= 0.0
        or from_plane * from_plane <= least * (smaller * smaller)
        or to_plane * to_plane <= least * (larger * larger)
    )
