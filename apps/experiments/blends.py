"""How far a blend of two limbs bulges, and how much volume it adds.

Two segments of one radius meet at their ends. The surface of their union is known exactly, so the distance of
a vertex of the blend from it is exact up to the distance of the vertex from the blend.
"""

from collections.abc import Callable

import numpy as np

from blobtree import (
    ISO,
    ConvolutionSegment,
    GradientBlend,
    Node,
    Ricci,
    Segment,
    SuperellipticBlend,
    polygonize,
)
from blobtree._typing import Float64Array
from decals.experiments import Grid

RADIUS, LENGTH = 0.3, 1.5
"""Radius and length of a limb."""

REACH, SAMPLES = 0.9, 96
"""Radius of the ball around the joint in which volumes are compared, and points across it."""

Ends = tuple[tuple[float, float, float], tuple[float, float, float]]


def blends(blend: str, angle: float, resolution: int = 96) -> dict[str, float]:
    """Join two limbs.

    Parameters
    ----------
    blend
        One of `BLENDS`.
    angle
        Angle between the limbs, in degrees; 180 makes a straight bar of both.
    resolution
        Cells along the longest side of the mesh.

    Returns
    -------
    dict
        ``bulge``, the largest distance of the surface from the union on the outer side of the joint, over
        the radius; ``fillet``, the same on the inner side; ``volume`` near the joint, over that of the union.
    """
    turn = np.radians(angle)
    limbs: list[Ends] = [
        ((0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (LENGTH * float(np.cos(turn)), LENGTH * float(np.sin(turn)), 0.0)),
    ]
    blended, plain = (BLENDS[name](limbs) for name in (blend, "union"))
    points = polygonize(blended, resolution=resolution).vertices.astype(np.float64)
    excess = (_distance(points, limbs) - RADIUS) / RADIUS
    inner = points @ np.add(limbs[0][1], limbs[1][1]) > 1e-6  # no point of a straight bar
    return {
        "bulge": float(excess[~inner].max()),
        "fillet": float(excess[inner].max(initial=0.0)),
        "volume": _volume(blended) / _volume(plain),
    }


def _distance(points: Float64Array, limbs: list[Ends]) -> Float64Array:
    """Return the distance of points from the nearer of the segments."""
    distances = []
    for start, end in limbs:
        axis = np.subtract(end, start)
        along = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
        distances.append(np.linalg.norm(points - start - along[:, None] * axis, axis=1))
    nearest: Float64Array = np.minimum(*distances)
    return nearest


def _volume(model: Node) -> float:
    """Return the share of the ball around the joint that lies inside of a model."""
    axis = (np.arange(SAMPLES) + 0.5) * (2.0 * REACH / SAMPLES) - REACH
    points = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    near = points[np.linalg.norm(points, axis=1) < REACH]
    return float((np.asarray(model(near)) >= ISO).mean())


def _segments(limbs: list[Ends]) -> list[Node]:
    return [Segment(*ends, radius=RADIUS) for ends in limbs]


def _convolution(ends: Ends) -> Node:
    return ConvolutionSegment(*ends, radius=RADIUS, end_radius=RADIUS)


BLENDS: dict[str, Callable[[list[Ends]], Node]] = {
    "union": lambda limbs: _segments(limbs)[0] | _segments(limbs)[1],
    "sum": lambda limbs: _segments(limbs)[0] + _segments(limbs)[1],
    "ricci 4": lambda limbs: Ricci(tuple(_segments(limbs)), exponent=4.0),
    "superelliptic": lambda limbs: SuperellipticBlend(*_segments(limbs), width=0.25, exponent=2.0),
    "gradient": lambda limbs: GradientBlend(*_segments(limbs), start_angle=15.0, full_angle=75.0),
    "convolution": lambda limbs: _convolution(limbs[0]) + _convolution(limbs[1]),
}
"""Blends by name."""

experiment = blends
design = Grid(blend=[*BLENDS], angle=[60, 90, 120, 150, 180])
full = Grid(blend=[*BLENDS], angle=range(30, 181, 10), resolution=[192])
