"""The implicit spheres of the paper's figures 12 and 14, as a BlobTree."""

from blobtree import Node, Point, Sum

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
