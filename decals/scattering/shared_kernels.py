"""Structs and functions that the Warp kernels of scattering share."""

# mypy: disable-error-code="call-overload"
# (Warp declares no arithmetic of vectors)

import warp as wp

wp.set_module_options({"enable_backward": False})

Six = wp.types.vector(6, wp.float32)
"""Distances to the six nearest particles, ascending."""


@wp.struct
class Particles:
    """Oriented points on surfaces, and the spacing that the density asks for at each."""

    positions: wp.array(dtype=wp.vec3)
    normals: wp.array(dtype=wp.vec3)
    """Unit normals of the surfaces at the positions."""
    sizes: wp.array(dtype=wp.float32)
    """Spacings, in model units."""


@wp.struct
class MirrorPlanes:
    """Planes at open boundaries, `per_point` for each of some points; a zero normal stands for no plane."""

    per_point: wp.int32
    """Planes of each point; 0 where no surface has a boundary, and the arrays are empty then."""
    points: wp.array(dtype=wp.vec3)
    """A point of each plane."""
    normals: wp.array(dtype=wp.vec3)
    """Unit normals, toward the surface."""


@wp.struct
class NeighborSearch:
    """A hash grid over particles, and the rule that makes two of them neighbours."""

    grid: wp.uint64
    reach: wp.float32
    """Largest distance of neighbours, in the mean of their two spacings."""
    widening: wp.float32
    """Factor of the radius that the grid is searched with, above 1 where spacings vary."""
    facing_limit: wp.float32
    """Least cosine of two normals that face the same way."""


@wp.func
def mirrored(q: wp.vec3, point: wp.vec3, normal: wp.vec3) -> wp.vec3:
    """Return the image of a point behind a plane; a point behind the plane is its own image."""
    return q - 2.0 * wp.max(wp.dot(q - point, normal), 0.0) * normal


@wp.func
def insert_distance(six: Six, distance: wp.float32) -> Six:
    """Return the six smallest of six ascending distances and one more."""
    x = float(distance)
    if x < six[5]:
        for k in range(6):
            farther = wp.max(six[k], x)
            six[k] = wp.min(six[k], x)
            x = farther
    return six


@wp.func
def mean_distance(six: Six) -> wp.float32:
    """Return the mean of six distances."""
    return (six[0] + six[1] + six[2] + six[3] + six[4] + six[5]) / 6.0
