"""Custom nodes
============

Skeletons and operators, each defined by one function: a ring, a solid box, a blend of chosen width, a
soft cut.
"""

from collections.abc import Sequence

import numpy as np
import warp as wp

from blobtree import Node, Point, Union
from blobtree.custom import define_operator, define_skeleton
from decals import DecalImage, Decals, Scene, TreeObject
from decals.apps.gallery.helpers import CLAY, Panel, camera_at, main, ring_image, single_decal

COPPER, SEA, SLATE = (0.72, 0.42, 0.28), (0.25, 0.52, 0.52), (0.42, 0.44, 0.5)


@wp.func
def ring(q: wp.vec3, center: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
    """Return the nearest point of a circle of radius `size` around `axis`."""
    n = wp.normalize(axis)
    w = q - center
    flat = w - n * wp.dot(w, n)
    if wp.length(flat) <= wp.length(w) * 1e-6:  # on the axis all its points are equally near: take any
        flat = wp.cross(n, wp.vec3(1.0, 0.0, 0.0))
        if wp.abs(axis[0]) > wp.length(axis) * 0.6:
            flat = wp.cross(n, wp.vec3(0.0, 1.0, 0.0))
    offset = wp.normalize(flat) * size
    return wp.vec3(center[0] + offset[0], center[1] + offset[1], center[2] + offset[2])


@wp.func
def block(q: wp.vec3, half: wp.vec3) -> wp.vec3:
    """Return the nearest point of a solid box around the origin."""
    return wp.vec3(
        wp.clamp(q[0], -wp.abs(half[0]), wp.abs(half[0])),
        wp.clamp(q[1], -wp.abs(half[1]), wp.abs(half[1])),
        wp.clamp(q[2], -wp.abs(half[2]), wp.abs(half[2])),
    )


@wp.func
def weld(a: wp.float32, b: wp.float32, width: wp.float32) -> wp.vec3:
    """Blend two fields by a hyperbola: width 0 is the union, 4 the sum."""
    larger = wp.max(a, b)
    if larger <= 0.0:
        return wp.vec3(0.0, 1.0, 0.0)
    x = a / larger
    y = b / larger
    root = wp.sqrt((x - y) * (x - y) + width * x * y)
    if root <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    by_a = 0.5 + 0.5 * (x - y + 0.5 * width * y) / root
    by_b = 0.5 + 0.5 * (y - x + 0.5 * width * x) / root
    return wp.vec3(0.5 * (a + b + larger * root), by_a, by_b)


@wp.func
def carve(a: wp.float32, b: wp.float32) -> wp.vec3:
    """Subtract b from a with soft walls."""
    outside = wp.max(1.0 - b, 0.0)
    return wp.vec3(a * outside * outside, outside * outside, -2.0 * a * outside)


@wp.func
def carve_steepest(max_a: wp.float32, max_b: wp.float32) -> wp.vec2:
    """Return the largest slopes of `carve` in a and b."""
    return wp.vec2(1.0, 2.0 * max_a)


Ring = define_skeleton(ring, limits={"axis": (1e-3, None), "size": (0.0, None)})
Block = define_skeleton(block)
Weld = define_operator(weld, steepest=1.0, like="blend", monotone=True, limits={"width": (0.0, 4.0)})
Carve = define_operator(carve, steepest=carve_steepest, like="difference", monotone=True)


def panels() -> Sequence[Panel]:
    """Link rings, blend balls with a ring, and subtract a ring from a box."""
    camera = camera_at((2.2, -3.6, 3.4), fov=30.0)
    images = (ring_image(),)
    return (
        Panel(Scene(objects=(TreeObject("chain", _chain()),), camera=camera)),
        Panel(
            Scene(
                objects=(TreeObject("wheel", _wheel()),),
                camera=camera,
                images=(DecalImage.load("eye"),),
                decals=_eyes(),
            )
        ),
        Panel(
            Scene(
                objects=(TreeObject("box", _box()),),
                camera=camera,
                images=images,
                decals=single_decal((0, 0, 0.55), (0, 0, 1), 0.6),
            )
        ),
    )


def _chain() -> Node:
    links = [
        Ring((0.62 * i, 0, 0), (0, i % 2, (i + 1) % 2), 0.55, radius=0.11, color=color)
        for i, color in ((-1, COPPER), (0, SEA), (1, COPPER))
    ]
    return Union(tuple(links)).scale(1.02)


_SPOKES = np.arange(5) * (2.0 * np.pi / 5.0)
_HUBS = 0.85 * np.stack([np.cos(_SPOKES), np.sin(_SPOKES), 0.0 * _SPOKES], axis=1)


def _wheel() -> Node:
    wheel: Node = Ring((0, 0, 0), (0, 0, 1), 0.85, radius=0.16, color=SLATE)
    for center in _HUBS.tolist():
        wheel = Weld((wheel, Point(tuple(center), radius=0.32, color=SEA)), width=0.6)
    return wheel


def _eyes() -> Decals:
    return Decals.concatenate([single_decal((x, y, 0.33), (0, 0, 1), 0.2) for x, y, _ in _HUBS])


def _box() -> Node:
    solid = Block((0.7, 0.7, 0.3), radius=0.25, color=CLAY)
    return Carve((solid, Ring((0, 0, 0.55), (0, 0, 1), 0.55, radius=0.16, color=COPPER)))


if __name__ == "__main__":
    main(panels)
