"""Direct fields as leaves of a tree: each a function of position, with a bounded support and a colour.

A new one is a row of a table of `FieldKind` and a class here. The class names that row, declares its
parameters, and returns a box outside which the field is 0. If the formula reads its parameters in the order
of declaration, `texels` need not be written.
"""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from blobtree._typing import Box, Float64Array
from blobtree.declare.parameters import Color, Parameter, Quantity, columns_of, parameters_of
from blobtree.errors import InvalidNode
from blobtree.formulas.direct_fields import GYROID, GYROID_SLOPE, NOISE, SUPERQUADRIC
from blobtree.formulas.falloff import RIM
from blobtree.formulas.fields import FieldKind
from blobtree.formulas.noise import MEAN_NOISE_SLOPE
from blobtree.nodes.primitives import DEFAULT_COLOR, PROFILE, Columns, Leaf, Profile
from blobtree.tape.program import ProgramField, profile_extent, profile_factor
from blobtree.validation import Vector

BOX_MARGIN = 2e-6
"""Relative widening of boxes, so that float32 leaves nothing of a field outside."""


class FieldPrimitive(Leaf, ProgramField):
    """A direct field and a colour: a leaf of the tree.

    Its field is a function of the point itself, not of the distance from a skeleton. Every one has a
    `weight`. Only those whose function is some distance take a `falloff`.

    Examples
    --------
    >>> from blobtree import FieldPrimitive, Gyroid, Point, Superquadric
    >>> [issubclass(kind, FieldPrimitive) for kind in (Gyroid, Superquadric, Point)]
    [True, True, False]
    """

    field_kind: ClassVar[FieldKind]

    def __new__(cls, *_: Any, **named: Any) -> Self:
        """Refuse a falloff or a width that has no meaning."""
        for name in PROFILE:
            if name in named and name not in parameters_of(cls):
                raise InvalidNode(
                    f"{name}: expected none, a {cls.__name__} is no function of a distance; it takes a weight"
                )
        return super().__new__(cls)

    @property
    def mean_radius(self) -> float:
        """Distance of the surface, to which a width is relative; for kinds with a width."""
        raise NotImplementedError

    @property
    def profile_factor(self) -> float:
        """Factor k of `evaluators.profile_distance`."""
        falloff, width, _ = self.profile
        return 1.0 if width is None else profile_factor(falloff, width, self.mean_radius)

    def grown(self, distance: float) -> Self:
        """Refuse an offset; kinds with a measure of size replace this."""
        raise InvalidNode(
            f"offset: expected primitives with a radius, got a {type(self).__name__}; scale it instead"
        )

    @classmethod
    def boxes(cls, leaves: Sequence[Any]) -> Box:
        """Return lower and upper corners (n, 3) of boxes outside which the fields of n leaves are 0."""
        lower, upper = cls.box(cls._columns(leaves))
        margin = BOX_MARGIN * (upper - lower)
        if cls.field_kind.distance and not cls.field_kind.windowed:
            farther = [
                leaf.profiled and profile_extent(leaf.profile[0], leaf.profile_factor) - 1.0
                for leaf in leaves
            ]
            margin += 0.5 * np.array(farther)[:, None] * (upper - lower)
        return lower - margin, upper + margin

    @classmethod
    def inradii(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return half the shortest sides of boxes that are as much smaller than the supports as balls are."""
        lower, upper = cls.boxes(leaves)
        inradii: Float64Array = 0.5 * RIM * (upper - lower).min(axis=1)
        return inradii

    @classmethod
    def packed_fields(cls, leaves: Sequence[Any]) -> Float64Array:
        """Return the parameters (n, ·, 4) on the tape of n leaves of this kind."""
        return cls.texels(cls._columns(leaves))

    @classmethod
    def box(cls, columns: Columns) -> Box:
        """Return the corners (n, 3) of boxes around n supports, from the leaves' parameters."""
        raise NotImplementedError

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return parameters as texels (n, ·, 4); by default the numbers follow each other as declared."""
        numbers = np.concatenate(list(columns.values()), axis=1)
        texels = 4 * cls.field_kind.parameters
        return np.pad(numbers, ((0, 0), (0, texels - numbers.shape[1]))).reshape(len(numbers), -1, 4)

    @classmethod
    def _columns(cls, leaves: Sequence[Any]) -> Columns:
        """Return the values (n, size) of the parameters of n leaves by name, without their colours."""
        return {
            name: columns_of(leaves, parameter)
            for name, parameter in parameters_of(cls).items()
            if parameter.quantity not in (Quantity.COLOR, Quantity.ATTRIBUTES) and name not in PROFILE
        }


@dataclass(frozen=True, eq=False, repr=False)
class Superquadric(Profile, FieldPrimitive):
    """A superquadric ellipsoid: a box with rounded edges, a cylinder, an ellipsoid, a diamond (Barr 1981).

    Its field is g(RIM · h) with h = ((X^(2/ε₂) + Y^(2/ε₂))^(ε₂/ε₁) + Z^(2/ε₁))^(ε₁/2), where X, Y and Z are
    the distances from the centre in semi-axes. This norm is 1 on the surface. A `width` is one at the mean
    semi-axis ∛(abc), and in proportion to the others.

    Examples
    --------
    >>> from blobtree import Superquadric
    >>> pillow = Superquadric((0, 0, 0), (2, 1, 1), 0.5, 0.5)
    >>> pillow([[2, 0, 0], [0, 1, 0], [0, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 1.0]
    """

    file_tag = "superquadric"
    field_kind = SUPERQUADRIC

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre")]
    semi_axes: Annotated[Vector, Parameter(Quantity.SEMI_AXES, "visible radii along x, y and z, above 0")]
    vertical: Annotated[
        float,
        Parameter(Quantity.FACTOR, "exponent ε₁ between z and the others: 0.1 square, 1 round, 2 a diamond",
                  low=0.1, high=2.0, hint="above 2 edges are concave, without a slope bound"),
    ] = 1.0  # fmt: skip
    horizontal: Annotated[
        float,
        Parameter(Quantity.FACTOR, "exponent ε₂ between x and y", low=0.1, high=2.0,
                  hint="above 2 edges are concave, without a slope bound"),
    ] = 1.0  # fmt: skip
    _: KW_ONLY
    color: Color = DEFAULT_COLOR

    @property
    def mean_radius(self) -> float:
        """The geometric mean of the semi-axes."""
        return float(np.cbrt(np.prod(self.semi_axes)))

    def grown(self, distance: float) -> "Superquadric":
        """Return this superquadric with semi-axes longer by a distance."""
        if min(self.semi_axes) + distance <= 0.0:
            raise InvalidNode(f"offset: {distance:g} leaves nothing of {self!r}")
        x, y, z = self.semi_axes
        return replace(self, semi_axes=(x + distance, y + distance, z + distance))

    @classmethod
    def box(cls, columns: Columns) -> Box:
        """Return the boxes in which h ≤ 1 / RIM."""
        half = columns["semi_axes"] / RIM
        return columns["center"] - half, columns["center"] + half

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return centre and 2/ε₂; reciprocals of the semi-axes and 2/ε₁; the largest slope of the norm."""
        inverses = 1.0 / columns["semi_axes"]
        powers = 2.0 / np.concatenate([columns["horizontal"], columns["vertical"]], axis=1)
        # A p-norm of two numbers exceeds their Euclidean norm by at most 2^(1/p − 1/2), for p < 2.
        excess = 2.0 ** np.maximum(1.0 / powers - 0.5, 0.0).sum(axis=1, keepdims=True)
        slopes = inverses.max(axis=1, keepdims=True) * excess
        rest = np.zeros((len(inverses), 3))
        numbers = [columns["center"], powers[:, :1], inverses, powers[:, 1:], slopes, rest]
        return np.concatenate(numbers, axis=1).reshape(-1, 3, 4)


@dataclass(frozen=True, eq=False, repr=False)
class BoxedField(FieldPrimitive):
    """A field that has no end of its own and fills a box: the base of such leaves.

    Its function sees points from the middle of the box. It is multiplied by a window that falls from 1 to 0
    inside the faces of the box, see `formulas.windows`.
    """

    center: Annotated[Vector, Parameter(Quantity.POINT, "middle of the box, and origin of the function")]
    size: Annotated[Vector, Parameter(Quantity.EXTENTS, "lengths of the box along x, y and z, above 0")]
    _: KW_ONLY
    fade: Annotated[
        float,
        Parameter(Quantity.FACTOR, "share of the way from each face to the middle on which the field fades",
                  low=0.001, high=1.0, hint="a field needs some way to fade to 0"),
    ] = 0.2  # fmt: skip
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        if min(self.size) <= 0.0:
            raise InvalidNode(f"size: expected three numbers above 0, got {self.size!r}")

    @classmethod
    def box(cls, columns: Columns) -> Box:
        """Return the boxes."""
        half = 0.5 * columns["size"]
        return columns["center"] - half, columns["center"] + half

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the middle and `fade`, the half lengths, then the numbers of the kind."""
        numbers = [columns["center"], columns["fade"], 0.5 * columns["size"], cls.numbers(columns)]
        return super().texels({str(place): part for place, part in enumerate(numbers)})

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return the numbers (n, ·) of the function; by default its parameters as declared."""
        own = [columns[name] for name in columns if name not in parameters_of(BoxedField)]
        return np.concatenate([np.empty((len(columns["fade"]), 0)), *own], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Gyroid(Profile, BoxedField):
    """A wall along a gyroid, the minimal surface without straight lines (Schoen 1970).

    Its field is g(RIM · G / τ) with G = sin X cos Y + sin Y cos Z + sin Z cos X, X = 2π x / period. τ is half
    the thickness times the mean slope of G on the gyroid, so the wall is up to 13 % thinner and 8 % thicker.

    Examples
    --------
    >>> from blobtree import Gyroid
    >>> lattice = Gyroid((0, 0, 0), (4, 4, 4), period=2.0, thickness=0.1)
    >>> lattice([[0, 0, 0], [0, 0, 0.25]]).tolist()
    [1.0, 0.0]
    """

    file_tag = "gyroid"
    field_kind = GYROID

    period: Annotated[float, Parameter(Quantity.LENGTH, "length after which the wall repeats")]
    thickness: Annotated[float, Parameter(Quantity.LENGTH, "mean thickness of the wall")]

    @property
    def mean_radius(self) -> float:
        """Half the thickness."""
        return 0.5 * self.thickness

    def grown(self, distance: float) -> "Gyroid":
        """Return this gyroid with a wall that is thicker by the distance on both sides."""
        if self.thickness + 2.0 * distance <= 0.0:
            raise InvalidNode(f"offset: {distance:g} leaves nothing of {self!r}")
        return replace(self, thickness=self.thickness + 2.0 * distance)

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return 2π / period, and RIM / τ."""
        rate = 2.0 * np.pi / columns["period"]
        return np.concatenate([rate, RIM / (0.5 * columns["thickness"] * rate * GYROID_SLOPE)], axis=1)


@dataclass(frozen=True, eq=False, repr=False)
class Noise(BoxedField):
    """Random lumps: where gradient noise n (Perlin 2002) is above a level.

    Its field is t²(3 − 2t) with t = ½ + (n − level) / (2 softness), between 0 and 1. The noise lies between
    −1.04 and 1.04, mostly between −½ and ½.

    Examples
    --------
    >>> from blobtree import Noise
    >>> rock = Noise((0, 0, 0), (4, 4, 4), wavelength=1.0, level=0.0)
    >>> rock([[0, 0, 0], [9, 0, 0]]).tolist()
    [0.5, 0.0]
    """

    file_tag = "noise"
    field_kind = NOISE

    wavelength: Annotated[float, Parameter(Quantity.LENGTH, "distance between the noise's lattice points")]
    level: Annotated[float, Parameter(Quantity.FACTOR, "value of the noise on the surface")] = 0.0
    softness: Annotated[
        float,
        Parameter(Quantity.FACTOR, "difference of the noise over which the field fades", low=0.01, high=10.0,
                  hint="a smaller one makes the field too steep"),
    ] = 0.3  # fmt: skip
    seed: Annotated[
        int,
        Parameter(Quantity.NUMBERS, "whole number that chooses the noise", low=0, high=288, whole=True),
    ] = 0

    def grown(self, distance: float) -> "Noise":
        """Return this noise at a lower level, so that its surface moves by about the distance."""
        return replace(self, level=self.level - distance * MEAN_NOISE_SLOPE / self.wavelength)

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return 1 / wavelength, the level, 1 / (2 softness) and the seed."""
        parts = [1.0 / columns["wavelength"], columns["level"], 0.5 / columns["softness"], columns["seed"]]
        return np.concatenate(parts, axis=1)
