"""Deformations: nodes that warp their child (Barr 1984), with noise and curve warps.

Each acts along the z axis of its space: transform a model first to deform it along another line. The methods
of `Node` with the same names make them.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.parameters import LARGEST_INTEGER, Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.formulas.deformations import BEND, CURVE, LIMITED_TWIST, NOISE, SHEAR, STRETCH, TAPER
from blobtree.formulas.warps import SpaceWarp
from blobtree.lazy import Lazy
from blobtree.nodes.tree import Placed
from blobtree.validation import Vector

Points = tuple[Vector, ...]

LARGEST_FACTOR = 1e3
"""Largest factor of a taper or a stretch; the smallest is its reciprocal."""

WAVES = 8
"""Plane waves in a noise warp."""

WAVELENGTH_SPREAD = 1.5
"""Longest wavelength of a noise warp over the given one, and that one over the shortest."""

MAX_CURVE_POINTS = 256

FOLD_SAMPLES = 16
"""Samples along each axis at which a curve warp is checked for folds."""

Low = Annotated[float, Parameter(Quantity.DISTANCE, "height below which nothing moves")]
High = Annotated[float, Parameter(Quantity.DISTANCE, "height above which the deformation does not grow")]


@dataclass(frozen=True, eq=False, repr=False)
class Deformation(Placed):
    """A node that warps its child between two heights, `low` and `high`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = (getattr(self, name) for name in ("low", "high"))
        if not low < high:
            raise InvalidNode(f"high: expected a height above low = {low:g}, got {high:g}")


@dataclass(frozen=True, eq=False, repr=False)
class Taper(Deformation):
    """`child` with cross-sections that grow linearly with the height, up to `factor` (Barr 1984, sec. 3.1).

    Examples
    --------
    >>> from blobtree import Segment, Taper
    >>> Taper(Segment((0, 0, 0), (0, 0, 2), radius=0.5), 0.5, 0, 2)([[0.25, 0, 2]]).round(3).tolist()
    [0.5]
    """

    file_tag = "taper"
    warp: ClassVar[SpaceWarp] = TAPER

    factor: Annotated[
        float,
        Parameter(
            Quantity.FACTOR,
            "scale across z at the height `high`",
            low=1.0 / LARGEST_FACTOR,
            high=LARGEST_FACTOR,
            hint="move the limits apart, or scale the model",
        ),
    ]
    low: Low
    high: High

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The growth per unit of height, and the limits."""
        return ((self.factor - 1.0) / (self.high - self.low), self.low, self.high)


@dataclass(frozen=True, eq=False, repr=False)
class Shear(Deformation):
    """`child` with cross-sections that move sideways in proportion to the height.

    Examples
    --------
    >>> from blobtree import Point, Shear
    >>> Shear(Point((0, 0, 1), radius=0.5), 0.5, 0, 0, 2)([[0.5, 0, 1]]).round(3).tolist()
    [1.0]
    """

    file_tag = "shear"
    warp: ClassVar[SpaceWarp] = SHEAR

    slope_x: Annotated[float, Parameter(Quantity.FACTOR, "motion along x per unit of height")]
    slope_y: Annotated[float, Parameter(Quantity.FACTOR, "motion along y per unit of height")]
    low: Low
    high: High

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The slopes and the limits."""
        return (self.slope_x, self.slope_y, self.low, self.high)


@dataclass(frozen=True, eq=False, repr=False)
class Stretch(Deformation):
    """`child` with the part between two heights longer by a factor; what is above moves with it.

    Examples
    --------
    >>> from blobtree import Point, Stretch
    >>> Stretch(Point((0, 0, 2), radius=0.5), 3, 0, 1)([[0, 0, 4]]).round(3).tolist()
    [1.0]
    """

    file_tag = "stretch"
    warp: ClassVar[SpaceWarp] = STRETCH

    factor: Annotated[
        float,
        Parameter(
            Quantity.FACTOR,
            "new length of the part over its old length",
            low=1.0 / LARGEST_FACTOR,
            high=LARGEST_FACTOR,
            hint="scale the model",
        ),
    ]
    low: Low
    high: Annotated[float, Parameter(Quantity.DISTANCE, "height where the part ends, before the stretch")]

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """1 − 1 / factor, and the limits after the stretch."""
        return (1.0 - 1.0 / self.factor, self.low, self.low + self.factor * (self.high - self.low))


@dataclass(frozen=True, eq=False, repr=False)
class LimitedTwist(Deformation):
    """`child` turned about the z axis by an angle that grows with the height between two limits (Barr 1984).

    Examples
    --------
    >>> from blobtree import LimitedTwist, Point
    >>> LimitedTwist(Point((1, 0, 5), radius=0.5), 90, 0, 1)([[0, 1, 5]]).round(3).tolist()
    [1.0]
    """

    file_tag = "limited_twist"
    warp: ClassVar[SpaceWarp] = LIMITED_TWIST

    degrees: Annotated[
        float, Parameter(Quantity.ANGLE, "degrees per model unit of height, counter-clockwise from above")
    ]
    low: Low
    high: High

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The angle per unit of height in radians, and the limits."""
        return (math.radians(self.degrees), self.low, self.high)


@dataclass(frozen=True, eq=False, repr=False)
class Bend(Deformation):
    """`child` bent about an axis parallel to y; beyond the limits it stays rigid (Barr 1984, sec. 3.3).

    The z axis becomes a circle of radius 1 / rate toward +x, or toward −x for a negative rate. The field of
    the child must leave room around the axis of that circle, and its ends may not meet: `support` raises
    `InvalidNode` otherwise.

    Examples
    --------
    >>> from blobtree import Bend, Segment
    >>> arc = Bend(Segment((0, 0, 0), (0, 0, 3), radius=0.2), 30, 0, 3)
    >>> radius = 180 / 3.14159265 / 30
    >>> arc([[radius, 0, radius - 0.2]]).round(3).tolist()
    [0.5]
    """

    file_tag = "bend"
    warp: ClassVar[SpaceWarp] = BEND

    degrees: Annotated[float, Parameter(Quantity.ANGLE, "degrees per model unit of height, from z toward x")]
    low: Low
    high: Annotated[float, Parameter(Quantity.DISTANCE, "height where the bend ends, before it is bent")]

    def __post_init__(self) -> None:
        super().__post_init__()
        total = abs(self.degrees) * (self.high - self.low)
        if total >= 360.0:
            raise InvalidNode(
                f"degrees: expected less than 360 between the limits, got {total:g}; "
                "use fewer degrees, or move the limits together"
            )

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The angle per unit of height in radians, and the limits."""
        return (math.radians(self.degrees), self.low, self.high)


@dataclass(frozen=True, eq=False, repr=False)
class NoiseWarp(Placed):
    """`child` displaced by smooth noise: the sum of plane waves of random directions (Saupe 1988).

    Displacements are normal to the wave vectors, so that volumes stay the same to first order.

    Examples
    --------
    >>> from blobtree import NoiseWarp, Point
    >>> ball = Point((0, 0, 0), radius=1.0)
    >>> rough = NoiseWarp(ball, 0.2, 1.0, seed=3)
    >>> bool(abs(rough([[1, 0, 0]]) - ball([[1, 0, 0]]))[0] > 1e-3)
    True
    """

    file_tag = "noise_warp"
    warp: ClassVar[SpaceWarp] = NOISE

    amplitude: Annotated[float, Parameter(Quantity.LENGTH, "bound on the displacement")]
    wavelength: Annotated[
        float, Parameter(Quantity.LENGTH, "mean length of the waves, at least the amplitude")
    ]
    seed: Annotated[
        int, Parameter(Quantity.NUMBERS, "number of the noise", low=0, high=LARGEST_INTEGER, whole=True)
    ] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.amplitude > self.wavelength:
            raise InvalidNode(
                f"amplitude: expected at most the wavelength {self.wavelength:g}, got {self.amplitude:g}; "
                "larger displacements fold the model"
            )

    @Lazy
    def warp_parameters(self) -> tuple[float, ...]:
        """Return the number of waves, and (ω, phase), (d, steepness) of each."""
        rng = np.random.default_rng(self.seed)
        z, turn, phase, side = rng.random((4, WAVES))
        across = np.sqrt(1.0 - (2.0 * z - 1.0) ** 2)
        angle = 2.0 * np.pi * turn
        directions = np.stack([across * np.cos(angle), across * np.sin(angle), 2.0 * z - 1.0], axis=1)
        lengths = self.wavelength * WAVELENGTH_SPREAD ** np.linspace(-1.0, 1.0, WAVES)
        omegas = 2.0 * np.pi * directions / lengths[:, None]
        helper = np.eye(3)[np.abs(directions).argmin(axis=1)]
        first = np.cross(directions, helper)
        first /= np.linalg.norm(first, axis=1)[:, None]
        second = np.cross(directions, first)
        side = 2.0 * np.pi * side
        motions = first * np.cos(side)[:, None] + second * np.sin(side)[:, None]
        motions *= self.amplitude / WAVES
        steepness = np.linalg.norm(omegas, axis=1) * self.amplitude / WAVES
        waves = np.column_stack([omegas, 2.0 * np.pi * phase, motions, steepness])
        return (float(WAVES), 0.0, 0.0, *waves.ravel().tolist())


@dataclass(frozen=True, eq=False, repr=False)
class CurveWarp(Placed):
    """`child` deformed so that points of a curve move to points of another (Sugihara et al. 2010).

    Points of `source` move to the points of `target`, one for one. Between and around them the motion is
    interpolated by Wendland's C² radial function. Beyond `reach` from the target nothing moves.

    Examples
    --------
    >>> from blobtree import CurveWarp, Segment
    >>> rod = Segment((-1, 0, 0), (1, 0, 0), radius=0.2)
    >>> source = [(-1, 0, 0), (0, 0, 0), (1, 0, 0)]
    >>> arched = CurveWarp(rod, source, [(-1, 0, 0), (0, 0, 0.3), (1, 0, 0)], reach=1.5)
    >>> arched([[0, 0, 0.3]]).round(3).tolist()
    [1.0]
    """

    file_tag = "curve_warp"
    warp: ClassVar[SpaceWarp] = CURVE

    source: Annotated[Points, Parameter(Quantity.POINTS, "points of the curve before the deformation")]
    target: Annotated[Points, Parameter(Quantity.POINTS, "the same points after it")]
    reach: Annotated[float, Parameter(Quantity.LENGTH, "distance from the target up to which space moves")]

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.target)
        if not 1 <= len(self.source) <= MAX_CURVE_POINTS:
            raise InvalidNode(f"source: expected 1 to {MAX_CURVE_POINTS} points, got {len(self.source)}")
        if count != len(self.source):
            raise InvalidNode(
                f"target: expected one point per point of source, {len(self.source)}, got {count}"
            )
        if not np.isfinite(self._weights).all():
            raise InvalidNode("target: expected distinct points, got some too close together for the reach")
        if self._smallest_determinant() <= 0.0:
            raise InvalidNode(
                "target: the motion folds space; use a larger reach, or points nearer to the source"
            )

    @Lazy
    def _weights(self) -> Float64Array:
        """Return the weights (n, 3) of the radial functions that interpolate source − target."""
        source, target = np.array(self.source), np.array(self.target)
        distances = np.linalg.norm(target[:, None] - target, axis=2) / self.reach
        matrix = np.maximum(1.0 - distances, 0.0) ** 4 * (4.0 * distances + 1.0)
        if np.linalg.cond(matrix) > LARGEST_CONDITION:
            return np.full_like(target, np.nan)
        weights: Float64Array = np.linalg.solve(matrix, source - target)
        return weights

    def _smallest_determinant(self) -> float:
        """Return the smallest determinant of the Jacobian at samples around the target."""
        centers = np.array(self.target)
        first, last = centers.min(axis=0) - self.reach, centers.max(axis=0) + self.reach
        steps = [np.linspace(a, b, FOLD_SAMPLES) for a, b in zip(first, last, strict=True)]
        grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        away = (np.concatenate([grid, centers])[:, None] - centers) / self.reach
        slopes = -20.0 * np.maximum(1.0 - np.linalg.norm(away, axis=2), 0.0) ** 3 / self.reach
        jacobians = np.eye(3) + np.einsum("jc,njd->ncd", self._weights, slopes[..., None] * away)
        return float(np.linalg.det(jacobians).min())

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The number of points, 1 / reach, and (centre, 0), (weight, its length) of each."""
        lengths = np.linalg.norm(self._weights, axis=1)
        texels = np.column_stack([np.array(self.target), np.zeros(len(lengths)), self._weights, lengths])
        return (float(len(lengths)), 1.0 / self.reach, 0.0, *texels.ravel().tolist())


LARGEST_CONDITION = 1e8
"""Largest condition number of the interpolation; beyond it points are too close together."""
