"""Primitives: the leaves of a tree, each a skeleton with a visible radius and a colour.

A kind is a class with its parameters, formulas and claims. Falloff, width and weight are those of every
primitive (`Profile`).

The field of a primitive is g(|q − closest| / influence). Because the closest point minimises that ratio, its
own motion does not enter the gradient (envelope theorem), so gradients are exact; and the ratio changes by at
most 1 / least influence per unit.
"""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, MISSING, Field, dataclass, field, replace
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, cast, dataclass_transform

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float64Array
from blobtree.declare.falloff import Falloff
from blobtree.declare.formula import Declared, formula, is_own
from blobtree.declare.parameters import (
    OPTIONAL,
    SPECIFIED,
    Color,
    Parameter,
    Quantity,
    Radius,
    columns_of,
    mapped,
    parameters_of,
    unit_vectors,
)
from blobtree.declare.readers import named_values
from blobtree.declare.registry import load_libraries
from blobtree.declare.skeleton import (
    BALL_CELLS,
    INFLUENCE_SLOT,
    PLATE_CELLS,
    RESULTS,
    TUBE_CELLS,
    Skeleton,
    SkeletonFormulas,
)
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.formulas.falloff import WYVILL
from blobtree.formulas.skeletons import distance_to_segment, influence_bound
from blobtree.lazy import Lazy
from blobtree.nodes.attributes import NO_ATTRIBUTES, AttributeMapping
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.node import Node
from blobtree.tape.program import ProgramPrimitive
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

DEFAULT_COLOR: Any = (0.8, 0.8, 0.8)

SHORTEST_AXIS = 1e-12
"""Squared length of an axis, over squared influence radius, below which a segment is a point."""

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
"""Corners (8, 3) of a cube around the origin."""

FOLDING = (Quantity.POINT, Quantity.DIRECTION, Quantity.LENGTH)
"""Quantities whose values maps change."""

OCTAGON_ANGLES = np.arange(8) * (np.pi / 4.0)

Columns = dict[str, Float64Array]
"""Values (n, size) of n primitives by the names of their parameters."""


LARGEST_WEIGHT = 1000.0

OPTIONAL_FIELD = {OPTIONAL: True}
"""Metadata of fields that texts and files leave out at their defaults."""


@dataclass_transform(
    frozen_default=True,
    eq_default=False,
    field_specifiers=(field, par.factor, par.angle, par.length, par.distance, par.radius, par.radii,
                      par.point, par.points, par.direction, par.extents, par.semi_axes, par.whole),
)  # fmt: skip
class LeafBase(Node):
    """A node whose parameters make it a dataclass; a kind ends with the keyword `color`."""

    def __init_subclass__(cls) -> None:
        values = list(vars(cls).items())
        declares = any(isinstance(value, Declared) for _, value in values)
        if declares or "file_tag" in vars(cls):
            cls._add_keywords({"color": (Color, DEFAULT_COLOR)})
        super().__init_subclass__()
        declared = any(isinstance(value, Field) and SPECIFIED in value.metadata for _, value in values)
        if declared and not declares:
            dataclass(frozen=True, eq=False, repr=False)(cls)

    @classmethod
    def _add_keywords(cls, keywords: dict[str, tuple[Any, Any]]) -> None:
        """Add fields, each a type and a default, unless the class has them."""
        hints = inspect.get_annotations(cls)
        for name, (hint, default) in keywords.items():
            if name not in hints and name not in getattr(cls, "__dataclass_fields__", ()):
                hints = {**hints, name: hint}
                setattr(cls, name, field(default=default, kw_only=True))
        cls.__annotations__ = hints


@dataclass(frozen=True, eq=False, repr=False)
class LeafKeywords(LeafBase):
    """The keywords that every leaf has."""

    _: KW_ONLY
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


@dataclass(frozen=True, eq=False, repr=False)
class Falling(LeafKeywords):
    """The keyword of leaves whose field is a function of a distance."""

    _: KW_ONLY
    falloff: Annotated[
        Falloff | type[Falloff] | str,
        Parameter(Quantity.FALLOFF, "how the field falls off with the distance, or its name"),
    ] = field(default=WYVILL, metadata=OPTIONAL_FIELD)

    @property
    def profile(self) -> tuple[Falloff, float | None, float]:
        """Falloff, width (None in proportion to the radius) and weight."""
        return cast(Falloff, self.falloff), None, self.weight


@dataclass(frozen=True, eq=False, repr=False)
class Profile(Falling):
    """The keywords of leaves that show a radius, whatever falloff and width they have."""

    _: KW_ONLY
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

    @property
    def plain(self) -> Self:
        """The leaf with the default falloff and width, which has the same surface."""
        return replace(self, falloff=WYVILL, width=None)


PROFILE = ("falloff", "width", "weight")
"""Names of the keywords that every primitive has."""

PLAIN = (WYVILL, None, 1.0)


class Leaf(LeafKeywords):
    """A node without operands: a shape of one colour."""

    if TYPE_CHECKING:
        color: Color = field(default=DEFAULT_COLOR, kw_only=True)
    else:
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


class Primitive(Profile, Leaf, ProgramPrimitive, DeclaredNode):
    """A skeleton with a visible radius, a colour and a `Profile`: a leaf of the tree.

    A kind is a subclass with typed formulas, claims and parameters, which specifiers of `blobtree.par`
    declare. It always has `radius`, and may declare more radii behind it. Formulas are static functions after
    `@formula`. They take the parameters as they are declared, without `radius`, or else the numbers that the
    class method `numbers` returns:

    * ``closest(q)`` returns the point of the skeleton that is closest to a point q: wp.vec3, as wp.vec3.
    * ``closest_with_influence(q)``, in place of it, returns the point c with the least ``|q − c| / s``, and
      the influence radius s there, as wp.vec4. Behind the other parameters it takes `radius` and all further
      radii, as influence radii. The class then has the class method `hull`.
    * ``least_influence()``, optional, returns the least s; by default the least of the radii.

    Attributes
    ----------
    tag
        Name of the kind in files; by default that of the class, in lower case with underscores.
    convex
        Straight lines between points of the skeleton stay in it; rays then take longer steps.
    folds_maps
        Maps of points, directions and lengths move the skeleton along, and all parameters are such. By
        default each primitive under a map carries that map. `check_kind` tries the claim, and `hull`.

    Raises
    ------
    InvalidDefinition
        At the definition of a subclass: a formula has no types or no source, or samples contradict a claim,
        or show that the formula does not return the closest point of any set. Nothing has been compiled by
        then.
    UntranslatableFunction
        A formula leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Primitive, formula, par
    >>> class Rod(Primitive):
    ...     middle: tuple = par.point("middle of the rod")
    ...     half: float = par.length("half its length")
    ...     convex = True
    ...     @formula
    ...     def closest(q: wp.vec3, middle: wp.vec3, half: wp.float32) -> wp.vec3:
    ...         return middle + wp.vec3(wp.clamp(q[0] - middle[0], -half, half), 0.0, 0.0)
    >>> Rod((0, 0, 0), 1.0, radius=0.2)([[0.9, 0.0, 0.0]])
    array([1.], dtype=float32)
    """

    sort = "a primitive"
    hash_name = "CustomPrimitive"
    custom_tags = ("custom_skeleton", "own skeleton")
    row_name = "skeleton"
    formula_results = RESULTS
    needed = ("closest", "closest_with_influence")
    common = ("radius", "color")
    methods = ("numbers", "hull")
    skeleton: ClassVar[Skeleton]
    convex: ClassVar[bool] = False
    folds_maps: ClassVar[bool] = False
    cells: ClassVar[float] = BALL_CELLS
    texels_read: ClassVar[int] = 0
    """Number of texels that formulas take which read the tape themselves."""
    if TYPE_CHECKING:
        radius: float = field(kw_only=True)

        def __init__(self, *parameters: Any, radius: float, **named: Any) -> None: ...
    else:
        radius: float

    def __init_subclass__(cls) -> None:
        declared = [name for name in PROFILE if name in inspect.get_annotations(cls)]
        if declared:
            raise TypeError(f"{cls.__name__}: every primitive has a parameter {declared[0]!r} already")
        if "file_tag" in vars(cls) or any(isinstance(value, Declared) for value in vars(cls).values()):
            cls._add_keywords({"radius": (Radius, MISSING)})
        super().__init_subclass__()

    @classmethod
    def _declaration(cls, tag: str) -> SkeletonFormulas:
        own = cls._skeleton_parameters()
        radii = [p.name for p in parameters_of(cls).values() if p.quantity is Quantity.RADIUS]
        folds = (cls.folds_maps or is_own(cls)) and all(p.quantity in FOLDING for p in own)
        return SkeletonFormulas(
            tag, cls._formulas, tuple(radii), folds, cls.convex, cls.cells, cls.texels_read
        )

    @classmethod
    def _check(cls, declaration: SkeletonFormulas) -> None:
        from blobtree.declare.skeleton_checks import check_skeleton

        plain = declaration.size == 3 and is_own(cls.numbers)
        packed = dict if plain else lambda values: cls._formula_values(values, declaration)
        if is_own(cls.hull) and declaration.size == 4:
            raise InvalidDefinition(
                f"{cls.__qualname__}: expected the class method `hull`, because its influence varies"
            )
        check_skeleton(declaration, cls.parameters, packed)

    @classmethod
    def _formula_values(cls, values: dict[str, Any], declaration: SkeletonFormulas) -> dict[str, Any]:
        """Return the numbers of the formulas for values of the parameters."""
        columns = rows_of({"radius": 1.0, **values})
        influences = np.concatenate([columns.pop(name) for name in declaration.radii], axis=1)
        types = {name: kind for name, kind in declaration.numbers.items() if name != declaration.radii[0]}
        found = named_values(types, cls.numbers(columns, influences)[0].tolist())
        found[declaration.radii[0]] = float(influences[0, 0])
        return {name: found[name] for name in declaration.numbers}

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
        if cls.digest and is_own(cls.hull):
            from blobtree.nodes.bounds_kernels import far_hulls

            return far_hulls(cls, primitives)
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
        """Return the numbers as texels (n, ·, 4), with the influence radius in INFLUENCE_SLOT."""
        numbers = cls.numbers(columns, influences)
        head, tail = numbers[:, :INFLUENCE_SLOT], numbers[:, INFLUENCE_SLOT:]
        head = np.pad(head, ((0, 0), (0, INFLUENCE_SLOT - head.shape[1])))
        tail = np.pad(tail, ((0, 0), (0, -tail.shape[1] % 4)))
        return np.concatenate([head, influences[:, :1], tail], axis=1).reshape(len(numbers), -1, 4)

    @classmethod
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the numbers (n, ·) of the formulas but the influence radius; by default as declared."""
        return np.concatenate([*columns.values(), influences[:, 1:]], axis=1)


SHARP_FORMS: dict[type, Callable[[Any], Node]] = {}
"""Functions that return the direct field of a solid without a radius, by its kind; the library adds them."""


class SolidPrimitive(Primitive):
    """A primitive around a solid: with a radius of 0 it is that solid, with sharp edges."""

    @property
    def is_sharp(self) -> bool:
        """True if the solid itself is shown."""
        return self.radius == 0.0

    @Lazy
    def sharp(self) -> Node:
        """Return the direct field of the solid."""
        load_libraries()
        return next(SHARP_FORMS[kind] for kind in type(self).__mro__ if kind in SHARP_FORMS)(self)

    @property
    def program_children(self) -> tuple[Node, ...]:
        """The direct field of a sharp solid alone."""
        return (self.sharp,) if self.is_sharp else ()


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
    joints: ClassVar[tuple[float, ...]] = ()
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


class Point(Primitive):
    """A ball.

    Examples
    --------
    >>> from blobtree import Point
    >>> Point((0, 0, 0), radius=1.0)([[1, 0, 0]]).round(3).tolist()
    [0.5]
    """

    tag = "point"
    convex = True

    center: Vector = par.point("centre of the ball")

    @formula
    def closest(q: wp.vec3, center: wp.vec3) -> wp.vec3:
        """Return the centre."""
        return center


class Segment(Primitive):
    """A capsule around a straight line; equal ends make a ball.

    Examples
    --------
    >>> from blobtree import Segment
    >>> Segment((0, 0, 0), (2, 0, 0), radius=0.5)([[1, 0.5, 0]]).round(3).tolist()
    [0.5]
    """

    tag = "segment"
    convex = True
    cells = TUBE_CELLS

    start: Vector = par.point("start of the line")
    end: Vector = par.point("end of the line")

    @formula
    def closest(q: wp.vec3, start: wp.vec3, axis: wp.vec3, inverse: wp.float32) -> wp.vec3:
        """Return the closest point of the line; `inverse` is 1 / length² or 0."""
        return start + axis * wp.clamp(wp.dot(q - start, axis) * inverse, 0.0, 1.0)

    @classmethod
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start, axis and 1 / length²."""
        axes = columns["end"] - columns["start"]
        squares = (axes**2).sum(axis=1)
        short = squares <= SHORTEST_AXIS * influences[:, 0] ** 2
        inverses = np.where(short, 0.0, 1.0 / np.where(short, 1.0, squares))
        return np.column_stack([columns["start"], axes, inverses])


class Cone(SolidPrimitive):
    """A round cone: the convex hull of two balls; if one ball holds the other, the larger ball alone.

    One of both radii may be 0: then it ends in a point, and its field is that of a signed distance.

    Raises
    ------
    InvalidNode
        Both radii are 0.

    Examples
    --------
    >>> from blobtree import Cone
    >>> Cone((0, 0, 0), (2, 0, 0), radius=1.0, end_radius=0.5)([[2.5, 0, 0]]).round(3).tolist()
    [0.5]
    """

    tag = "cone"
    cells = TUBE_CELLS

    start: Vector = par.point("start of the axis")
    end: Vector = par.point("end of the axis")
    _: KW_ONLY
    radius: float = par.radius("visible radius at the start", low=0.0)
    end_radius: float = par.radius("visible radius at the end", low=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.radius == self.end_radius == 0.0:
            raise InvalidNode("end_radius: expected a radius above 0 at one end, got 0 at both")

    @property
    def is_sharp(self) -> bool:
        """True if an end is a point."""
        return self.radius == 0.0 or self.end_radius == 0.0

    @formula
    def closest_with_influence(
        q: wp.vec3, start: wp.vec3, along: wp.vec3, radius: wp.float32, end_radius: wp.float32
    ) -> wp.vec4:
        """Return the closest point of a cone, and the influence radius there.

        With x along the axis and y beside it, (y² + (x − τ)²) / (s₀ + kτ)² is least at
        τ = x + k y² / (s₀ + k x); behind the apex, where s₀ + k x ≤ 0, at the thicker end.
        """
        length = wp.length(along)
        t = float(0.0)
        if length > 0.0:
            axis = wp.normalize(along)
            w = q - start
            x = wp.dot(axis, w)
            beside = w - axis * x
            k = (end_radius - radius) / length
            s = radius + k * x
            if s > 0.0:
                t = wp.clamp((x + k * wp.dot(beside, beside) / s) / length, 0.0, 1.0)
            elif k > 0.0:
                t = 1.0
        elif end_radius > radius:
            t = 1.0
        c = start + along * t
        return wp.vec4(c[0], c[1], c[2], radius + t * (end_radius - radius))

    @formula
    def influence_near(
        q: wp.vec3, c: wp.vec4, start: wp.vec3, along: wp.vec3, radius: wp.float32, end_radius: wp.float32
    ) -> wp.float32:
        """Return `influence_bound` of a cone, whose clearance is the distance from the axis."""
        return influence_bound(q, c, wp.min(radius, end_radius), distance_to_segment(q, start, start + along))

    @classmethod
    def numbers(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return start, axis and the influence radius at the end."""
        return np.column_stack([columns["start"], columns["end"] - columns["start"], influences[:, 1:]])


class Torus(RoundPrimitive):
    """A torus: a tube around a circle.

    Examples
    --------
    >>> from blobtree import Torus
    >>> ring = Torus((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)
    >>> ring([[1.2, 0, 0], [0, 1, 0.2], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 0.0]
    """

    tag = "torus"
    cells = TUBE_CELLS

    center: Vector = par.point("centre of the circle")
    axis: Vector = par.direction("normal of the circle's plane, of any length")
    ring_radius: float = par.length("radius of the circle")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the tube")

    @formula
    def closest(q: wp.vec3, center: wp.vec3, axis: wp.vec3, ring_radius: wp.float32) -> wp.vec3:
        """Return the closest point of the circle; on the axis any of them."""
        w = q - center
        flat = w - axis * wp.dot(w, axis)
        if wp.length(flat) <= 1.0e-6 * wp.length(w):
            flat = wp.cross(axis, wp.vec3(0.0, 1.0, 0.0))
            if wp.abs(axis[0]) < 0.6:
                flat = wp.cross(axis, wp.vec3(1.0, 0.0, 0.0))
        return center + wp.normalize(flat) * ring_radius


class Disc(RoundPrimitive):
    """A flat disc with a rounded edge: everything within `radius` of the disc.

    Examples
    --------
    >>> from blobtree import Disc
    >>> plate = Disc((0, 0, 0), (0, 0, 1), 1.0, radius=0.1)
    >>> plate([[0.5, 0, 0.1], [1.1, 0, 0]]).round(3).tolist()
    [0.5, 0.5]
    """

    tag = "disc"
    convex = True
    cells = PLATE_CELLS

    center: Vector = par.point("centre of the disc")
    axis: Vector = par.direction("normal of the disc's plane, of any length")
    disc_radius: float = par.length("radius of the disc, without its edge")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edge, half the thickness")

    @formula
    def closest(q: wp.vec3, center: wp.vec3, axis: wp.vec3, disc_radius: wp.float32) -> wp.vec3:
        """Return the closest point of the disc."""
        w = q - center
        c = w - axis * wp.dot(w, axis)
        if wp.length(c) > disc_radius:
            c = wp.normalize(c) * disc_radius
        return center + c


class Box(SolidPrimitive):
    """A solid box with rounded edges, parallel to the axes: everything within `radius` of the box.

    With `radius` 0 its edges are sharp, its field is that of the signed distance, and its width grows with
    the shortest side.

    Examples
    --------
    >>> from blobtree import Box
    >>> brick = Box((0, 0, 0), (2, 1, 1), radius=0.1)
    >>> brick([[1.1, 0, 0], [0, 0.6, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 1.0]
    """

    tag = "box"
    convex = True

    center: Vector = par.point("centre of the box")
    size: Vector = par.extents("lengths along x, y and z, without the radius")
    _: KW_ONLY
    radius: float = par.radius("visible radius of the edges, 0 for sharp ones", low=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.radius == min(self.size) == 0.0:
            raise InvalidNode(f"radius: expected one above 0 for a box without thickness, size {self.size}")

    @formula
    def closest(q: wp.vec3, center: wp.vec3, size: wp.vec3) -> wp.vec3:
        """Return the closest point of the box."""
        return wp.vec3(
            wp.clamp(q[0], center[0] - 0.5 * size[0], center[0] + 0.5 * size[0]),
            wp.clamp(q[1], center[1] - 0.5 * size[1], center[1] + 0.5 * size[1]),
            wp.clamp(q[2], center[2] - 0.5 * size[2], center[2] + 0.5 * size[2]),
        )

    @formula
    def depth(q: wp.vec3, center: wp.vec3, size: wp.vec3) -> wp.float32:
        """Return the distance from the faces, below 0 outside."""
        return wp.min(
            wp.min(
                0.5 * size[0] - wp.abs(q[0] - center[0]),
                0.5 * size[1] - wp.abs(q[1] - center[1]),
            ),
            0.5 * size[2] - wp.abs(q[2] - center[2]),
        )

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


def rows_of(values: dict[str, Any]) -> Columns:
    """Return values of one leaf as columns."""
    return {name: np.atleast_2d(np.asarray(value, np.float64)) for name, value in values.items()}


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
