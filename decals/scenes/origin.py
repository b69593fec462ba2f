"""Local origins: models far from the origin of their coordinates are kept relative to a point near them.

Graphics cards and devices compute in float32, which resolves about a ten-millionth of a coordinate. The
difference to a local origin is taken in float64, so that they see small numbers alone.
"""

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node
from blobtree._typing import Float64Array
from blobtree.validation import describe, real
from decals.errors import InvalidScene

Origin = tuple[float, float, float]
"""A point in the coordinates that models come in."""

WORLD: Origin = (0.0, 0.0, 0.0)
"""Origin of the coordinates that models come in."""

FAR = 1e3
"""Distance from the origin, in sizes of the model, from which a model gets a local origin."""

MAX_DISTANCE = 1e5
"""Largest distance of an object from the origin of its scene, in sizes of the object.

Beyond it float32 would show steps.
"""

MAX_TREE_ROUNDS = 4
"""Translations of a tree until its box, which is float32, is exact enough for an origin near it."""


def origin_near(low: Float64Array, high: Float64Array) -> Origin:
    """Return a point near a box that lies far from the origin, or the origin itself.

    Its coordinates are multiples of a power of two near the size of the box, so that differences are exact.
    """
    center, size = 0.5 * (low + high), float((high - low).max())
    if not np.isfinite(center).all() or not 0.0 < FAR * size < float(np.abs(center).max()):
        return WORLD
    step = 2.0 ** np.ceil(np.log2(size))
    return as_origin(np.round(center / step) * step)


def as_origin(origin: ArrayLike) -> Origin:
    """Return three finite coordinates, or raise InvalidScene."""
    try:
        x, y, z = (float(value) for value in np.asarray(real(origin), np.float64))
    except (TypeError, ValueError, OverflowError):
        x = y = z = np.nan
    if not np.isfinite([x, y, z]).all():
        raise InvalidScene(f"origin: expected three finite coordinates, got {describe(origin)}")
    return x, y, z


def local_vertices(vertices: ArrayLike) -> tuple[ArrayLike, Origin]:
    """Return vertices relative to an origin near them, and the origin.

    Vertices near the zero point, and wrong values, are returned as they are.
    """
    try:
        wide = np.asarray(vertices, np.float64)
    except (TypeError, ValueError, OverflowError):  # reported where vertices are checked
        return vertices, WORLD
    if wide.ndim != 2 or wide.shape[1:] != (3,) or not len(wide) or not np.isfinite(wide).all():
        return vertices, WORLD
    origin = origin_near(wide.min(axis=0), wide.max(axis=0))
    return (vertices, WORLD) if origin == WORLD else (wide - origin, origin)


def local_tree(tree: Node) -> tuple[Node, Origin]:
    """Return a tree relative to an origin near it, and the origin.

    Translations fold into primitives in float64. Below warps, coordinates stay as large as they are.
    """
    origin, local = np.zeros(3), tree
    for _ in range(MAX_TREE_ROUNDS):
        low, high = (corner.astype(np.float64) for corner in local.support)
        step = np.array(origin_near(low, high))
        if not step.any():
            break
        origin = origin + step
        local = tree.translate(tuple(-origin))
    return local, as_origin(origin)


def check_distance(name: str, low: Float64Array, high: Float64Array) -> None:
    """Raise InvalidScene for an object so far from the origin that float32 would show steps."""
    size, distance = float((high - low).max()), float(np.abs([low, high]).max())
    if distance > MAX_DISTANCE * size:
        raise InvalidScene(
            f"object {name!r}: expected a distance of at most {MAX_DISTANCE:g} times its size, {size:g}, "
            f"from the first object of the scene, got {distance:g}; draw them in two scenes"
        )
