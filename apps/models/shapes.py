"""Shapes of the sample models: the spheres and the creature as BlobTrees; knot, egg and box as meshes."""

import numpy as np
from numpy.typing import ArrayLike

from blobtree import Node, Point, Ricci, Segment, Sum
from blobtree._typing import Float64Array, FloatArray, Int32Array
from decals.surfaces.triangulate import MeshArrays

_COLD, _WARM = (0.36, 0.52, 0.72), (0.85, 0.55, 0.32)
_BALLS = (
    ((0.00, 0.00, 0.00), 0.78, _COLD),
    ((1.05, 0.30, 0.25), 0.50, _WARM),
    ((-0.85, 0.55, 0.30), 0.46, _WARM),
    ((0.20, 0.98, -0.15), 0.42, _COLD),
    ((-0.35, -0.80, 0.45), 0.48, _COLD),
    ((0.55, -0.62, 0.72), 0.36, _WARM),
    ((0.10, 0.25, 0.95), 0.38, _WARM),
    ((0.70, 0.85, 0.80), 0.26, _COLD),
    ((-0.70, -0.35, -0.75), 0.45, _WARM),
    ((1.55, -0.35, 0.35), 0.30, _COLD),
    ((-1.45, 0.75, 0.45), 0.24, _COLD),
)


def spheres() -> Node:
    """Return a sum of balls that blend into each other."""
    return Sum(tuple(Point(center, radius=radius, color=color) for center, radius, color in _BALLS))


_SKIN = (0.34, 0.50, 0.28)
_CHEST = (0.82, 0.76, 0.52)
_SOCKET = (0.17, 0.12, 0.07)
_HORN = (0.90, 0.85, 0.72)

_BLEND = 3.0
"""Exponent of the Ricci blend: its joints are smooth and bulge less than those of a sum."""


CREATURE_PARTS = (
    *("hips", "belly", "chest", "neck", "head", "muzzle"),
    *(f"tail {number}" for number in range(1, 6)),
    *(
        f"{side} {part}"
        for side in ("right", "left")
        for part in ("thigh", "foot", "upper arm", "forearm", "eye socket", "nostril", "horn")
    ),
)
"""Names of the creature's parts, in the order of its operands."""


def creature() -> Node:
    """Return the creature: 3 units long, 2.6 high, facing +x, its feet on y = 0."""
    parts = [*_trunk(), *_tail(), *_side(1.0), *_side(-1.0)]
    return Ricci(tuple(parts), exponent=_BLEND)


def _trunk() -> list[Node]:
    return [
        Point((-0.48, 0.62, 0.0), radius=0.56, color=_SKIN),
        Point((0.00, 0.82, 0.0), radius=0.48, color=_SKIN),
        Point((0.36, 1.10, 0.0), radius=0.36, color=_CHEST),
        Segment((0.48, 1.28, 0.0), (0.62, 1.72, 0.0), radius=0.23, color=_SKIN),
        Point((0.76, 2.02, 0.0), radius=0.40, color=_SKIN),
        Segment((0.98, 1.92, 0.0), (1.28, 1.84, 0.0), radius=0.22, color=_SKIN),
    ]


def _tail() -> list[Node]:
    spine = [
        (-0.85, 0.45, 0.00),
        (-1.30, 0.26, 0.12),
        (-1.66, 0.20, 0.44),
        (-1.66, 0.19, 0.90),
        (-1.34, 0.20, 1.16),
        (-1.00, 0.25, 1.14),
    ]
    radii = (0.30, 0.22, 0.16, 0.125, 0.10)
    return [Segment(spine[i], spine[i + 1], radius=radius, color=_SKIN) for i, radius in enumerate(radii)]


def _side(z: float) -> list[Node]:
    """Return the leg, arm, eye socket, nostril and horn of the right (``z`` = 1) or left side (-1)."""
    return [
        Point((-0.42, 0.44, 0.46 * z), radius=0.38, color=_SKIN),
        Segment((-0.22, 0.20, 0.60 * z), (0.26, 0.13, 0.68 * z), radius=0.17, color=_SKIN),
        Segment((0.40, 0.98, 0.32 * z), (0.60, 0.62, 0.50 * z), radius=0.16, color=_SKIN),
        Segment((0.60, 0.62, 0.50 * z), (0.98, 0.70, 0.46 * z), radius=0.14, color=_SKIN),
        Point((0.92, 2.24, 0.24 * z), radius=0.19, color=_SOCKET),
        Point((1.42, 1.92, 0.11 * z), radius=0.075, color=_SKIN),
        Segment((0.58, 2.34, 0.20 * z), (0.30, 2.56, 0.30 * z), radius=0.095, color=_HORN),
    ]


def torus_knot(
    *,
    turns: int = 2,
    windings: int = 3,
    radius: float = 1.0,
    bend: float = 0.42,
    tube: float = 0.23,
    along: int = 480,
    around: int = 48,
) -> MeshArrays:
    """Make a closed tube around a torus knot.

    Parameters
    ----------
    turns, windings : int
        Turns of the knot around the axis of the torus and through its hole; coprime.
    radius, bend, tube : float
        Major and minor radius of the torus, and radius of the tube around the knot, in the model's units.
    along, around : int
        Quads along the knot and around its tube.

    Returns
    -------
    vertices : float32[along * around, 3]
    faces : int32[2 * along * around, 3]
        Counter-clockwise seen from outside.
    """  # fmt: skip
    t = np.arange(along) * (2.0 * np.pi / along)
    centre = _knot(t, turns, windings, radius, bend)
    ahead = _knot(t + 1e-4, turns, windings, radius, bend) - _knot(t - 1e-4, turns, windings, radius, bend)
    tangent = _unit(ahead)
    # The normal of the torus gives a frame that is periodic along the knot.
    out = _unit(centre - radius * np.stack([np.cos(turns * t), np.sin(turns * t), 0.0 * t], axis=-1))
    side = _unit(np.cross(tangent, out))
    out = np.cross(side, tangent)
    angle = np.arange(around) * (2.0 * np.pi / around)
    ring = np.cos(angle)[:, None] * out[:, None] + np.sin(angle)[:, None] * side[:, None]
    vertices = centre[:, None] + tube * ring
    return vertices.reshape(-1, 3).astype(np.float32), _grid_faces(along, around)


def _knot(t: FloatArray, turns: int, windings: int, radius: float, bend: float) -> FloatArray:
    ring = radius + bend * np.cos(windings * t)
    return np.stack(
        [ring * np.cos(turns * t), ring * np.sin(turns * t), bend * np.sin(windings * t)], axis=-1
    )


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _grid_faces(along: int, around: int) -> Int32Array:
    """Return the triangles of a grid that is periodic in both directions."""
    i, j = (index.reshape(-1) for index in np.indices((along, around)))
    a, b = i * around + j, (i + 1) % along * around + j
    c, d = (i + 1) % along * around + (j + 1) % around, i * around + (j + 1) % around
    faces = np.concatenate([np.stack([a, c, b], axis=-1), np.stack([a, d, c], axis=-1)])
    return faces.astype(np.int32)


_SUBDIVISIONS = 5
_SQUARES = 48


def egg(center: ArrayLike, *, radius: float, height: float) -> MeshArrays:
    """Return an egg on its thick end: float32[10242, 3] vertices and int32[20480, 3] faces.

    Parameters
    ----------
    center : (3,)
        Middle of the egg.
    radius, height : float
        Half the largest width (approximately) and half the height.
    """
    directions, faces = _ball()
    taper = radius * (1.0 - 0.16 * directions[:, 1])
    scale = np.stack([taper, np.full_like(taper, height), taper], axis=-1)
    return (directions * scale + np.asarray(center)).astype(np.float32), faces


def rounded_box(center: ArrayLike, *, half: ArrayLike, rounding: float) -> MeshArrays:
    """Return a box with round edges: float32[13826, 3] vertices and int32[27648, 3] faces.

    Parameters
    ----------
    center, half : (3,)
        Middle of the box and half its sides.
    rounding : float
        Radius of the edges, at most the shortest half side.
    """
    cube, faces = _cube()
    sides = np.asarray(half, np.float64)
    core = sides - rounding
    # Half of the quads along a side cover its flat part, a quarter each of the two edges.
    inner = core * np.clip(2.0 * cube, -1.0, 1.0)
    outward = np.sign(cube) * np.tan(0.25 * np.pi * np.clip(2.0 * np.abs(cube) - 1.0, 0.0, 1.0))
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return (inner + rounding * outward + np.asarray(center)).astype(np.float32), faces


def _cube() -> tuple[Float64Array, Int32Array]:
    """Return the surface of the cube from -1 to 1, in equal squares of two triangles."""
    import pyvista as pv

    grid = pv.ImageData(dimensions=(_SQUARES + 1,) * 3, spacing=(2.0 / _SQUARES,) * 3, origin=(-1.0,) * 3)
    surface = grid.extract_surface(algorithm="geometry").triangulate()  # the default algorithm leaves seams
    return np.asarray(surface.points, np.float64), surface.regular_faces.astype(np.int32)


def _ball() -> tuple[Float64Array, Int32Array]:
    import pyvista as pv

    sphere = pv.Icosphere(nsub=_SUBDIVISIONS)
    points = np.asarray(sphere.points, np.float64)
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    return directions, sphere.regular_faces.astype(np.int32)
