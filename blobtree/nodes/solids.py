"""Solid shapes: the cylinder, the half-space, and the ellipsoid as a ball under a map."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Any

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import unit_vectors
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.node import Node
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.primitives import (
    Columns,
    Point,
    SolidPrimitive,
    octagons,
)
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

LARGEST_RATIO = 1e5
"""Largest ratio of two semi-axes; a flatter map cannot be inverted in float32."""


class Ellipsoid(Pieces):
    """An ellipsoid, its axes parallel to those of its space: a ball of radius 1 under a scale.

    Its field is g(r · RIM) with r² = (x/a)² + (y/b)² + (z/c)², so its level sets are ellipsoids too.
    Along an axis of length a, a `width` w is w · a / ∛(abc).

    Examples
    --------
    >>> from blobtree import Ellipsoid
    >>> egg = Ellipsoid((0, 0, 1), (1, 2, 3))
    >>> egg([[1, 0, 1], [0, 2, 1], [0, 0, 4]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    file_tag = "ellipsoid"

    center: Vector = par.point("centre of the ellipsoid")
    semi_axes: Vector = par.semi_axes("visible radii along the x, y and z axes, above 0")

    def __post_init__(self) -> None:
        super().__post_init__()
        if max(self.semi_axes) > LARGEST_RATIO * min(self.semi_axes):
            raise InvalidNode(
                f"semi_axes: expected lengths whose ratio is at most {LARGEST_RATIO:g}, got {self.semi_axes}"
            )

    @Lazy
    def expanded(self) -> Node:
        """Return a ball of radius 1 under a scale and a translation."""
        width = None if self.width is None else self.width / float(np.cbrt(np.prod(self.semi_axes)))
        ball = Point((0.0, 0.0, 0.0), radius=1.0, **self.shared | {"width": width})
        return ball.transform(np.column_stack([np.diag(self.semi_axes), self.center]))


@wp.func
def beside_axis(q: wp.vec3, start: wp.vec3, way: wp.vec3) -> wp.vec4:
    """Return the way across from the axis to q, and the distance of q along the axis from its start."""
    axis = wp.normalize(way)
    w = q - start
    x = wp.dot(w, axis)
    c = w - axis * x
    return wp.vec4(c[0], c[1], c[2], x)


class Cylinder(SolidPrimitive):
    """A solid cylinder with rounded edges: everything within `radius` of the cylinder.

    With `radius` 0 its edges are sharp, its field is that of the signed distance, and its width grows with
    the largest ball inside.

    Raises
    ------
    InvalidNode
        The axis has no length: then use a `Disc`.

    Examples
    --------
    >>> from blobtree import Cylinder
    >>> drum = Cylinder((0, 0, 0), (0, 0, 2), 1.0, radius=0.1)
    >>> drum([[1.1, 0, 1], [0.5, 0, 2.1], [0, 0, 1]]).round(3).tolist()
    [0.5, 0.5, 1.0]
    """

    convex = True

    start: Vector = par.point("start of the axis")
    end: Vector = par.point("end of the axis")
    cylinder_radius: float = par.length("radius of the cylinder, without its rounded edge")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start == self.end:
            raise InvalidNode(f"end: expected another point than the start {self.start}; use a Disc")

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of octagons around both ends."""
        axes = columns["end"] - columns["start"]
        ends = [octagons(columns[name], axes, columns["cylinder_radius"]) for name in ("start", "end")]
        return np.concatenate(ends, axis=1)

    @classmethod
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start; axis and radius of the cylinder."""
        axes = columns["end"] - columns["start"]
        return np.concatenate([columns["start"], axes, columns["cylinder_radius"]], axis=1)

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the radii of the cylinders, or half their lengths where that is less."""
        axes = np.array([leaf.end for leaf in leaves]) - [leaf.start for leaf in leaves]
        radii = [leaf.cylinder_radius for leaf in leaves]
        inradii: Float64Array = np.minimum(radii, 0.5 * np.linalg.norm(axes, axis=1))
        return inradii

    @formula
    def closest(q: wp.vec3, start: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
        """`axis` leads from the start to the end; `size` is the radius of the cylinder."""
        length = wp.length(axis)
        place = beside_axis(q, start, axis)
        c = wp.vec3(place[0], place[1], place[2])
        across = wp.length(c)
        if across > size:
            c *= size / across
        elif place[3] >= 0.0 and place[3] <= length:
            return q
        c += wp.normalize(axis) * wp.clamp(place[3], 0.0, length)
        return start + c

    @formula
    def depth(q: wp.vec3, start: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.float32:
        """Return the distance from side and ends, below 0 outside."""
        place = beside_axis(q, start, axis)
        across = wp.length(wp.vec3(place[0], place[1], place[2]))
        return wp.min(wp.min(place[3], wp.length(axis) - place[3]), size - across)


class HalfSpace(Pieces):
    """All that lies below a plane, clipped by bounds: its field is exact within `extent` of a point.

    It is a solid `Cylinder` with rounded edges, below the plane, whose radius and depth are `extent`. Choose
    an extent larger than the model that it blends with or cuts.

    Examples
    --------
    >>> from blobtree import HalfSpace
    >>> ground = HalfSpace((0, 0, 1), (0, 0, 1), 10.0, radius=0.2)
    >>> ground([[3, 4, 1], [0, 0, 0.5], [0, 0, 2]]).round(3).tolist()
    [0.5, 1.0, 0.0]
    """

    file_tag = "half_space"

    point: Vector = par.point("a point of the plane, the middle of the bounds")
    normal: Vector = par.direction("outward normal of the plane, of any length")
    extent: float = par.length("distance from the point up to which it is exact")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges: how far it blends; 0 for sharp ones", low=0.0)

    @Lazy
    def expanded(self) -> Node:
        """Return a cylinder whose rounded top touches the plane."""
        (normal,) = unit_vectors(np.array([self.normal]))
        top = np.array(self.point) - self.radius * normal
        start, end = tuple(top.tolist()), tuple((top - self.extent * normal).tolist())
        return Cylinder(start, end, self.extent, radius=self.radius, **self.shared)
