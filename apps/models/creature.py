"""The creature of the demo: a sitting young dragon of blended points and segments."""

from blobtree import Node, Point, Ricci, Segment

_SKIN = (0.34, 0.50, 0.28)
_CHEST = (0.82, 0.76, 0.52)
_SOCKET = (0.17, 0.12, 0.07)
_HORN = (0.90, 0.85, 0.72)

_BLEND = 3.0
"""Exponent of the Ricci blend: its joints are smooth and bulge less than those of a sum."""


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
    """Return the leg, arm, eye socket, nostril and horn of the left (``z`` = 1) or right side (-1)."""
    return [
        Point((-0.42, 0.44, 0.46 * z), radius=0.38, color=_SKIN),
        Segment((-0.22, 0.20, 0.60 * z), (0.26, 0.13, 0.68 * z), radius=0.17, color=_SKIN),
        Segment((0.40, 0.98, 0.32 * z), (0.60, 0.62, 0.50 * z), radius=0.16, color=_SKIN),
        Segment((0.60, 0.62, 0.50 * z), (0.98, 0.70, 0.46 * z), radius=0.14, color=_SKIN),
        Point((0.92, 2.24, 0.24 * z), radius=0.19, color=_SOCKET),
        Point((1.42, 1.92, 0.11 * z), radius=0.075, color=_SKIN),
        Segment((0.58, 2.34, 0.20 * z), (0.30, 2.56, 0.30 * z), radius=0.095, color=_HORN),
    ]
