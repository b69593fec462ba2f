"""Solids with sharp edges: signed distances as direct fields, and the solids that may be sharp or rounded.

A sharp solid has the field g(RIM + d / s) of its exact signed distance d: ½ on its surface, rising inside. It
has `sheets`, the smooth pieces of its surface, so that meshes have its edges where these meet.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Any, Self

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Box as Corners
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import unit_vectors
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.lazy import Lazy
from blobtree.nodes.fields import BOX_MARGIN, FieldPrimitive
from blobtree.nodes.node import Node
from blobtree.nodes.pieces import Pieces, shared_of
from blobtree.nodes.primitives import CORNERS, SHARP_FORMS, Box, Columns, Cone, Profile, octagons
from blobtree.nodes.solids import Cylinder
from blobtree.nodes.volumes import box_distance
from blobtree.tape.program import Slab, profile_extent
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

SHEET_TOLERANCE = wp.constant(1e-4)
"""Distance outside a solid, over its mean radius, up to which a point belongs to a face of it."""

LEAST_RATE = 1e-15
"""Least rate at which the distances from the side and from an end of a cone approach each other."""

DISTANCE_MARGIN = wp.constant(1e-6)
"""Relative error of distances in float32."""


@wp.func
def relative_distance(d: wp.vec4, offset: wp.float32, mean: wp.float32) -> wp.vec4:
    """Return (u, ∇u) of u = RIM · (1 + (d − offset) / mean) for a distance (d, ∇d)."""
    rate = RIM / mean
    return wp.vec4(RIM + (d[0] - offset) * rate, d[1] * rate, d[2] * rate, d[3] * rate)


@wp.func
def relative_bounds(d: wp.float32, radius: wp.float32, offset: wp.float32, mean: wp.float32) -> wp.vec3:
    """Return the bounds of `relative_distance` over a ball: a distance changes by at most 1 per unit."""
    rate = RIM / mean
    u = RIM + (d - offset) * rate
    reach = radius * rate * (1.0 + DISTANCE_MARGIN) + DISTANCE_MARGIN * (1.0 + wp.abs(u))
    return wp.vec3(u - reach, u + reach, rate)


@wp.func
def in_space(row: wp.vec3, q: wp.vec3, start: wp.vec3, axis: wp.vec3) -> wp.vec4:
    """Return (d, ∇d) at q for (d, ∂d across, ∂d along) in the half-plane of an axis from `start`."""
    g = axis * row[2]
    x = wp.dot(q - start, axis)
    beside = q - start - axis * x
    if wp.length(beside) > 0.0:
        g += wp.normalize(beside) * row[1]
    return wp.vec4(row[0], g[0], g[1], g[2])


@wp.func
def farther(a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """Return the row (d, ∇d) of the larger distance."""
    if b[0] > a[0]:
        return b
    return a


@wp.func
def corner_row(p: wp.vec2, corner: wp.vec2, otherwise: wp.vec2) -> wp.vec3:
    """Return (d, ∇d) of the distance from a corner, whose direction in the corner itself is `otherwise`."""
    w = p - corner
    d = wp.length(w)
    if d > 0.0:
        return wp.vec3(d, w[0] / d, w[1] / d)
    return wp.vec3(0.0, otherwise[0], otherwise[1])


@wp.func
def side_row(p: wp.vec2, length: wp.float32, first: wp.float32, last: wp.float32) -> wp.vec3:
    """Return (d, ∇d) of the distance from the side of a cone, whose line is endless."""
    n = wp.normalize(wp.vec2(length, first - last))
    return wp.vec3(n[0] * (p[0] - first) + n[1] * p[1], n[0], n[1])


@wp.func
def frustum_row(p: wp.vec2, length: wp.float32, first: wp.float32, last: wp.float32) -> wp.vec3:
    """Return (d, ∇d) of a cone with flat ends at p = (across, along) in the half-plane of its axis."""
    side = side_row(p, length, first, last)
    start = wp.vec3(-p[1], 0.0, -1.0)
    end = wp.vec3(p[1] - length, 0.0, 1.0)
    deepest = farther(side, farther(start, end))
    if deepest[0] <= 0.0:
        return deepest
    if start[0] > 0.0 and p[0] <= first:
        return start
    if end[0] > 0.0 and p[0] <= last:
        return end
    along = side[1] * p[1] - side[2] * (p[0] - first)
    normal = wp.vec2(side[1], side[2])
    if along < 0.0:
        return corner_row(p, wp.vec2(first, 0.0), normal)
    if along > wp.length(wp.vec2(length, first - last)):
        return corner_row(p, wp.vec2(last, length), normal)
    return side


@wp.func
def half_plane_point(q: wp.vec3, start: wp.vec3, axis: wp.vec3) -> wp.vec2:
    """Return the distance of q from a line, and how far along it."""
    x = wp.dot(q - start, axis)
    return wp.vec2(wp.length(q - start - axis * x), x)


@wp.func
def upward_or(way: wp.vec3) -> wp.vec3:
    """Return the unit vector of a way, the z axis if it has no length."""
    if wp.length(way) > 0.0:
        return wp.normalize(way)
    return wp.vec3(0.0, 0.0, 1.0)


@wp.func
def drop_row(p: wp.vec2, length: wp.float32, radius: wp.float32) -> wp.vec3:
    """Return (d, ∇d) of the hull of a ball at the start of an axis and its end, at p = (across, along)."""
    if length <= radius:
        return corner_row(p, wp.vec2(0.0, 0.0), wp.vec2(1.0, 0.0)) - wp.vec3(radius, 0.0, 0.0)
    rise = radius / length
    n = wp.vec2(wp.sqrt(1.0 - rise * rise), rise)
    t = n[0] * p[1] - n[1] * p[0]
    if t < 0.0:
        return corner_row(p, wp.vec2(0.0, 0.0), n) - wp.vec3(radius, 0.0, 0.0)
    if t > length * n[0]:
        return corner_row(p, wp.vec2(0.0, length), n)
    return wp.vec3(wp.dot(n, p) - radius, n[0], n[1])


class SharpSolid(Profile, FieldPrimitive):
    """A solid by its signed distance d: u = RIM · (1 + (d − offset) / mean); the base of such kinds."""

    _: KW_ONLY
    offset: float = par.distance("distance by which the surface lies outside the solid", default=0.0)
    mean: float = par.length(
        "length to which widths are relative, about the largest ball inside", default=1.0
    )

    @property
    def mean_radius(self) -> float:
        """The length to which a width is relative."""
        return self.mean

    def grown(self, distance: float) -> Self:
        """Return this solid with its surface moved along the normals."""
        larger: Self = replace(self, offset=self.offset + distance)
        if larger.mean + larger.offset <= 0.0:
            raise InvalidNode(
                f"offset: {distance:g} leaves nothing of a solid whose mean radius is {self.mean:g}"
            )
        return larger

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold n solids without their offsets."""
        raise NotImplementedError

    @classmethod
    def radii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the mean radii (n, 1)."""
        return np.array([[leaf.mean] for leaf in leaves])

    @classmethod
    def boxes(cls, leaves: Sequence[Any]) -> Corners:
        """Return boxes around the solids, larger by how far their fields reach."""
        extents = [
            profile_extent(leaf.profile[0], leaf.profile_factor) if leaf.profiled else 1.0 for leaf in leaves
        ]
        reaches = [
            leaf.offset + leaf.mean * (extent / RIM - 1.0)
            for leaf, extent in zip(leaves, extents, strict=True)
        ]
        hulls, margins = cls.hulls(leaves), np.array(reaches)[:, None]
        lower, upper = hulls.min(axis=1), hulls.max(axis=1)
        margins = margins + BOX_MARGIN * (upper - lower + 2.0 * margins)
        return lower - margins, upper + margins

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the radii of the largest balls inside, 0 or less where nothing is left."""
        inner = [leaf.inner_radius if leaf.offset > 0.0 else leaf.mean for leaf in leaves]
        return np.array(inner) + [leaf.offset for leaf in leaves]

    @property
    def inner_radius(self) -> float:
        """About the radius of the largest ball inside the solid without its offset: `mean` of sharp ones."""
        return self.mean


class _SharpBox(SharpSolid):
    """A box parallel to the axes."""

    tag = "sharp_box"

    center: Vector = par.point("centre of the box")
    size: Vector = par.extents("lengths along x, y and z")

    @property
    def slabs(self) -> tuple[Slab, ...]:
        """The faces across x, y and z."""
        sides = zip(np.eye(3), self.size, strict=True)
        return tuple(Slab(np.array(self.center), axis, 0.5 * side, self.offset) for axis, side in sides)

    def thickened(self, slab: int, growth: float) -> Self:
        """Return a larger box, whose field reaches farther in if its largest ball does."""
        size = np.array(self.size) + 2.0 * growth * np.eye(3)[slab]
        larger = replace(self, size=tuple(size.tolist()))
        return replace(larger, mean=self.mean + larger.inner_radius - self.inner_radius)

    @property
    def inner_radius(self) -> float:
        """Half the shortest side."""
        return 0.5 * min(self.size)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the boxes."""
        return Box.hull(cls._columns(leaves))

    @formula
    def value_gradient(
        q: wp.vec3, offset: wp.float32, mean: wp.float32, center: wp.vec3, size: wp.vec3
    ) -> wp.vec4:
        """Return (u, ∇u)."""
        return relative_distance(box_distance(q - center, 0.5 * size), offset, mean)

    @formula
    def bounds(
        ball: wp.vec3,
        radius: wp.float32,
        offset: wp.float32,
        mean: wp.float32,
        center: wp.vec3,
        size: wp.vec3,
    ) -> wp.vec3:
        """Bound u over a ball."""
        return relative_bounds(box_distance(ball - center, 0.5 * size)[0], radius, offset, mean)

    @formula
    def sheet_at(
        q: wp.vec3, offset: wp.float32, mean: wp.float32, center: wp.vec3, size: wp.vec3
    ) -> wp.int32:
        """Return the face: 1 and 2 across x, 3 and 4 across y, 5 and 6 across z."""
        x = q - center
        beyond = wp.vec3(
            wp.abs(x[0]) - 0.5 * size[0], wp.abs(x[1]) - 0.5 * size[1], wp.abs(x[2]) - 0.5 * size[2]
        )
        axis = int(0)
        if beyond[1] > beyond[0]:
            axis = 1
        if beyond[2] > beyond[axis]:
            axis = 2
        if wp.max(beyond[(axis + 1) % 3], beyond[(axis + 2) % 3]) > SHEET_TOLERANCE * mean:
            return 0
        if x[axis] < 0.0:
            return 1 + 2 * axis
        return 2 + 2 * axis

    @formula
    def sheet_value_gradient(
        q: wp.vec3,
        sheet: wp.int32,
        offset: wp.float32,
        mean: wp.float32,
        center: wp.vec3,
        size: wp.vec3,
    ) -> wp.vec4:
        """Return (u, ∇u) of the distance from a face's plane."""
        axis = (sheet - 1) // 2
        way = wp.vec3()
        way[axis] = float(2 * ((sheet - 1) % 2) - 1)
        d = wp.dot(q - center, way) - 0.5 * size[axis]
        return relative_distance(wp.vec4(d, way[0], way[1], way[2]), offset, mean)


class _SharpFrustum(SharpSolid):
    """A cone with flat ends, one of which may be a point."""

    tag = "sharp_frustum"

    start: Vector = par.point("middle of the first end")
    end: Vector = par.point("middle of the last end")
    start_radius: float = par.distance("radius of the first end", low=0.0)
    end_radius: float = par.distance("radius of the last end", low=0.0)

    @property
    def slabs(self) -> tuple[Slab, ...]:
        """The two ends; none if the rim is sharper than 45 degrees, because such a rim stays thin."""
        ends = np.array([self.start, self.end])
        (way,) = np.diff(ends, axis=0)
        length = float(np.linalg.norm(way))
        if abs(self.start_radius - self.end_radius) > length:
            return ()
        return (Slab(ends.mean(axis=0), way / length, 0.5 * length, self.offset),)

    def thickened(self, slab: int, growth: float) -> Self:
        """Return a longer cone, whose field reaches farther in."""
        step = growth * self.slabs[slab].normal
        start, end = np.array([self.start, self.end]) + np.array([-step, step])
        ends = {"start": tuple(start.tolist()), "end": tuple(end.tolist())}
        return replace(self, **ends, mean=self.mean + growth)

    @property
    def inner_radius(self) -> float:
        """The radius of the largest ball inside, whose centre is on the axis."""
        first, last = self.start_radius, self.end_radius
        length = float(np.linalg.norm(np.subtract(self.end, self.start)))
        slant = float(np.hypot(length, first - last))
        widest, slope = first * length / slant, (last - first) / slant
        rates = np.maximum([1.0 - slope, 1.0 + slope], LEAST_RATE)  # nearly 0 in a cone that is almost flat
        middles = np.clip([0.5 * length, *np.array([widest, length - widest]) / rates], 0.0, length)
        return float(np.minimum(np.minimum(middles, length - middles), widest + slope * middles).max())

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of octagons around both ends."""
        columns = cls._columns(leaves)
        axes = columns["end"] - columns["start"]
        ends = [octagons(columns[name], axes, columns[f"{name}_radius"]) for name in ("start", "end")]
        return np.concatenate(ends, axis=1)

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return offset and mean; start, unit axis and length; both radii."""
        axes = columns["end"] - columns["start"]
        length = np.linalg.norm(axes, axis=1, keepdims=True)
        first = [columns["offset"], columns["mean"], columns["start"], unit_vectors(axes), length]
        return np.concatenate([*first, columns["start_radius"], columns["end_radius"]], axis=1)

    @formula
    def value_gradient(
        q: wp.vec3,
        offset: wp.float32,
        mean: wp.float32,
        start: wp.vec3,
        axis: wp.vec3,
        length: wp.float32,
        first: wp.float32,
        last: wp.float32,
    ) -> wp.vec4:
        """Return (u, ∇u)."""
        row = frustum_row(half_plane_point(q, start, axis), length, first, last)
        return relative_distance(in_space(row, q, start, axis), offset, mean)

    @formula
    def bounds(
        ball: wp.vec3,
        radius: wp.float32,
        offset: wp.float32,
        mean: wp.float32,
        start: wp.vec3,
        axis: wp.vec3,
        length: wp.float32,
        first: wp.float32,
        last: wp.float32,
    ) -> wp.vec3:
        """Bound u over a ball."""
        d = frustum_row(half_plane_point(ball, start, axis), length, first, last)[0]
        return relative_bounds(d, radius, offset, mean)

    @formula
    def sheet_at(
        q: wp.vec3,
        offset: wp.float32,
        mean: wp.float32,
        start: wp.vec3,
        axis: wp.vec3,
        length: wp.float32,
        first: wp.float32,
        last: wp.float32,
    ) -> wp.int32:
        """Return 1 for the side, 2 for the first end and 3 for the last."""
        p = half_plane_point(q, start, axis)
        side = side_row(p, length, first, last)[0]
        end = wp.max(-p[1], p[1] - length)
        if wp.min(side, end) > SHEET_TOLERANCE * mean:
            return 0
        if side >= end:
            return 1
        if -p[1] >= p[1] - length:
            return 2
        return 3

    @formula
    def sheet_value_gradient(
        q: wp.vec3,
        sheet: wp.int32,
        offset: wp.float32,
        mean: wp.float32,
        start: wp.vec3,
        axis: wp.vec3,
        length: wp.float32,
        first: wp.float32,
        last: wp.float32,
    ) -> wp.vec4:
        """Return (u, ∇u) of the distance from the endless side, or from the plane of an end."""
        p = half_plane_point(q, start, axis)
        row = side_row(p, length, first, last)
        if sheet == 2:
            row = wp.vec3(-p[1], 0.0, -1.0)
        elif sheet == 3:
            row = wp.vec3(p[1] - length, 0.0, 1.0)
        return relative_distance(in_space(row, q, start, axis), offset, mean)


class _SharpDrop(SharpSolid):
    """The hull of a ball and a point."""

    tag = "sharp_drop"

    center: Vector = par.point("centre of the ball")
    tip: Vector = par.point("the point")

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of boxes around the balls, and the tips."""
        columns = cls._columns(leaves)
        corners = columns["center"][:, None] + columns["mean"][:, None] * CORNERS
        return np.concatenate([corners, columns["tip"][:, None]], axis=1)

    @formula
    def value_gradient(
        q: wp.vec3, offset: wp.float32, mean: wp.float32, center: wp.vec3, tip: wp.vec3
    ) -> wp.vec4:
        """Return (u, ∇u)."""
        axis = upward_or(tip - center)
        row = drop_row(half_plane_point(q, center, axis), wp.length(tip - center), mean)
        return relative_distance(in_space(row, q, center, axis), offset, mean)

    @formula
    def bounds(
        ball: wp.vec3,
        radius: wp.float32,
        offset: wp.float32,
        mean: wp.float32,
        center: wp.vec3,
        tip: wp.vec3,
    ) -> wp.vec3:
        """Bound u over a ball."""
        p = half_plane_point(ball, center, upward_or(tip - center))
        return relative_bounds(drop_row(p, wp.length(tip - center), mean)[0], radius, offset, mean)


class Frustum(Pieces):
    """A cone with flat ends: a truncated one, or a pointed one where one of both radii is 0.

    With `radius` 0 all edges are sharp. With a larger one, the solid also holds all points within `radius` of
    the sharp one. A width grows with the radius, or with that of the largest ball in a sharp one.

    Raises
    ------
    InvalidNode
        The axis has no length, or both radii of the ends are 0.

    Examples
    --------
    >>> from blobtree import Frustum
    >>> tip = Frustum((0, 0, 0), (0, 0, 2), 1.0, 0.0)
    >>> tip([[1, 0, 0], [0, 0, 2], [0.5, 0, 1]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    file_tag = "frustum"

    start: Vector = par.point("middle of the first end")
    end: Vector = par.point("middle of the last end")
    start_radius: float = par.distance("radius of the first end", low=0.0, natural=0.5)
    end_radius: float = par.distance("radius of the last end", low=0.0, natural=0.25)
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.start == self.end:
            raise InvalidNode(f"end: expected another point than the start {self.start}; use a Disc")
        if self.start_radius == self.end_radius == 0.0:
            raise InvalidNode(
                "end_radius: expected a radius above 0 at one end, got 0 at both; use a Segment"
            )

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        return sharp_frustum(self, self.start_radius, self.end_radius)


def sharp_box(box: Any) -> Node:
    """Return the direct field of a box without a radius."""
    return _SharpBox(box.center, box.size, mean=0.5 * min(box.size), **shared_of(box))


def sharp_frustum(solid: Any, first: float, last: float) -> Node:
    """Return the direct field of a cone with flat ends, which has the ends and the radius of a node."""
    frustum = _SharpFrustum(
        solid.start, solid.end, first, last, offset=solid.radius, mean=1.0, **shared_of(solid)
    )
    return replace(frustum, mean=solid.radius or frustum.inner_radius)


def sharp_cylinder(cylinder: Cylinder) -> Node:
    """Return the direct field of a cylinder without a radius."""
    return sharp_frustum(cylinder, cylinder.cylinder_radius, cylinder.cylinder_radius)


def sharp_drop(cone: Cone) -> Node:
    """Return the direct field of a round cone with a radius of 0 at one end."""
    center, tip = (cone.start, cone.end) if cone.end_radius == 0.0 else (cone.end, cone.start)
    return _SharpDrop(center, tip, mean=max(cone.radius, cone.end_radius), **shared_of(cone))


SHARP_FORMS.update({Box: sharp_box, Cylinder: sharp_cylinder, Cone: sharp_drop})
