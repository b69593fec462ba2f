"""Profiles: solids whose section is an outline, drawn along a line or turned around an axis."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Any, Self

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import unit_vectors
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.nodes.flats import polygon_in_plane
from blobtree.nodes.node import Node
from blobtree.nodes.outlines import SHORTEST, Outline, Section
from blobtree.nodes.pieces import Pieces
from blobtree.nodes.sections import (
    FAR,
    SectionSolid,
    box_corners,
    end_share,
    face_row,
    mean_distance,
    mean_radius,
    outline_row,
    outline_texels,
    profile_sheet_at,
)
from blobtree.nodes.sharp import SHEET_TOLERANCE, relative_bounds, relative_distance
from blobtree.nodes.sweeps import upright_sweep
from blobtree.tape.program import Slab
from blobtree.texels import Texels
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

WHOLE_TURN = 360.0


@wp.func
def extrusion_place(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the place of q beside the outline of an extrusion, see the head of this file.

    tape[at] = (first texel of the outline, origin); tape[at + 1] = (u, height); tape[at + 2] = (v, ·);
    tape[at + 3] = (offset, mean, ·, ·).
    """
    head = tape[at]
    along = tape[at + 1]
    across = tape[at + 2]
    w = q - wp.vec3(head[1], head[2], head[3])
    u = wp.vec3(along[0], along[1], along[2])
    v = wp.vec3(across[0], across[1], across[2])
    z = wp.dot(w, wp.cross(u, v)) - 0.5 * along[3]
    return wp.vec4(wp.dot(w, u), wp.dot(w, v), wp.abs(z) - 0.5 * along[3], wp.where(z < 0.0, -1.0, 1.0))


@wp.func
def in_extrusion(d: wp.float32, g: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) for a distance and its gradient along u, v and the normal of their plane."""
    along = tape[at + 1]
    across = tape[at + 2]
    u = wp.vec3(along[0], along[1], along[2])
    v = wp.vec3(across[0], across[1], across[2])
    n = u * g[0] + v * g[1] + wp.cross(u, v) * g[2]
    return relative_distance(wp.vec4(d, n[0], n[1], n[2]), tape[at + 3][0], tape[at + 3][1])


@wp.func
def extrusion_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of an extrusion."""
    place = extrusion_place(q, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))
    share = end_share(flat[0], place[2])
    return in_extrusion(
        share[0], wp.vec3(share[1] * flat[1], share[1] * flat[2], share[2] * place[3]), tape, at
    )


@wp.func
def extrusion_bounds(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball."""
    place = extrusion_place(ball, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))[0]
    return relative_bounds(end_share(flat, place[2])[0], radius, tape[at + 3][0], tape[at + 3][1])


@wp.func
def extrusion_sheet_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return `profile_sheet_at`: 1 for the base, 2 for the top."""
    tolerance = SHEET_TOLERANCE * tape[at + 3][1]
    return profile_sheet_at(extrusion_place(q, tape, at), tolerance, tape, int(tape[at][0]))


@wp.func
def extrusion_sheet_value_gradient(q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of the distance from the plane of an end, or from a face."""
    place = extrusion_place(q, tape, at)
    if sheet < 3:
        side = float(2 * sheet - 3)
        height = tape[at + 1][3]
        z = (place[2] + 0.5 * height) * place[3]
        return in_extrusion(side * z - 0.5 * height, wp.vec3(0.0, 0.0, side), tape, at)
    row = face_row(wp.vec2(place[0], place[1]), sheet - 3, tape, int(tape[at][0]))
    return in_extrusion(row[0], wp.vec3(row[1], row[2], 0.0), tape, at)


@wp.func
def from_origin(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec3:
    """Return q from the origin of a revolution.

    tape[at] = (first texel of the outline, origin); tape[at + 1] = (cosine and sine of the angle, normal of
    the plane in its middle); tape[at + 2] = (offset, mean, 1 for a whole turn, ·).
    """
    head = tape[at]
    return q - wp.vec3(head[1], head[2], head[3])


@wp.func
def nearer_end(w: wp.vec3, turn: wp.vec4) -> wp.vec3:
    """Return (direction from the axis, side) of the nearer end of a turn: −1 for its start, 1 for its end."""
    if w[0] * turn[2] + w[1] * turn[3] < 0.0:
        return wp.vec3(1.0, 0.0, -1.0)
    return wp.vec3(turn[0], turn[1], 1.0)


@wp.func
def revolution_place(w: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return the place of w beside the outline, see the head of this file.

    Beyond an end the closest point lies in its plane, since the distance between two points grows with the
    angle between them around the axis. Between the ends it has the same angle as w.
    """
    end = nearer_end(w, tape[at + 1])
    r = wp.length(wp.vec2(w[0], w[1]))
    if tape[at + 2][2] == 1.0:
        return wp.vec4(r, w[2], -FAR, end[2])
    x = w[0] * end[0] + w[1] * end[1]
    beyond = (w[1] * end[0] - w[0] * end[1]) * end[2]
    if beyond > 0.0:
        return wp.vec4(x, w[2], beyond, end[2])
    if x < 0.0:
        beyond = -r
    return wp.vec4(r, w[2], beyond, end[2])


@wp.func
def outward(w: wp.vec3) -> wp.vec3:
    """Return the direction from the axis to w."""
    if w[0] == 0.0 and w[1] == 0.0:
        return wp.vec3(1.0, 0.0, 0.0)
    return wp.normalize(wp.vec3(w[0], w[1], 0.0))


@wp.func
def revolution_value_gradient(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of a revolution."""
    w = from_origin(q, tape, at)
    place = revolution_place(w, tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))
    share = end_share(flat[0], place[2])
    end = nearer_end(w, tape[at + 1])
    across = outward(w)
    normal = wp.vec3(-end[1], end[0], 0.0) * end[2]
    if place[2] > 0.0:
        across = wp.vec3(end[0], end[1], 0.0)
    elif place[2] == -place[0]:
        normal = -across
    g = across * (share[1] * flat[1]) + normal * share[2]
    return relative_distance(
        wp.vec4(share[0], g[0], g[1], share[1] * flat[2]), tape[at + 2][0], tape[at + 2][1]
    )


@wp.func
def revolution_bounds(ball: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball."""
    place = revolution_place(from_origin(ball, tape, at), tape, at)
    flat = outline_row(wp.vec2(place[0], place[1]), tape, int(tape[at][0]))[0]
    return relative_bounds(end_share(flat, place[2])[0], radius, tape[at + 2][0], tape[at + 2][1])


@wp.func
def revolution_sheet_at(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.int32:
    """Return `profile_sheet_at`: 1 for the start of the turn, 2 for its end; the axis is no face."""
    place = revolution_place(from_origin(q, tape, at), tape, at)
    place[0] = wp.max(place[0], 0.0)
    return profile_sheet_at(place, SHEET_TOLERANCE * tape[at + 2][1], tape, int(tape[at][0]))


@wp.func
def revolution_sheet_value_gradient(q: wp.vec3, sheet: wp.int32, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of the distance from the plane of an end, or from a face turned all around."""
    w = from_origin(q, tape, at)
    turn = tape[at + 1]
    shape = tape[at + 2]
    if sheet == 1:
        return relative_distance(wp.vec4(-w[1], 0.0, -1.0, 0.0), shape[0], shape[1])
    if sheet == 2:
        d = w[1] * turn[0] - w[0] * turn[1]
        return relative_distance(wp.vec4(d, -turn[1], turn[0], 0.0), shape[0], shape[1])
    row = face_row(wp.vec2(wp.length(wp.vec2(w[0], w[1])), w[2]), sheet - 3, tape, int(tape[at][0]))
    g = outward(w) * row[1]
    return relative_distance(wp.vec4(row[0], g[0], g[1], row[2]), shape[0], shape[1])


class _Extrusion(SectionSolid):
    """An outline, drawn along the normal of its plane."""

    tag = "sharp_extrusion"
    texels_read = 4
    value_gradient = formula(extrusion_value_gradient)
    bounds = formula(extrusion_bounds)
    sheet_at = formula(extrusion_sheet_at)
    sheet_value_gradient = formula(extrusion_sheet_value_gradient)

    outline: Section
    origin: Vector = par.point("where the outline's origin lies")
    u: Vector = par.direction("direction of the outline's x axis")
    v: Vector = par.direction("direction of the outline's y axis")
    height: float = par.length("length along the normal of the plane")

    @property
    def slabs(self) -> tuple[Slab, ...]:
        """Base and top."""
        normal = np.cross(self.u, self.v)
        middle = self.origin + 0.5 * self.height * normal
        return (Slab(middle, normal, 0.5 * self.height, self.offset),)

    def thickened(self, slab: int, growth: float) -> Self:
        """Return a higher solid, whose field reaches farther in."""
        origin = tuple((self.origin - growth * self.slabs[slab].normal).tolist())
        return replace(self, origin=origin, height=self.height + 2.0 * growth, mean=self.mean + growth)

    @property
    def inner_radius(self) -> float:
        """Half the height, or the mean radius of the outline where that is less."""
        return min(0.5 * self.height, mean_radius(self.outline))

    @property
    def data(self) -> Float64Array:
        """The outline."""
        return outline_texels(self.outline)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the outlines' boxes at both ends."""
        corners = np.array([box_corners(leaf.outline) for leaf in leaves])
        frames = np.array([[leaf.u, leaf.v] for leaf in leaves])
        bases = np.array([[leaf.origin] for leaf in leaves]) + corners @ frames
        ways = np.array([[leaf.height] for leaf in leaves]) * np.cross(*frames.transpose(1, 0, 2))
        return np.concatenate([bases, bases + ways[:, None]], axis=1)

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the outline is filled in later."""
        rows = [
            [0.0, *leaf.origin, *leaf.u, leaf.height, *leaf.v, 0.0, leaf.offset, leaf.mean, 0.0, 0.0]
            for leaf in leaves
        ]
        return np.array(rows, np.float64).reshape(len(rows), 4, 4)


class _Revolution(SectionSolid):
    """An outline, turned around the z axis from the x axis on."""

    tag = "sharp_revolution"
    texels_read = 3
    value_gradient = formula(revolution_value_gradient)
    bounds = formula(revolution_bounds)
    sheet_at = formula(revolution_sheet_at)
    sheet_value_gradient = formula(revolution_sheet_value_gradient)

    outline: Section
    origin: Vector = par.point("where the outline's origin lies")
    angle: float = par.angle("angle of the turn", low=0.0, high=WHOLE_TURN)

    @property
    def inner_radius(self) -> float:
        """The mean radius of the outline, or the length of a turn where that is less."""
        turn = np.radians(self.angle) * mean_distance(self.outline) if self.angle < WHOLE_TURN else np.inf
        return float(min(mean_radius(self.outline), turn))

    @property
    def data(self) -> Float64Array:
        """The outline, without edges on the axis if the turn is whole."""
        return outline_texels(self.outline, around=self.angle == WHOLE_TURN)

    @classmethod
    def hulls(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the corners of the outlines' boxes, at both ends and where the turn passes an axis."""
        corners = np.array([box_corners(leaf.outline) for leaf in leaves])
        quarters = np.array([0.0, 90.0, 180.0, 270.0, 360.0])
        angles = np.radians(np.minimum(quarters, [[leaf.angle] for leaf in leaves]))[:, None]
        x, y = corners[:, :, :1], np.broadcast_to(corners[:, :, 1:], (len(leaves), 4, 5))
        around = np.stack([x * np.cos(angles), x * np.sin(angles), y], axis=-1).reshape(len(leaves), 20, 3)
        return np.array([[leaf.origin] for leaf in leaves]) + around

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the numbers that the formulas read; the index of the outline is filled in later."""
        rows = [
            [0.0, *leaf.origin, np.cos(angle), np.sin(angle), -np.sin(0.5 * angle), np.cos(0.5 * angle),
             leaf.offset, leaf.mean, leaf.angle == WHOLE_TURN, 0.0]
            for leaf, angle in zip(leaves, np.radians([leaf.angle for leaf in leaves]), strict=True)
        ]  # fmt: skip
        return np.array(rows, np.float64).reshape(len(rows), 3, 4)


def _polygon_frame(points: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return unit vectors (2, 3) in the plane of corners (n, 3), counter-clockwise; and the corners there."""
    w = points - points[0]
    (normal,) = unit_vectors(np.cross(w[1:-1], w[2:]).sum(axis=0, keepdims=True))
    u = w[1] - (w[1] @ normal) * normal
    u = u / np.linalg.norm(u)
    axes = np.array([u, np.cross(normal, u)])
    return axes, w @ axes.T


class Prism(Pieces):
    """A solid with a polygon as its base, also a concave one: it rises along the normal of the base.

    The corners of the base are counter-clockwise seen from the top. With `radius` 0 all edges are sharp. With
    a larger one, the solid also holds all points within `radius` of the sharp one. A width grows with the
    radius, or with the mean radius of a sharp prism: the smaller one of half its height and twice the area of
    the base over its perimeter.

    Raises
    ------
    InvalidNode
        There are less than three corners, they do not lie in a plane, or edges cross or touch each other.

    Examples
    --------
    >>> from blobtree import Prism
    >>> wedge = Prism([(0, 0, 0), (2, 0, 0), (0, 1, 0)], 1.0)
    >>> wedge([[0, 0, 0.5], [1, 0.5, 1], [0.5, 0.3, 0.5]]).astype(float).round(3).tolist()
    [0.5, 0.5, 0.972]
    """

    file_tag = "prism"

    points: tuple[Vector, ...] = par.points("corners of the base in order, at least three")
    height: float = par.length("length along the normal of the base")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        polygon_in_plane(self.points)

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        (u, v), corners = _polygon_frame(np.array(self.points))
        axes = tuple(u.tolist()), tuple(v.tolist())
        return _extrusion(Outline.polygon(corners), self.points[0], axes, self)


def _extrusion(
    outline: Outline, origin: Vector, axes: tuple[Vector, Vector], leaf: "Prism | Extrude"
) -> _Extrusion:
    """Return the direct field of an outline that rises to the height of a leaf, in a plane with axes."""
    keywords = {"offset": leaf.radius, **leaf.shared}
    solid = _Extrusion(outline, origin, *axes, leaf.height, mean=1.0, **keywords)
    return replace(solid, mean=leaf.radius or solid.inner_radius)


class Extrude(Pieces):
    """An outline in the xy plane, drawn upward: letters, logos, gears, plates with holes.

    With `radius` 0 all edges are sharp. With a larger one, the solid also holds all points within `radius` of
    the sharp one. A width grows with the radius, or with the mean radius of a sharp solid: the smaller one of
    half its height and twice the area of the outline over its length.

    With a scale or a turn of the top the surface is exact, distances are those within a section, and the
    field is steeper than that of a distance.

    Raises
    ------
    InvalidNode
        The outline is none, see `Outline`.

    Examples
    --------
    >>> from blobtree import Extrude, Outline
    >>> washer = Extrude(Outline.arcs([(-1, 0), (1, 0)], 1) + Outline.arcs([(-0.5, 0), (0.5, 0)], 1), 0.2)
    >>> washer([[0.5, 0, 0.1], [0.75, 0, 0.2], [0, 0, 0.1]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "extrude"

    outline: Section
    height: float = par.length("length along z")
    _: KW_ONLY
    origin: Vector = par.point("where the outline's origin lies", default=(0.0, 0.0, 0.0))
    top_scale: float = par.factor(
        "scale of the top, from the outline's origin", low=0.001, high=1000.0, default=1.0
    )
    top_turn: float = par.angle("angle by which the top is turned around the outline's origin", default=0.0)
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        upright = _extrusion(self.outline, self.origin, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), self)
        if self.top_scale == 1.0 and self.top_turn == 0.0:
            return upright
        changes = {"end_scale": self.top_scale, "end_turn": self.top_turn}
        keywords = {**changes, "offset": self.radius, "mean": upright.mean, **self.shared}
        return upright_sweep(self.outline, self.origin, self.height, **keywords)


class Revolve(Pieces):
    """An outline in the xz plane, turned around the z axis from there: vases, wheels, wedges of them.

    The outline's x is the distance from the axis, and its y is z. With `radius` 0 all edges are sharp. With a
    larger one, the solid also holds all points within `radius` of the sharp one. A width grows with the
    radius, or with the mean radius of a sharp solid: twice the area of the outline over its length,
    and at most the length of the turn at the outline's centroid.

    Raises
    ------
    InvalidNode
        The outline is none, see `Outline`, or it crosses the axis.

    Examples
    --------
    >>> from blobtree import Revolve
    >>> ring = Revolve("M1 0H2V1H1Z")
    >>> ring([[-2, 0, 0.5], [0, 1.5, 1], [0, 0, 0.5]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "revolve"

    outline: Section
    angle: float = par.angle(
        "angle of the turn, counter-clockwise from above", low=0.1, high=WHOLE_TURN, default=WHOLE_TURN
    )
    _: KW_ONLY
    origin: Vector = par.point("where the outline's origin lies", default=(0.0, 0.0, 0.0))
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        (x, y), (to_x, to_y) = self.outline.bounds
        if x < -SHORTEST * max(to_x - x, to_y - y):
            raise InvalidNode(f"outline: expected x from 0, the distance from the axis, got {x:g}; move it")

    @Lazy
    def expanded(self) -> Node:
        """Return the direct field of the solid."""
        keywords = {"offset": self.radius, **self.shared}
        solid = _Revolution(self.outline, self.origin, self.angle, mean=1.0, **keywords)
        return replace(solid, mean=self.radius or solid.inner_radius)
