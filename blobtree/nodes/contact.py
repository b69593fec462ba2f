"""Contact between solids: compression to shared surfaces and bulges around them (Gascuel 1993).

`Press` deforms one solid at an obstacle. `SolidContact` lets any number of solids deform each other: each one
is pressed by all others, and their union is the model.

Two solids in contact share one surface, and the material bulges around it. In the papers the field of a solid
becomes F = f + h, where h < 0 inside the other solid (compression) and h > 0 in a region around the contact
(propagation). Their surface lies where f is 1; here it lies where f is ½, and fields are larger inside.

A solid a of stiffness s meets an obstacle b of stiffness s′ where s(a − ½) = s′(b − ½). `rated_field` brings
the obstacle to the scale of the solid, m = r(b) with slope s′/s at ½. Then

    F = a − (m − ½)          where m ≥ ½,
    F = a + B(½ − m) φ(a)    outside of the obstacle,

with a bulge B(t) of the given height and width. B rises with slope 1 at t = 0, so F is C¹ where contact
begins, and B(t) < t, so two bulges never overlap. φ confines the bulge to the support of a; it is 1 where F
can reach ½.
"""

from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from typing import Annotated, Any, Self, cast

import numpy as np
import warp as wp

from blobtree import par
from blobtree._typing import Float32Array, Float64Array
from blobtree.declare.claims import KEEP_BOTH, KEEP_LEFT, KEEP_NONE
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.lazy import Lazy
from blobtree.meshing.clip import clipped, enclosed_volume, outlines_of
from blobtree.meshing.mesh import Mesh
from blobtree.meshing.polygonize import polygonize
from blobtree.nodes.node import Node
from blobtree.nodes.operator import ManyOperands, Pair
from blobtree.nodes.tree import Macro, Union

wp.set_module_options({"enable_backward": False})

LARGEST_HEIGHT = 0.125
"""Largest height of a bulge, in field values."""

HEIGHT_OVER_WIDTH = 0.25
"""Largest height of a bulge over its width: the top lies at twice the height, in the nearer half."""

FADE = 0.25
"""Field value of the solid below which its bulge fades, at most ½ − LARGEST_HEIGHT."""

LARGEST_RATIO = 100.0
"""Largest ratio of two stiffnesses; beyond it the stiffer solid is rigid for any purpose."""

RESOLUTION = 64
"""Cells along the longest side of a solid's support where volumes and contact surfaces are measured."""

STEPS = 12
"""Largest number of secant steps of `SolidContact.compensated`."""

LARGEST_STEP, LARGEST_GROWTH = 0.1, 0.5
"""Largest step and offset in `SolidContact.compensated`, over the side of a cube of the solid's volume."""

width_field = partial(
    par.factor,
    "width of the bulge, as the fall of the obstacle's field from 0.5 to its end",
    low=0.01,
    high=0.5,
    hint="0.5 reaches to the end of the obstacle's field",
    default=0.4,
)


@wp.func
def rated_field(b: wp.float32, ratio: wp.float32) -> wp.vec2:
    """Return r(b) and r′(b): 0 at b = 0, ½ at b = ½ with slope `ratio`, linear above.

    The maps of all ratios are a group: first k, then k′ is k · k′. So a point has one order of solids.
    """
    t = 0.5 - b
    if t <= 0.0:
        return wp.vec2(0.5 - ratio * t, ratio)
    if b <= 0.0:
        return wp.vec2(0.0, 0.0)
    divisor = 1.0 + 2.0 * (ratio - 1.0) * t
    return wp.vec2(wp.max(0.5 - ratio * t / divisor, 0.0), ratio / (divisor * divisor))


@wp.func
def hump(t: wp.float32, width: wp.float32, height: wp.float32) -> wp.vec2:
    """Return B(t) and B′(t): up to `height` at t = 2 · height, then down to 0 at t = `width`."""
    top = 2.0 * height
    if t <= 0.0 or t >= width or height <= 0.0:
        return wp.vec2(0.0, 0.0)
    if t < top:
        return wp.vec2(t * (1.0 - 0.5 * t / top), 1.0 - t / top)
    v = (t - top) / (width - top)
    return wp.vec2(
        height * (1.0 - v) * (1.0 - v) * (1.0 + 2.0 * v), -6.0 * height * v * (1.0 - v) / (width - top)
    )


@wp.func
def pressed_value(a: wp.float32, m: wp.float32, width: wp.float32, height: wp.float32) -> wp.float32:
    """Return F(a, m) for a rated obstacle."""
    if m >= 0.5:
        return wp.max(a - (m - 0.5), 0.0)
    x = wp.clamp(a / FADE, 0.0, 1.0)
    return a + hump(0.5 - m, width, height)[0] * x * x * (3.0 - 2.0 * x)


@wp.func
def pressed_partials(
    a: wp.float32, b: wp.float32, ratio: wp.float32, width: wp.float32, height: wp.float32
) -> wp.vec3:
    """Return F, ∂F/∂a and ∂F/∂b."""
    m = rated_field(b, ratio)
    if b <= 0.0:
        return wp.vec3(a, 1.0, 0.0)
    if m[0] >= 0.5:
        value = a - (m[0] - 0.5)
        if value <= 0.0:
            return wp.vec3(0.0, 0.0, 0.0)
        return wp.vec3(value, 1.0, -m[1])
    h = hump(0.5 - m[0], width, height)
    x = wp.clamp(a / FADE, 0.0, 1.0)
    fade = x * x * (3.0 - 2.0 * x)
    return wp.vec3(a + h[0] * fade, 1.0 + h[0] * 6.0 * x * (1.0 - x) / FADE, -h[1] * fade * m[1])


@wp.func
def steepest_rating(max_b: wp.float32, ratio: wp.float32, width: wp.float32) -> wp.float32:
    """Bound r′ where r(b) > ½ − width and b ≤ max_b."""
    b = wp.min(max_b, 0.5)
    if ratio < 1.0:
        b = rated_field(0.5 - width, 1.0 / ratio)[0]
    divisor = 1.0 + 2.0 * (ratio - 1.0) * (0.5 - b)
    return ratio / (divisor * divisor)


@wp.func
def pressed_range(
    a: wp.vec2, low: wp.float32, high: wp.float32, width: wp.float32, height: wp.float32
) -> wp.vec2:
    """F rises with a; over m from `low` to `high` it rises up to the top of the bulge and falls behind."""
    top = wp.clamp(0.5 - 2.0 * height, low, high)
    smallest = wp.min(pressed_value(a[0], low, width, height), pressed_value(a[0], high, width, height))
    return wp.vec2(smallest, pressed_value(a[1], top, width, height))


class Press(Pair):
    """`solid` as it deforms at `obstacle`; the obstacle itself is not part of the result.

    Inside the obstacle the solid yields until s(f − ½) = s′(g − ½), where f and g are their fields and s′/s
    is `stiffness_ratio`. Around the contact it bulges by `height`. Press two solids by each other, and their
    surfaces coincide in the contact (Gascuel 1993; Cani & Desbrun 1997).

    Examples
    --------
    >>> from blobtree import Point, Press
    >>> left, right = Point((-0.7, 0, 0), radius=1.0), Point((0.7, 0, 0), radius=1.0)
    >>> Press(left, right)([[-0.9, 0, 0], [0, 0, 0], [0.9, 0, 0]]).round(1).tolist()
    [1.0, 0.5, 0.0]
    """

    like = "difference"
    paints = False

    solid: Node
    obstacle: Node
    _: KW_ONLY
    stiffness_ratio: float = par.factor(
        "stiffness of the obstacle over that of the solid",
        low=1.0 / LARGEST_RATIO,
        high=LARGEST_RATIO,
        hint="leave a rigid solid as it is, and press the others",
        default=1.0,
    )
    width: float = width_field()
    height: float = par.factor(
        "height of the bulge, as a value of the solid's field; 0 for none",
        low=0.0,
        high=LARGEST_HEIGHT,
        hint="a larger bulge would not stay in the support of its solid",
        default=0.05,
    )

    partials = formula(pressed_partials)

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_shape(self.width, self.height)

    @formula
    def slope(
        rise: wp.vec2, most: wp.vec2, ratio: wp.float32, width: wp.float32, height: wp.float32
    ) -> wp.float32:
        """Bound |∇F|: ∂F/∂a ≤ 1 + 1.5 · height / FADE, |∂F/∂b| ≤ r′."""
        if rated_field(most[1], ratio)[0] <= 0.5 - width:
            return rise[0]
        return rise[0] * (1.0 + 1.5 * height / FADE) + rise[1] * steepest_rating(most[1], ratio, width)

    @formula
    def interval(a: wp.vec2, b: wp.vec2, ratio: wp.float32, width: wp.float32, height: wp.float32) -> wp.vec2:
        """F rises with a; over b it rises up to the top of the bulge and falls behind."""
        return pressed_range(a, rated_field(b[0], ratio)[0], rated_field(b[1], ratio)[0], width, height)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, ratio: wp.float32, width: wp.float32, height: wp.float32) -> wp.int32:
        """Keep the solid alone where the obstacle's region ends."""
        if a[1] <= 0.0 or a[1] <= rated_field(b[0], ratio)[0] - 0.5:
            return KEEP_NONE
        if b[1] <= 0.0 or rated_field(b[1], ratio)[0] <= 0.5 - width:
            return KEEP_LEFT
        return KEEP_BOTH


class Bulge(Press):
    """`solid` with the bulge that it gets at `obstacle`, but not compressed by it.

    The union of two solids that bulge at each other is the outside of two that press each other; inside, its
    field has no surface where they meet.

    Examples
    --------
    >>> from blobtree import Bulge, Point
    >>> left, right = Point((-0.7, 0, 0), radius=1.0), Point((0.7, 0, 0), radius=1.0)
    >>> bool(Bulge(left, right)([0, 0, 0]) == left([0, 0, 0]))
    True
    """

    @formula
    def partials(
        a: wp.float32, b: wp.float32, ratio: wp.float32, width: wp.float32, height: wp.float32
    ) -> wp.vec3:
        """Return F, ∂F/∂a and ∂F/∂b of a solid that bulges, but is not compressed."""
        if rated_field(b, ratio)[0] >= 0.5:
            return wp.vec3(a, 1.0, 0.0)
        return pressed_partials(a, b, ratio, width, height)

    @formula
    def interval(a: wp.vec2, b: wp.vec2, ratio: wp.float32, width: wp.float32, height: wp.float32) -> wp.vec2:
        """F rises with a; over b it rises up to the top of the bulge and falls behind, up to b = ½."""
        low = wp.min(rated_field(b[0], ratio)[0], 0.5)
        return pressed_range(a, low, wp.min(rated_field(b[1], ratio)[0], 0.5), width, height)

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, ratio: wp.float32, width: wp.float32, height: wp.float32) -> wp.int32:
        """Keep the solid alone inside the obstacle and beyond its region."""
        if a[1] <= 0.0:
            return KEEP_NONE
        if b[1] <= 0.0 or rated_field(b[1], ratio)[0] <= 0.5 - width or rated_field(b[0], ratio)[0] >= 0.5:
            return KEEP_LEFT
        return KEEP_BOTH


class RatedUnion(Pair):
    """Union of two obstacles of different stiffness, F = max(f, r(g)); for `Press`.

    The rating r keeps the surface of g, and multiplies the slope of g there by `stiffness_ratio`.

    Examples
    --------
    >>> from blobtree import Point, RatedUnion
    >>> soft, hard = Point((0, 0, 0), radius=1.0), Point((3, 0, 0), radius=1.0)
    >>> RatedUnion(soft, hard, stiffness_ratio=2.0)([[1, 0, 0], [2, 0, 0], [3, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 1.5]
    """

    monotone = True

    first: Node
    second: Node
    _: KW_ONLY
    stiffness_ratio: float = par.factor(
        "stiffness of the second over that of the first",
        low=LARGEST_RATIO**-2,
        high=LARGEST_RATIO**2,
        hint="take a union, or leave one out",
    )

    @formula
    def partials(a: wp.float32, b: wp.float32, ratio: wp.float32) -> wp.vec3:
        """F = max(a, r(b))."""
        m = rated_field(b, ratio)
        if a >= m[0]:
            return wp.vec3(a, 1.0, 0.0)
        return wp.vec3(m[0], 0.0, m[1])

    @formula
    def slope(rise: wp.vec2, most: wp.vec2, ratio: wp.float32) -> wp.float32:
        """Bound the rise: r′ lies between the ratio and its inverse."""
        steepest = wp.max(ratio, 1.0 / ratio)
        if rise[1] < 0.0:
            steepest = 1.0 / steepest
        return wp.max(rise[0], rise[1] * steepest)

    @formula
    def interval(a: wp.vec2, b: wp.vec2, ratio: wp.float32) -> wp.vec2:
        """F is monotone in both operands."""
        return wp.max(a, wp.vec2(rated_field(b[0], ratio)[0], rated_field(b[1], ratio)[0]))

    @formula
    def keeps(a: wp.vec2, b: wp.vec2, ratio: wp.float32) -> wp.int32:
        """Keep the first operand where that is always the larger."""
        if b[1] <= 0.0 or rated_field(b[1], ratio)[0] <= a[0]:
            return KEEP_LEFT
        return KEEP_BOTH


@dataclass(frozen=True)
class ContactSurface:
    """The surface that two solids of a `SolidContact` share.

    Attributes
    ----------
    pair
        Numbers of the two solids, the smaller first.
    names
        Their names, empty if the solids have none.
    area
        Area, in squared model units.
    centroid
        float64[3]: centroid of the surface.
    outlines
        Closed polylines float64[n, 3] around the surface; the last point is the first.
    vertices, faces
        float64[n, 3] and int32[m, 3]: its triangles.

    Examples
    --------
    >>> from blobtree import SolidContact, ContactSurface, Point
    >>> left, right = Point((-0.8, 0, 0), radius=1.0), Point((0.8, 0, 0), radius=1.0)
    >>> (surface,) = SolidContact((left, right), names=("left", "right")).contacts(resolution=32)
    >>> isinstance(surface, ContactSurface), surface.names, round(surface.area, 1)
    (True, ('left', 'right'), 1.1)
    """

    pair: tuple[int, int]
    names: tuple[str, ...]
    area: float
    centroid: Float64Array
    outlines: tuple[Float64Array, ...]
    vertices: Float64Array
    faces: Any


@dataclass(frozen=True, eq=False, repr=False, init=False)
class SolidContact(ManyOperands, Macro):
    """Solids that deform each other where they touch; the model is the union of the deformed solids.

    No two deformed solids overlap, and no void opens between them: a point inside several solids belongs to
    the one with the largest s(f − ½), where s is its stiffness. Each solid is pressed by the strongest of the
    others at a point, see `Press`. The node itself is the outside of all deformed solids: its field has no
    surface where they meet. An offset above it grows the deformed solids; to let the solids grow
    before they touch, offset them.

    `decals.Contact` is something else: the mode in which decals push each other on a surface.

    Examples
    --------
    >>> from blobtree import SolidContact, Point
    >>> balls = [Point((x, 0, 0), radius=1.0) for x in (-0.8, 0.8)]
    >>> model = SolidContact(balls, stiffness=(1, 4))
    >>> soft, stiff = model.solids()
    >>> bool(soft([0, 0, 0]) < 0.5 < stiff([0, 0, 0]))
    True
    >>> (surface,) = model.contacts()
    >>> surface.pair, len(surface.outlines)
    ((0, 1), 1)
    """

    file_tag = "contact"

    _: KW_ONLY
    stiffness: Annotated[
        tuple[float, ...],
        Parameter(
            Quantity.FACTORS,
            "stiffness of each solid, or of each (row) against each other (n × n numbers); equal if empty",
        ),
    ] = ()
    width: float = width_field()
    height: Annotated[
        float | tuple[float, ...],
        Parameter(
            Quantity.FACTORS,
            "height of the bulges (see `Press`), one a solid or that of the softest; stiffer ones bulge less",
        ),
    ] = 0.05
    growth: Annotated[
        tuple[float, ...],
        Parameter(
            Quantity.DISTANCES, "offset of each solid before it deforms; see `compensated`; none if empty"
        ),
    ] = ()
    names: Annotated[
        tuple[str, ...], Parameter(Quantity.NAMES, "names of the solids, each different; none if empty")
    ] = ()

    combines = True

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.operands)
        _check_count("stiffness", self.stiffness, {0, count, count**2})
        _check_count("height", self._given_heights, {1, count})
        _check_count("growth", self.growth, {0, count})
        _check_count("names", self.names, {0, count})
        if self.stiffness and not 0.0 < max(self.stiffness) <= LARGEST_RATIO * min(self.stiffness):
            raise InvalidNode(
                f"stiffness: expected numbers above 0 whose ratio is at most {LARGEST_RATIO:g}, "
                f"got {self.stiffness}"
            )
        for height in self._given_heights:
            if not 0.0 <= height <= LARGEST_HEIGHT:
                raise InvalidNode(f"height: expected 0 to {LARGEST_HEIGHT:g}, got {height!r}")
            _check_shape(self.width, height)
        if len(set(self.names)) < len(self.names):
            raise InvalidNode(f"names: expected a different name for each solid, got {self.names}")

    @Lazy
    def expanded(self) -> Node:
        """Return the union of the deformed solids, without the surfaces between them."""
        solids = tuple(self._deformed_by(Bulge, i) for i in range(len(self.operands)))
        return Union(solids) if len(solids) > 1 else solids[0]

    def solids(self) -> tuple[Node, ...]:
        """Return the deformed solids as trees of their own.

        Each one has a closed surface. Neighbours share the surface of their contact.

        Examples
        --------
        >>> from blobtree import SolidContact, Point, polygonize
        >>> left, right = SolidContact([Point((x, 0, 0), radius=1.0) for x in (-0.8, 0.8)]).solids()
        >>> bool(abs(polygonize(left).vertices[:, 0].max()) < 1e-5)
        True
        """
        return self._deformed

    def contacts(self, *, resolution: int = RESOLUTION) -> list[ContactSurface]:
        """Return the surfaces that solids share.

        Parameters
        ----------
        resolution : int
            Cells along the longest side of a solid's support, in which the surfaces are triangulated.

        Returns
        -------
        list[ContactSurface]
            One for each pair that touches, ordered by pair. Areas miss at most what the triangulation of one
            solid misses.

        Raises
        ------
        InvalidResolution
            The resolution is not a usable number of cells.

        Examples
        --------
        >>> from blobtree import SolidContact, Point
        >>> model = SolidContact([Point((x, 0, 0), radius=1.0) for x in (-0.8, 0.8)], names=("left", "right"))
        >>> (surface,) = model.contacts()
        >>> surface.names, round(surface.area, 2)  # a disc of radius 0.6
        (('left', 'right'), 1.13)
        """
        surfaces: list[ContactSurface] = []
        for i, solid in enumerate(self._deformed):
            later = [j for j in self._neighbors[i] if j > i]
            if later:
                mesh = polygonize(solid, resolution=resolution)
                surfaces += [surface for j in later if (surface := self._shared(mesh, i, j)) is not None]
        return surfaces

    def compensated(self, *, tolerance: float = 0.002, resolution: int = RESOLUTION) -> "SolidContact":
        """Return this contact with offsets of the solids, so that each keeps the volume that it has alone.

        Parameters
        ----------
        tolerance : float
            Largest relative error of a volume.
        resolution : int
            Cells along the longest side of a solid's support, in which volumes are measured.

        Returns
        -------
        SolidContact
            The same solids with other `growth`.

        Raises
        ------
        InvalidNode
            A solid has no volume, or no offsets up to half of its size let it keep its volume.
        InvalidResolution
            The resolution is not a usable number of cells.

        Examples
        --------
        >>> from blobtree import SolidContact, Point
        >>> model = SolidContact([Point((x, 0, 0), radius=1.0) for x in (-0.7, 0.7)], height=0)
        >>> [round(distance, 3) for distance in model.compensated(resolution=32).growth]
        [0.023, 0.023]
        """
        cells = [float(np.max(np.subtract(*node.support[::-1]))) / resolution for node in self.operands]
        free = _volumes(self.operands, cells)
        if not (free > 0.0).all():
            raise InvalidNode(f"expected solids with a volume, solid {int(free.argmin())} has none")
        growth, model = np.array(self.growth or (0.0,) * len(free)), self
        errors = _volumes(model.solids(), cells) - free
        sizes = np.cbrt(free)
        slopes = 4.8 * sizes**2  # area of the ball of each volume
        for _ in range(STEPS):
            if (np.abs(errors) <= tolerance * free).all():
                return model
            step = np.clip(-errors / slopes, -LARGEST_STEP * sizes, LARGEST_STEP * sizes)
            growth = growth + step
            if (np.abs(growth) > LARGEST_GROWTH * sizes).any():
                break
            model = replace(model, growth=tuple(growth.tolist()))
            now = _volumes(model.solids(), cells) - free
            moved = np.abs(step) > 1e-9 * sizes
            secants = (now - errors) / np.where(moved, step, 1.0)
            slopes = np.where(moved & (secants > 0.1 * slopes), secants, slopes)
            errors = now
        worst = int(np.abs(errors / free).argmax())
        raise InvalidNode(
            f"expected solids that can keep their volumes, solid {worst} still misses "
            f"{-errors[worst] / free[worst]:.1%}; move the solids apart"
        )

    def without(self, number: int) -> Self:
        """Return this contact without one of its solids."""
        count = len(self.operands)
        kept = [i for i in range(count) if i != number]
        heights = self._given_heights
        table = np.array(self.stiffness)
        if len(table) == count**2:
            table = table.reshape(count, count)[np.ix_(kept, kept)].ravel()
        elif len(table):
            table = table[kept]
        return replace(
            self,
            operands=tuple(self.operands[i] for i in kept),
            stiffness=tuple(table.tolist()),
            height=self.height if len(heights) == 1 else tuple(heights[i] for i in kept),
            growth=tuple(self.growth[i] for i in kept if self.growth),
            names=tuple(self.names[i] for i in kept if self.names),
        )

    def stiffness_ratio(self, first: int, second: int) -> float:
        """Return the stiffness of the second solid over that of the first, where these two touch."""
        count = len(self.operands)
        if not self.stiffness:
            return 1.0
        if len(self.stiffness) == count:
            return self.stiffness[second] / self.stiffness[first]
        return self.stiffness[second * count + first] / self.stiffness[first * count + second]

    @Lazy
    def _grown(self) -> tuple[Node, ...]:
        """Return the solids with their offsets, before they deform."""
        if not any(self.growth):
            return self.operands
        return tuple(node.offset(d) for node, d in zip(self.operands, self.growth, strict=True))

    @Lazy
    def _neighbors(self) -> list[list[int]]:
        """Return for each solid those whose supports overlap with its own; no other can press it."""
        boxes = np.array([node.support for node in self._grown])
        neighbors: list[list[int]] = [[] for _ in boxes]
        for i, (lower, upper) in enumerate(boxes):
            meets = ((boxes[:, 0] <= upper) & (boxes[:, 1] >= lower)).all(axis=1)
            meets[i] = False
            neighbors[i] = np.flatnonzero(meets).tolist()
        return neighbors

    @Lazy
    def _deformed(self) -> tuple[Node, ...]:
        """Return the deformed solids."""
        return tuple(self._deformed_by(Press, i) for i in range(len(self.operands)))

    def _deformed_by(self, kind: type[Press], number: int) -> Node:
        """Return one solid under a deformation at all others."""
        solid, groups = self._grown[number], self._obstacles(number)
        if not groups:
            return solid
        (first, obstacle), *others = groups
        for ratio, more in others:
            obstacle = RatedUnion(obstacle, more, stiffness_ratio=ratio / first)
        height = self._heights[number]
        return kind(solid, obstacle, stiffness_ratio=first, width=self.width, height=height)

    @Lazy
    def _heights(self) -> tuple[float, ...]:
        """Return the height of each solid's bulges."""
        count, given = len(self.operands), self._given_heights
        if len(given) == count:
            return given
        if not self.stiffness:
            return given * count
        rows = np.reshape(self.stiffness, (count, -1)).mean(axis=1)
        return tuple((given[0] * rows.min() / rows).tolist())

    @property
    def _given_heights(self) -> tuple[float, ...]:
        """The checked heights, of all solids or of each one."""
        return cast("tuple[float, ...]", self.height)

    def _obstacles(self, number: int) -> list[tuple[float, Node]]:
        """Return the obstacles of one solid and their stiffness ratios, those of equal ratio as one."""
        groups: dict[float, list[Node]] = {}
        for other in self._neighbors[number]:
            groups.setdefault(self.stiffness_ratio(number, other), []).append(self._grown[other])
        return [
            (ratio, Union(tuple(nodes)) if len(nodes) > 1 else nodes[0]) for ratio, nodes in groups.items()
        ]

    def _shared(self, mesh: Mesh, first: int, second: int) -> ContactSurface | None:
        """Return the surface that two solids share, from a mesh of the first; None if they are apart."""
        own = self._pressure(mesh.vertices, first, second)
        if not (own > 0.0).any():
            return None
        margin = own
        for rival in self._neighbors[first]:
            if rival != second:
                margin = np.minimum(margin, own - self._pressure(mesh.vertices, first, rival))
        vertices, faces = clipped(mesh.vertices, mesh.faces, margin)
        if not len(faces):
            return None
        corners = vertices[faces]
        areas = 0.5 * np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        area = float(areas.sum())
        if area == 0.0:
            return None
        centroid = (areas @ corners.mean(axis=1)) / area
        names = (self.names[first], self.names[second]) if self.names else ()
        return ContactSurface(
            (first, second), names, area, centroid, outlines_of(vertices, faces), vertices, faces
        )

    def _pressure(self, points: Float32Array, first: int, second: int) -> Float64Array:
        """Return the second solid's f − ½ (n,) at points inside it, in the scale of the first."""
        excess = self._grown[second](points).astype(np.float64) - 0.5
        return excess * np.where(excess > 0.0, self.stiffness_ratio(first, second), 1.0)


def _volumes(solids: Iterable[Node], cells: list[float]) -> Float64Array:
    """Return the volumes (n,) of n solids, each measured in cells of its own size."""
    meshes = (polygonize(solid, cell_size=cell) for solid, cell in zip(solids, cells, strict=True))
    return np.array([enclosed_volume(mesh.vertices, mesh.faces) for mesh in meshes])


def _check_shape(width: float, height: float) -> None:
    """Raise `InvalidNode` for a bulge that is too high for its width."""
    if height > HEIGHT_OVER_WIDTH * width:
        raise InvalidNode(
            f"height: expected at most {HEIGHT_OVER_WIDTH:g} of the width {width:g}, got {height:g}"
        )


def _check_count(name: str, values: tuple[Any, ...], counts: set[int]) -> None:
    """Raise `InvalidNode` if a parameter has not as many values as one of `counts`."""
    if len(values) not in counts:
        expected = " or ".join(str(count) for count in sorted(counts))
        raise InvalidNode(f"{name}: expected {expected} values for these solids, got {len(values)}")
