"""Direct fields as leaves of a tree: each a function of position, with a bounded support and a colour.

A kind is a class with parameters, formulas, claims, and a box outside which the field is 0.
"""

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Box, Float64Array
from blobtree.declare.field import RESULTS, FieldFormulas, FieldKind
from blobtree.declare.field_checks import check_box, check_field
from blobtree.declare.formula import formula, is_own
from blobtree.declare.parameters import Color, Quantity, columns_of, parameters_of
from blobtree.declare.readers import named_values
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.formulas.noise import LARGEST_NOISE, MEAN_NOISE_SLOPE, STEEPEST_NOISE, gradient_noise
from blobtree.formulas.windows import smooth_step, smooth_step_slope, steepest_smooth_step
from blobtree.nodes.declared import DeclaredNode
from blobtree.nodes.primitives import DEFAULT_COLOR, PROFILE, Columns, Falling, Leaf, Profile, rows_of
from blobtree.nodes.tree import ricci_partials
from blobtree.tape.program import ProgramField, profile_extent, profile_factor
from blobtree.validation import Vector

wp.set_module_options({"enable_backward": False})

BOX_MARGIN = 2e-6
"""Relative widening of boxes, so that float32 leaves nothing of a field outside."""

NORM_MARGIN = wp.constant(4e-6)
"""Relative error of powers in float32."""

STEEPEST_GYROID = math.sqrt(3.0)
"""Largest |∇G| of G = sin x cos y + sin y cos z + sin z cos x."""

GYROID_SLOPE = 1.529
"""Mean |∇G| on the surface G = 0; it varies there from √2 to √3."""

LARGEST_GYROID = 1.5
"""Largest |G|."""


class FieldPrimitive(Leaf, ProgramField, DeclaredNode):
    """A direct field and a colour: a leaf of the tree.

    Its field is a function of the point itself, not of the distance from a skeleton. Every one has a
    `weight`. Only those whose function is some distance take a `falloff`.

    A kind is a subclass with typed formulas, claims and parameters, which specifiers of `blobtree.par`
    declare. A `BoxedField` ends at a box; a kind that ends by itself has the class method `box`. Formulas are
    static functions after `@formula`. Behind the point or ball they take the parameters as they are declared,
    or else the numbers that the class method `numbers` returns:

    * ``value(q)`` returns the field at a point q: wp.vec3 as wp.float32, 0 or more and continuous: ½ on the
      surface, larger inside. Its gradient is derived.
    * ``value_gradient(q)``, in place of it, returns the field and its gradient as wp.vec4.
    * ``lipschitz()`` or ``lipschitz(center, radius)``, in place of the number `lipschitz`, returns a bound on
      the length of the gradient as wp.float32: everywhere, or in a ball.
    * ``interval(center, radius)``, optional, returns bounds of the field in a ball as wp.vec2.
    * ``bounds(center, radius)``, in place of both, returns the smallest and the largest value, and the
      largest slope in a ball as wp.vec3.

    Attributes
    ----------
    tag
        Name of the kind in files; by default that of the class, in lower case with underscores.
    lipschitz
        Upper bound of the length of the gradient.
    trial_extent
        Half side of the cube around the origin in which samples try the claims.

    Raises
    ------
    InvalidDefinition
        At the definition of a subclass: a formula has no types or no source, or samples contradict a claim.
        Nothing has been compiled by then.
    UntranslatableFunction
        A formula leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> from blobtree import FieldPrimitive, Gyroid, Point, Superquadric
    >>> [issubclass(kind, FieldPrimitive) for kind in (Gyroid, Superquadric, Point)]
    [True, True, False]
    """

    sort = "a field"
    hash_name = "CustomField"
    custom_tags = ("custom_free_field",)
    row_name = "field_kind"
    formula_results = RESULTS
    needed = ("value", "value_gradient")
    common = ("color",)
    methods = ("numbers", "box")
    field_kind: ClassVar[FieldKind]
    lipschitz: ClassVar[float | None] = None
    trial_extent: ClassVar[float] = 4.0
    texels_read: ClassVar[int] = 0
    """Number of texels that formulas take which read the tape themselves."""

    def __new__(cls, *_: Any, **named: Any) -> Self:
        """Refuse a falloff or a width that has no meaning."""
        for name in PROFILE:
            if name in named and name not in parameters_of(cls):
                raise InvalidNode(
                    f"{name}: expected none, a {cls.__name__} is no function of a distance; it takes a weight"
                )
        return super().__new__(cls)

    @classmethod
    def _declaration(cls, tag: str) -> FieldFormulas:
        boxed, distance = issubclass(cls, BoxedField), issubclass(cls, Falling)
        claims = cls.lipschitz, cls.trial_extent, distance, boxed, cls.texels_read
        return FieldFormulas(tag, cls._formulas, *claims)

    @classmethod
    def _check(cls, declaration: FieldFormulas) -> None:
        """Raise `InvalidDefinition` if samples contradict the class."""
        packed = dict if is_own(cls.numbers) else lambda values: cls._formula_values(values, declaration)
        check_field(declaration, cls.parameters, packed)
        if is_own(cls.box) and not declaration.windowed:
            raise InvalidDefinition(
                f"{cls.__qualname__}: expected the class method `box`, or the base BoxedField"
            )
        if not declaration.windowed:
            check_box(declaration, cls.parameters, packed, lambda values: cls.box(rows_of(values)))

    @classmethod
    def _formula_values(cls, values: dict[str, Any], declaration: FieldFormulas) -> dict[str, Any]:
        """Return the numbers of the formulas for values of the parameters."""
        return named_values(declaration.numbers, cls.numbers(rows_of(values))[0].tolist())

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
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return the numbers (n, ·) of the formulas; by default the parameters as declared."""
        return np.concatenate(list(columns.values()), axis=1)

    @classmethod
    def texels(cls, columns: Columns) -> Float64Array:
        """Return the numbers as texels (n, ·, 4)."""
        return cls._padded(cls.numbers(columns))

    @classmethod
    def _padded(cls, numbers: Float64Array) -> Float64Array:
        """Return numbers (n, ·) as texels (n, ·, 4)."""
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


class BoxedField(FieldPrimitive):
    """A field that has no end of its own and fills a box: the base of such kinds, see `FieldPrimitive`.

    Its formulas see points from the middle of the box. The field is multiplied by a window that falls from 1
    to 0 inside the faces of the box, see `formulas.windows`.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import BoxedField, formula, par
    >>> class Layers(BoxedField):
    ...     period: float = par.length("distance between layers")
    ...     lipschitz = 3.2
    ...     @formula
    ...     def value(q: wp.vec3, period: wp.float32) -> wp.float32:
    ...         return 0.5 + 0.5 * wp.cos(6.2831853 * q[2] / wp.max(period, 1.0))
    >>> Layers((0, 0, 0), (2, 2, 2), period=1.0)([[0, 0, 0], [0, 0, 0.25], [0, 0, 2]]).round(3).tolist()
    [1.0, 0.5, 0.0]
    """

    custom_tags = ("custom_field",)

    center: Vector = par.point("middle of the box, and origin of the function")
    size: Vector = par.extents("lengths of the box along x, y and z, above 0")
    _: KW_ONLY
    fade: float = par.factor(
        "share of the way from each face to the middle on which the field fades",
        low=0.001,
        high=1.0,
        hint="a field needs some way to fade to 0",
        default=0.2,
        natural=0.25,
    )
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
        """Return the middle and `fade`, the half lengths, then the numbers of the formulas."""
        head = [columns["center"], columns["fade"], 0.5 * columns["size"]]
        return cls._padded(np.concatenate([*head, cls.numbers(columns)], axis=1))

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return the numbers (n, ·) of the formulas; by default the kind's own parameters as declared."""
        own = {name: columns[name] for name in columns if name not in parameters_of(BoxedField)}
        return super().numbers(own) if own else np.empty((len(columns["fade"]), 0))


@wp.func
def signed(magnitude: wp.float32, number: wp.float32) -> wp.float32:
    """Return `magnitude` with the sign of `number`."""
    if number < 0.0:
        return -magnitude
    return magnitude


@wp.func
def superquadric_norm(q: wp.vec3, middle: wp.vec3, m: wp.float32, inverse: wp.vec3, n: wp.float32) -> wp.vec4:
    """Return (h, ∇h) of h = ((|x/a|ᵐ + |y/b|ᵐ)^(n/m) + |z/c|ⁿ)^(1/n), which is 1 on the superquadric.

    This is Barr's inside–outside function to the power ε₁/2, with m = 2/ε₂ and n = 2/ε₁. As a norm it grows
    linearly along rays from the centre. `inverse` is (1/a, 1/b, 1/c).
    """
    x = (q[0] - middle[0]) * inverse[0]
    y = (q[1] - middle[1]) * inverse[1]
    z = (q[2] - middle[2]) * inverse[2]
    across = ricci_partials(wp.abs(x), wp.abs(y), m)
    both = ricci_partials(across[0], wp.abs(z), n)
    return wp.vec4(
        both[0],
        signed(both[1] * across[1] * inverse[0], x),
        signed(both[1] * across[2] * inverse[1], y),
        signed(both[2] * inverse[2], z),
    )


_exponent = partial(
    par.factor, low=0.1, high=2.0, hint="above 2 edges are concave, without a slope bound", default=1.0
)


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

    center: Vector = par.point("centre")
    semi_axes: Vector = par.semi_axes("visible radii along x, y and z, above 0")
    vertical: float = _exponent("exponent ε₁ between z and the others: 0.1 square, 1 round, 2 a diamond")
    horizontal: float = _exponent("exponent ε₂ between x and y")

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
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return centre and 2/ε₂; reciprocals of the semi-axes and 2/ε₁; the largest slope of the norm."""
        inverses = 1.0 / columns["semi_axes"]
        powers = 2.0 / np.concatenate([columns["horizontal"], columns["vertical"]], axis=1)
        # A p-norm of two numbers exceeds their Euclidean norm by at most 2^(1/p − 1/2), for p < 2.
        excess = 2.0 ** np.maximum(1.0 / powers - 0.5, 0.0).sum(axis=1, keepdims=True)
        slopes = inverses.max(axis=1, keepdims=True) * excess
        return np.concatenate([columns["center"], powers[:, :1], inverses, powers[:, 1:], slopes], axis=1)

    @formula
    def value_gradient(
        q: wp.vec3, middle: wp.vec3, m: wp.float32, inverse: wp.vec3, n: wp.float32, steepest: wp.float32
    ) -> wp.vec4:
        """Return (u, ∇u) of u = RIM · h."""
        return superquadric_norm(q, middle, m, inverse, n) * RIM

    @formula
    def bounds(
        center: wp.vec3,
        radius: wp.float32,
        middle: wp.vec3,
        m: wp.float32,
        inverse: wp.vec3,
        n: wp.float32,
        steepest: wp.float32,
    ) -> wp.vec3:
        """Bound u over a ball; `steepest` is the largest slope of h, which is that of a norm."""
        slope = RIM * steepest
        u = RIM * superquadric_norm(center, middle, m, inverse, n)[0]
        nearest = u * (1.0 - NORM_MARGIN) - slope * radius
        return wp.vec3(nearest, u * (1.0 + NORM_MARGIN) + slope * radius, slope)


@wp.func
def gyroid(x: wp.vec3, rate: wp.float32) -> wp.vec4:
    """Return (G, ∇G) of G = sin X cos Y + sin Y cos Z + sin Z cos X with X = rate · x (Schoen 1970)."""
    p = x * rate
    sx = wp.sin(p[0])
    sy = wp.sin(p[1])
    sz = wp.sin(p[2])
    cx = wp.cos(p[0])
    cy = wp.cos(p[1])
    cz = wp.cos(p[2])
    return wp.vec4(
        sx * cy + sy * cz + sz * cx,
        rate * (cx * cy - sz * sx),
        rate * (cy * cz - sx * sy),
        rate * (cz * cx - sy * sz),
    )


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

    period: float = par.length("length after which the wall repeats")
    thickness: float = par.length("mean thickness of the wall")

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

    @formula
    def value_gradient(q: wp.vec3, rate: wp.float32, scale: wp.float32) -> wp.vec4:
        """Return (u, ∇u) of u = |G| · scale."""
        u = gyroid(q, rate) * scale
        if u[0] < 0.0:
            return -u
        return u

    @formula
    def bounds(center: wp.vec3, radius: wp.float32, rate: wp.float32, scale: wp.float32) -> wp.vec3:
        """Bound u over a ball, in which |G| changes by at most √3 · rate · radius."""
        steepest = STEEPEST_GYROID * rate * scale
        u = wp.abs(gyroid(center, rate)[0] * scale)
        nearest = wp.max(u - steepest * radius, 0.0)
        farthest = wp.min(u + steepest * radius, LARGEST_GYROID * scale)
        return wp.vec3(nearest, wp.max(farthest, nearest), steepest)


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

    wavelength: float = par.length("distance between the noise's lattice points")
    level: float = par.factor("value of the noise on the surface", default=0.0)
    softness: float = par.factor(
        "difference of the noise over which the field fades",
        low=0.01,
        high=10.0,
        hint="a smaller one makes the field too steep",
        default=0.3,
        natural=0.2,
    )
    seed: int = par.whole("whole number that chooses the noise", low=0, high=288, default=0, natural=1)

    def grown(self, distance: float) -> "Noise":
        """Return this noise at a lower level, so that its surface moves by about the distance."""
        return replace(self, level=self.level - distance * MEAN_NOISE_SLOPE / self.wavelength)

    @classmethod
    def numbers(cls, columns: Columns) -> Float64Array:
        """Return 1 / wavelength, the level, 1 / (2 softness) and the seed."""
        parts = [1.0 / columns["wavelength"], columns["level"], 0.5 / columns["softness"], columns["seed"]]
        return np.concatenate(parts, axis=1)

    @formula
    def value_gradient(
        q: wp.vec3, rate: wp.float32, level: wp.float32, steepness: wp.float32, seed: wp.int32
    ) -> wp.vec4:
        """Return (f, ∇f) of f = s(½ + (n − level) · steepness), s being `smooth_step`."""
        n = gradient_noise(q * rate, seed)
        t = 0.5 + (n[0] - level) * steepness
        slope = smooth_step_slope(t) * steepness * rate
        return wp.vec4(smooth_step(t), slope * n[1], slope * n[2], slope * n[3])

    @formula
    def bounds(
        center: wp.vec3,
        radius: wp.float32,
        rate: wp.float32,
        level: wp.float32,
        steepness: wp.float32,
        seed: wp.int32,
    ) -> wp.vec3:
        """Bound f over a ball, in which the noise changes by at most STEEPEST_NOISE · radius / wavelength."""
        n = gradient_noise(center * rate, seed)[0]
        change = STEEPEST_NOISE * radius * rate
        low = 0.5 + (wp.max(n - change, -LARGEST_NOISE) - level) * steepness
        high = 0.5 + (wp.min(n + change, LARGEST_NOISE) - level) * steepness
        slope = STEEPEST_NOISE * rate * steepness * steepest_smooth_step(low, high)
        return wp.vec3(smooth_step(low), smooth_step(high), slope)
