"""Primitives: the leaves of a tree, each a skeleton with a visible radius and a colour.

A new primitive is a row of `formulas.skeletons` and a class here. The class names that row, declares its
parameters, and returns points whose convex hull holds the skeleton. If the formula reads its parameters in
the order of declaration, `texels` need not be written. Falloff, width and weight are those of every primitive
(`Profile`).
"""

import inspect
from collections.abc import Sequence
from dataclasses import KW_ONLY, Field, dataclass, field
from itertools import product
from typing import Annotated, Any, ClassVar, Self, cast, dataclass_transform

import numpy as np

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.falloff import Falloff
from blobtree.declare.formula import Declared
from blobtree.declare.parameters import (
    OPTIONAL,
    Color,
    Parameter,
    Quantity,
    Radius,
    columns_of,
    mapped,
    parameters_of,
    unit_vectors,
)
from blobtree.formulas.skeletons import BOX, CIRCLE, CONE, DISC, POINT, SEGMENT, Skeleton
from blobtree.kinds.falloff import WYVILL
from blobtree.nodes.attributes import NO_ATTRIBUTES, AttributeMapping
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.node import Node
from blobtree.tape.program import ProgramPrimitive
from blobtree.validation import Vector

DEFAULT_COLOR: Any = (0.8, 0.8, 0.8)

SHORTEST_AXIS = 1e-12
"""Squared length of an axis, over squared influence radius, below which a segment is a point."""

INFLUENCE_SLOT = 3
"""Place of the influence radius among the parameters on the tape, in floats: beside a first point."""

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
"""Corners (8, 3) of a cube around the origin."""

OCTAGON_ANGLES = np.arange(8) * (np.pi / 4.0)

Columns = dict[str, Float64Array]
"""Values (n, size) of n primitives by the names of their parameters."""


LARGEST_WEIGHT = 1000.0

OPTIONAL_FIELD = {OPTIONAL: True}
"""Metadata of fields that texts and files leave out at their defaults."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LeafKeywords:
    """The keywords that every leaf has."""

    attributes: Annotated[
        AttributeMapping,
        Parameter(Quantity.ATTRIBUTES, "numbers, vectors and labels by name"),
    ] = field(default=NO_ATTRIBUTES, metadata=OPTIONAL_FIELD)
    weight: Annotated[
        float,
        Parameter(
            Quantity.FACTOR,
            "factor of the field; below 0 it carves in a sum and does nothing elsewhere",
            low=-LARGEST_WEIGHT,
            high=LARGEST_WEIGHT,
            hint="for more take a larger radius",
        ),
    ] = field(default=1.0, metadata=OPTIONAL_FIELD)

    @property
    def profile(self) -> tuple[Falloff, float | None, float]:
        """Falloff, width (None in proportion to the radius) and weight."""
        return WYVILL, None, self.weight


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Falling(LeafKeywords):
    """The keyword of leaves whose field is a function of a distance."""

    falloff: Annotated[
        Falloff | type[Falloff] | str,
        Parameter(Quantity.FALLOFF, "how the field falls off with the distance, or its name"),
    ] = field(default=WYVILL, metadata=OPTIONAL_FIELD)

    @property
    def profile(self) -> tuple[Falloff, float | None, float]:
        """Falloff, width (None in proportion to the radius) and weight."""
        return cast(Falloff, self.falloff), None, self.weight


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Profile(Falling):
    """The keywords of leaves that show a radius, whatever falloff and width they have."""

    width: Annotated[
        float | None,
        Parameter(
            Quantity.WIDTH, "distance beyond the surface over which it blends; None grows with the radius"
        ),
    ] = field(default=None, metadata=OPTIONAL_FIELD)

    @property
    def profile(self) -> tuple[Falloff, float | None, float]:
        """Falloff, width (None in proportion to the radius) and weight."""
        return cast(Falloff, self.falloff), self.width, self.weight


PROFILE = ("falloff", "width", "weight")
"""Names of the keywords that every primitive has."""

PLAIN = (WYVILL, None, 1.0)


class Leaf(LeafKeywords, Node):
    """A node without operands: a shape of one colour."""

    color: Color

    @property
    def children(self) -> tuple[Node, ...]:
        """No nodes."""
        return ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.profile != PLAIN:
            object.__setattr__(self, "profiled", True)
            object.__setattr__(self, "signed", self.weight < 0.0)


@dataclass_transform(
    frozen_default=True,
    eq_default=False,
    field_specifiers=(
        field,
        par.factor,
        par.angle,
        par.length,
        par.distance,
        par.radius,
        par.point,
        par.direction,
        par.extents,
        par.semi_axes,
        par.whole,
    ),
)
class DeclaredLeaf(Leaf, DeclaredNode):
    """A leaf of a class with formulas, which ends with the keyword `color`."""

    common = ("color",)

    def __init_subclass__(cls) -> None:
        declares = any(isinstance(value, Declared) for value in vars(cls).values())
        if declares and "color" not in getattr(cls, "__dataclass_fields__", ()):
            cls.__annotations__ = {**inspect.get_annotations(cls), "color": Color}
            cls.color = field(default=DEFAULT_COLOR, kw_only=True)
        super().__init_subclass__()
        if not declares and any(isinstance(value, Field) for value in vars(cls).values()):
            dataclass(frozen=True, eq=False, repr=False)(cls)


class Primitive(Profile, Leaf, ProgramPrimitive):
    """A skeleton with a visible radius, a colour and a `Profile`: a leaf of the tree."""

    skeleton: ClassVar[Skeleton]
    radius: float

    def __init_subclass__(cls) -> None:
        declared = [name for name in PROFILE if name in inspect.get_annotations(cls)]
        if declared:
            raise TypeError(f"{cls.__name__}: every primitive has a parameter {declared[0]!r} already")
        super().__init_subclass__()

    @classmethod
    def radii(cls, primitives: Sequence[ProgramPrimitive]) -> Float64Array:
        """Return the visible radii (n, k) of n primitives of this kind, in the order of declaration."""
        declared = parameters_of(cls).values()
        columns = [columns_of(primitives, item) for item in declared if item.quantity is Quantity.RADIUS]
        return np.concatenate(columns, axis=1)

    @classmethod
    def _skeleton_parameters(cls) -> list[Parameter]:
        """Return the parameters of the skeleton, without those that every primitive has."""
        shared = (Quantity.RADIUS, Quantity.COLOR, Quantity.ATTRIBUTES)
        return [p for p in parameters_of(cls).values() if p.quantity not in shared and p.name not in PROFILE]

    @classmethod
    def hulls(cls, primitives: Sequence[ProgramPrimitive]) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold the skeletons of n primitives of this kind."""
        return cls.hull({item.name: columns_of(primitives, item) for item in cls._skeleton_parameters()})

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return points (n, k, 3) whose convex hulls hold n skeletons; by default their points."""
        points = [
            columns[item.name] for item in cls._skeleton_parameters() if item.quantity is Quantity.POINT
        ]
        return np.stack(points, axis=1)

    @classmethod
    def packed(
        cls,
        primitives: Sequence[ProgramPrimitive],
        influences: Float64Array,
        matrices: Float64Array | None,
    ) -> Float64Array:
        """Return the parameters (n, ·, 4) on the tape of n primitives of this kind.

        Parameters
        ----------
        primitives
            Primitives of this kind.
        influences
            Influence radii (n, k), scaled by the maps already.
        matrices
            Similarity maps (n, 4, 4) that fold into the parameters, None for none.
        """
        columns = {
            item.name: mapped(item.quantity, columns_of(primitives, item), matrices)
            for item in cls._skeleton_parameters()
        }
        return cls.texels(columns, influences)

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return parameters as texels (n, ·, 4), as `formulas.skeletons` reads them.

        By default the numbers follow each other as declared, with the influence radius in INFLUENCE_SLOT.
        """
        count = len(influences)
        numbers = np.concatenate([np.empty((count, 0)), *columns.values()], axis=1)
        head, tail = numbers[:, :INFLUENCE_SLOT], numbers[:, INFLUENCE_SLOT:]
        head = np.pad(head, ((0, 0), (0, INFLUENCE_SLOT - head.shape[1])))
        tail = np.pad(tail, ((0, 0), (0, -tail.shape[1] % 4)))
        return np.concatenate([head, influences[:, :1], tail], axis=1).reshape(count, -1, 4)


class RoundPrimitive(Primitive):
    """A primitive around a circle or a disc, which declares a centre, an axis and a radius in this order."""

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of an octagon around the circle."""
        return octagons(*columns.values())


class JoinedPrimitive(Primitive):
    """A primitive that may be a piece of a longer one, which goes on at its joints (`JOINT_YIELD`)."""

    joint_texels: ClassVar[tuple[int, ...]]
    """Texels of the parameters whose last number marks a joint."""
    joints: tuple[float, ...] = ()
    """These numbers; none if no other piece goes on. They are no parameters of the node."""

    @classmethod
    def packed(
        cls,
        primitives: Sequence[ProgramPrimitive],
        influences: Float64Array,
        matrices: Float64Array | None,
    ) -> Float64Array:
        """Return the parameters (n, ·, 4) on the tape of n primitives, with their joints."""
        texels = super().packed(primitives, influences, matrices)
        none = (0.0,) * len(cls.joint_texels)
        texels[:, cls.joint_texels, 3] = [cast(Self, primitive).joints or none for primitive in primitives]
        return texels

    def joined(self, joints: Sequence[float]) -> Self:
        """Return this new primitive once it has these joints."""
        object.__setattr__(self, "joints", tuple(joints))
        return self


@dataclass(frozen=True, eq=False, repr=False)
class Point(Primitive):
    """A ball.

    Examples
    --------
    >>> from blobtree import Point
    >>> Point((0, 0, 0), radius=1.0)([[1, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "point"
    skeleton = POINT

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the ball")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR


@dataclass(frozen=True, eq=False, repr=False)
class Segment(Primitive):
    """A capsule around a straight line; equal ends make a ball.

    Examples
    --------
    >>> from blobtree import Segment
    >>> Segment((0, 0, 0), (2, 0, 0), radius=0.5)([[1, 0.5, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "segment"
    skeleton = SEGMENT

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the line")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the line")]
    _: KW_ONLY
    radius: Radius
    color: Color = DEFAULT_COLOR

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start and influence radius; axis and 1 / length²."""
        axes = columns["end"] - columns["start"]
        squares = (axes**2).sum(axis=1)
        short = squares <= SHORTEST_AXIS * influences[:, 0] ** 2
        inverses = np.where(short, 0.0, 1.0 / np.where(short, 1.0, squares))
        return np.stack([beside(columns["start"], influences[:, 0]), beside(axes, inverses)], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Cone(Primitive):
    """A round cone: the convex hull of two balls; if one ball holds the other, the larger ball alone.

    Examples
    --------
    >>> from blobtree import Cone
    >>> Cone((0, 0, 0), (2, 0, 0), radius=1.0, end_radius=0.5)([[2.5, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "cone"
    skeleton = CONE

    start: Annotated[Vector, Parameter(Quantity.POINT, "start of the axis")]
    end: Annotated[Vector, Parameter(Quantity.POINT, "end of the axis")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the start")]
    end_radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius at the end")]
    color: Color = DEFAULT_COLOR

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start and influence radius there; axis and influence radius at the end."""
        axes = columns["end"] - columns["start"]
        return np.stack([beside(columns["start"], influences[:, 0]), beside(axes, influences[:, 1])], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Torus(RoundPrimitive):
    """A torus: a tube around a circle.

    Examples
    --------
    >>> from blobtree import Torus
    >>> ring = Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)
    >>> ring([[1.2, 0, 0], [0, 1, 0.2], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    file_tag = "torus"
    skeleton = CIRCLE

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the circle")]
    axis: Annotated[Vector, Parameter(Quantity.DIRECTION, "normal of the circle's plane, of any length")]
    ring_radius: Annotated[float, Parameter(Quantity.LENGTH, "radius of the circle")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius of the tube")]
    color: Color = DEFAULT_COLOR


@dataclass(frozen=True, eq=False, repr=False)
class Disc(RoundPrimitive):
    """A flat disc with a rounded edge: everything within `radius` of the disc.

    Examples
    --------
    >>> from blobtree import Disc
    >>> plate = Disc((0, 0, 0), (0, 0, 1), 1.0, radius=0.1)
    >>> plate([[0.5, 0, 0.1], [1.1, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    file_tag = "disc"
    skeleton = DISC

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the disc")]
    axis: Annotated[Vector, Parameter(Quantity.DIRECTION, "normal of the disc's plane, of any length")]
    disc_radius: Annotated[float, Parameter(Quantity.LENGTH, "radius of the disc, without its edge")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius of the edge, half the thickness")]
    color: Color = DEFAULT_COLOR


@dataclass(frozen=True, eq=False, repr=False)
class Box(Primitive):
    """A solid box with rounded edges, parallel to the axes: everything within `radius` of the box.

    Examples
    --------
    >>> from blobtree import Box
    >>> brick = Box((0, 0, 0), (2, 1, 1), radius=0.1)
    >>> brick([[1.1, 0, 0], [0, 0.6, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 1.0]
    """

    file_tag = "box"
    skeleton = BOX

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the box")]
    size: Annotated[Vector, Parameter(Quantity.EXTENTS, "lengths along x, y and z, without the radius")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius of the edges")]
    color: Color = DEFAULT_COLOR

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of the box."""
        corners: Float64Array = columns["center"][:, None] + 0.5 * columns["size"][:, None] * CORNERS
        return corners

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return half the shortest lengths."""
        inradii: Float64Array = 0.5 * np.array([leaf.size for leaf in leaves]).min(axis=1)
        return inradii


def beside(vectors: Float64Array, numbers: Float64Array) -> Float64Array:
    """Return `vectors` (n, 3) and `numbers` (n,) as texels (n, 4)."""
    return np.column_stack([vectors, numbers])


def octagons(centers: Float64Array, axes: Float64Array, radii: Float64Array) -> Float64Array:
    """Return the corners (n, 8, 3) of regular octagons around circles with radii (n, 1)."""
    normals = unit_vectors(axes)
    smallest = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, smallest)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    cosines, sines = np.cos(OCTAGON_ANGLES)[:, None], np.sin(OCTAGON_ANGLES)[:, None]
    directions = cosines * first[:, None] + sines * second[:, None]
    corners: Float64Array = centers[:, None] + (radii / np.cos(np.pi / 8.0))[:, :, None] * directions
    return corners
