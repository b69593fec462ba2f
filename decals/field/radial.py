"""Radial contact: a point moves along the ray from its owner's centre alone, so nothing ever folds.

Rims are balls of visible radius ρ, and neighbours meet on the plane where |q − p|² − ρ² is equal for
both: the radical plane, which passes through the circle where the rims cross. The part of a rim's ball on
its own side of all these planes is its cell: convex, with the centre inside, so every ray from the centre
leaves it once, at a distance R that changes continuously with the ray. The image is stretched along the
ray: its rim lies at R.

Two decals of which one keeps less than LEAST of its radius before their plane are stacked: they do not
push each other, and the smaller (of equal ones, that of lower number) lies over the other. So a small
decal deep inside a large one is seen whole, and R ≥ LEAST·ρ: no image is squeezed more than 1/LEAST
times. At every point of a ball some cell holds it, that of the least |q − p|² − ρ² at any rate: there are
no gaps.
"""

# mypy: ignore-errors
# (kernel code is Python to look at only: its names have Warp types)

import warp as wp

wp.set_module_options({"enable_backward": False})

LEAST = 0.21
"""Smallest share of its radius that a decal keeps towards a neighbour that pushes it."""

SMALLEST_ADVANCE = 1.0e-37


@wp.func
def power(w: wp.vec3, radius: wp.float32) -> wp.float32:
    """|w|² − ρ² of a point at w from a centre: negative inside the rim."""
    return wp.dot(w, w) - radius * radius


@wp.func
def are_stacked(apart: wp.vec3, radius: wp.float32, other: wp.float32) -> wp.bool:
    """Whether two decals, so far apart, of these radii, lie over each other and do not push."""
    smaller = wp.min(radius, other)
    larger = wp.max(radius, other)
    squared = wp.dot(apart, apart)
    between = squared + (smaller - larger) * (smaller + larger)
    return between <= 2.0 * LEAST * smaller * wp.sqrt(squared) or squared <= 2.0 * LEAST * larger * wp.sqrt(
        squared
    ) - (larger - smaller) * (larger + smaller)


@wp.func
def plane_distance(ray: wp.vec3, apart: wp.vec3, radius: wp.float32, other: wp.float32) -> wp.float32:
    """Where a ray (unit) from a centre meets the plane between it and a neighbour ahead."""
    between = wp.dot(apart, apart) + (radius - other) * (radius + other)
    return 0.5 * between / wp.max(wp.dot(ray, apart), SMALLEST_ADVANCE)
