"""Random trees: a seeded generator for numbers, a Hypothesis strategy for structure."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import combinations
from operator import add, and_, or_
from typing import Any, cast, overload

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from blobtree import (
    FALLOFF_NAMES,
    Arc,
    BlendGraph,
    Box,
    Bulge,
    Circle,
    CleanUnion,
    Cone,
    ControllableBlend,
    ConvolutionArc,
    ConvolutionSegment,
    ConvolutionTriangle,
    CubicBezier,
    Cylinder,
    Difference,
    Disc,
    Ellipsoid,
    Gyroid,
    HalfSpace,
    Intersection,
    LocalBlend,
    Node,
    Noise,
    Offset,
    Point,
    Polygon,
    Polyline,
    Press,
    Primitive,
    QuadraticBezier,
    RatedUnion,
    RDifference,
    Rectangle,
    Ricci,
    RIntersection,
    RUnion,
    Segment,
    Shell,
    SmoothDifference,
    SmoothIntersection,
    SolidContact,
    Stroke,
    Sum,
    SuperellipticBlend,
    Superquadric,
    SymmetricDifference,
    TaperedBezier,
    Torus,
    Transform,
    Triangle,
    Twist,
    Union,
)
from blobtree.conformance.samples import points_around as points_around
from blobtree.errors import InvalidNode
from blobtree.nodes.primitives import Falling, Leaf, Profile
from blobtree.validation import Vector

BUILT_IN_FALLOFFS = [name for name, falloff in FALLOFF_NAMES.items() if not falloff.digest]

KINDS = (Point, Segment, Cone, Sum, Ricci, Union, Intersection, Difference, Transform, Offset, Twist)


def triple(array: NDArray[np.floating]) -> Vector:
    x, y, z = (float(component) for component in array)
    return x, y, z


@dataclass(frozen=True)
class MoreKinds:
    """Sources of further kinds of nodes for random trees."""

    leaf: Callable[[np.random.Generator], Node]
    combine: Callable[[np.random.Generator, list[Node]], Node] | None = None


def random_leaf(rng: np.random.Generator, more: MoreKinds | None = None) -> Node:
    if more and rng.random() < 0.5:
        return more.leaf(rng)
    color = triple(rng.uniform(0.0, 1.0, 3))
    radius = float(rng.uniform(0.2, 0.7))
    start = rng.uniform(-1.0, 1.0, 3)
    if rng.random() < 0.5:
        return Point(triple(start), radius=radius, color=color)
    end = start + rng.uniform(-0.8, 0.8, 3) * (rng.random() < 0.95)  # now and then of no length
    if rng.random() < 0.5:
        return Segment(triple(start), triple(end), radius=radius, color=color)
    end_radius = float(rng.uniform(0.2, 0.7))  # now and then one end holds the other
    return Cone(triple(start), triple(end), radius=radius, end_radius=end_radius, color=color)


def random_solid(rng: np.random.Generator) -> Node:
    """A torus, a disc, a box or an ellipsoid."""
    center, axis = triple(rng.uniform(-1.0, 1.0, 3)), triple(rng.normal(size=3))
    radius, color = float(rng.uniform(0.15, 0.5)), triple(rng.uniform(0.0, 1.0, 3))
    breadth, kind = float(rng.uniform(0.2, 0.9)), rng.integers(0, 4)
    if kind == 0:
        return Torus(center, axis, breadth, radius=radius, color=color)
    if kind == 1:
        return Disc(center, axis, breadth, radius=radius, color=color)
    if kind == 2:
        return Ellipsoid(center, triple(rng.uniform(0.15, 0.9, 3)), color=color)
    size = triple(rng.uniform(0.0, 1.2, 3) * (rng.random(3) < 0.9))  # now and then flat
    return Box(center, size, radius=radius, color=color)


SOLIDS = MoreKinds(random_solid)


def random_field(rng: np.random.Generator) -> Node:
    """A direct field of any kind."""
    center, color = triple(rng.uniform(-1.0, 1.0, 3)), triple(rng.uniform(0.0, 1.0, 3))
    kind, size = rng.integers(0, 6), triple(rng.uniform(0.6, 1.6, 3))
    if kind == 1:
        wavelength, level = rng.uniform(0.4, 1.0), rng.uniform(-0.3, 0.1)
        seed = int(rng.integers(0, 289))
        return Noise(center, size, float(wavelength), float(level), 0.4, seed, color=color)
    if kind == 0:
        period, thickness = rng.uniform(0.6, 1.5), rng.uniform(0.15, 0.3)
        return Gyroid(center, size, float(period), float(thickness), fade=0.3, color=color)
    a, b, c = (triple(corner) for corner in rng.uniform(-1.0, 1.0, (3, 3)))
    radius, end_radius = rng.uniform(0.15, 0.4, 2).tolist()
    if kind == 3:
        return ConvolutionSegment(a, b, radius=radius, end_radius=end_radius, color=color)
    if kind == 4:
        return ConvolutionArc(a, b, c, radius=radius, color=color)
    if kind == 5:
        return ConvolutionTriangle(a, b, c, radius=radius, color=color)
    vertical, horizontal = rng.choice([0.2, 0.5, 1.0, 1.5, 2.0], 2).tolist()
    return Superquadric(center, triple(rng.uniform(0.2, 0.8, 3)), vertical, horizontal, color=color)


FIELDS = MoreKinds(random_field)


def random_shape(rng: np.random.Generator) -> Node:
    """A curve, a flat or a solid of the library."""
    a, b, c, d = map(triple, rng.uniform(-1.0, 1.0, (4, 3)))
    axis, side = map(triple, rng.normal(size=(2, 3)))
    radius, color = float(rng.uniform(0.15, 0.5)), triple(rng.uniform(0.0, 1.0, 3))
    breadth, height = (float(length) for length in rng.uniform(0.2, 0.9, 2))
    match rng.integers(0, 14):
        case 0:
            return Circle(a, axis, breadth, radius=radius, color=color)
        case 1:
            return Arc(a, b, c, radius=radius, color=color)
        case 2:
            return QuadraticBezier(a, b, c, radius=radius, color=color)
        case 3:
            return CubicBezier(a, b, c, d, radius=radius, color=color)
        case 4:
            return Rectangle(a, axis, side, breadth, height, radius=radius, color=color)
        case 5:
            return Triangle(a, b, c, radius=radius, color=color)
        case 6:
            radii = rng.uniform(0.15, 0.5, 3).tolist()
            return TaperedBezier(
                a, b, c, radius=radii[0], control_radius=radii[1], end_radius=radii[2], color=color
            )
        case 7:
            return Polyline((a, b, c, d), radius=radius, color=color)
        case 8:
            return Stroke((a, b, c, d), rng.uniform(0.15, 0.5, 4), color=color)  # type: ignore[arg-type]
        case 9:
            angles, lengths = 0.7 * np.arange(9), 0.5 + 0.5 * (np.arange(9) % 2)
            star = np.column_stack([lengths * np.cos(angles), lengths * np.sin(angles), 0.0 * angles])
            return Polygon(star, radius=radius, color=color).rotate(axis, 70.0).translate(a)  # type: ignore[arg-type]
        case 10:
            return HalfSpace(a, axis, breadth, radius=radius, color=color)
        case _:
            return Cylinder(a, b, breadth, radius=radius, color=color)


SHAPES = MoreKinds(random_shape)
Profiled = (Primitive, Ellipsoid)
"""Classes that get a profile in random trees; tests of conformance give one to all."""

PROFILE_SOURCES = (random_leaf, random_solid, random_shape)


def random_profile(rng: np.random.Generator, leaf: Any, weights: Sequence[float]) -> Node:
    """A leaf with another falloff, width and weight, as far as it has them."""
    if not isinstance(leaf, Leaf):
        return cast(Node, leaf)
    if not isinstance(leaf, Profile):
        changed: Any = {"weight": float(rng.choice(weights))}
        if isinstance(leaf, Falling):
            changed["falloff"] = str(rng.choice(BUILT_IN_FALLOFFS))
        return cast(Node, replace(leaf, **changed))
    size = float(getattr(leaf, "radius", 0.5)) or 0.3
    width = None if rng.random() < 0.4 else float(size * rng.uniform(0.4, 2.0))
    falloff, weight = str(rng.choice(BUILT_IN_FALLOFFS)), float(rng.choice(weights))
    profiled: Any = replace(cast(Any, leaf), falloff=falloff, width=width, weight=weight)
    return cast(Node, profiled)


def random_profiled_leaf(rng: np.random.Generator) -> Node:
    leaf = PROFILE_SOURCES[int(rng.integers(0, 3))](rng)
    return random_profile(rng, leaf, (1.0, 1.0, 1.0, 0.6, 1.5)) if isinstance(leaf, Profiled) else leaf


def random_signed_leaf(rng: np.random.Generator) -> Node:
    leaf = PROFILE_SOURCES[int(rng.integers(0, 3))](rng)
    return random_profile(rng, leaf, (1.0, 1.0, 1.0, 1.0, -0.5, -1.5)) if isinstance(leaf, Profiled) else leaf


PROFILED = MoreKinds(random_profiled_leaf)
SIGNED = MoreKinds(random_signed_leaf)


def random_contact(rng: np.random.Generator, operands: list[Node]) -> Node:
    """Solids in contact, a solid pressed by another, or obstacles of different stiffness."""
    width, kind = float(rng.uniform(0.1, 0.5)), rng.integers(0, 4)
    ratio = float(np.exp2(rng.uniform(-1.5, 1.5)))
    heights = rng.uniform(0.0, min(0.25 * width, 0.1), len(operands)) * (rng.random() < 0.8)
    if kind == 0:
        return RatedUnion(operands[0], operands[1], stiffness_ratio=ratio)
    if kind == 1:
        deformation = Press if rng.random() < 0.5 else Bulge
        return deformation(*operands[:2], stiffness_ratio=ratio, width=width, height=float(heights[0]))
    several = operands[:3]
    stiffness = rng.uniform(1.0, 3.0, len(several) ** int(rng.integers(1, 3))) * (rng.random() < 0.7)
    return SolidContact(
        tuple(several),
        stiffness=tuple(stiffness.tolist()) if stiffness.any() else (),
        width=width,
        height=tuple(heights[: int(rng.choice([1, len(several)]))].tolist()),
    )


CONTACTS = MoreKinds(random_leaf, random_contact)


def random_deformation(rng: np.random.Generator, node: Node) -> Node:
    """A node under one of the library's warps, whose parameters suit its size."""
    lower, upper = (corner.astype(np.float64) for corner in node.support)
    low, high = (float(z) for z in np.sort(rng.uniform(lower[2], upper[2], 2)))
    high = max(high, low + 0.05)
    kind = rng.integers(0, 7)
    if kind == 0:
        return node.taper(float(rng.uniform(0.4, 2.0)), (low, high))
    if kind == 1:
        slope_x, slope_y = rng.uniform(-1.0, 1.0, 2)
        return node.shear(float(slope_x), float(slope_y), (low, high))
    if kind == 2:
        return node.stretch(float(rng.uniform(0.5, 2.0)), (low, high))
    if kind == 3:
        return node.twist(float(rng.uniform(-90.0, 90.0)), limits=(low, high))
    if kind == 4:
        seed = int(rng.integers(100))
        return node.noise_warp(float(rng.uniform(0.05, 0.2)), float(rng.uniform(0.5, 1.5)), seed=seed)
    degrees = float(rng.uniform(0.3, 0.95) * rng.choice([-1.0, 1.0])) * 57.0
    degrees /= max(*upper, *-lower) + 0.4  # an offset above may enlarge the node
    source = rng.uniform(lower, upper, (4, 3))
    moves = rng.uniform(-0.3, 0.3, (4, 3))
    for _ in range(20):
        try:
            deformed = (
                node.bend(degrees, (low, high))
                if kind == 5
                else node.curve_warp(source, source + moves, float(rng.uniform(0.5, 1.5)))
            )
            assert deformed.support
        except InvalidNode:
            degrees, moves = 0.7 * degrees, 0.7 * moves
        else:
            return deformed
    return node


def _deformed_blend(rng: np.random.Generator, operands: list[Node]) -> Node:
    return random_deformation(rng, reduce(add, operands[:2]))


DEFORMED = MoreKinds(random_leaf, _deformed_blend)


def random_blend(rng: np.random.Generator, operands: list[Node]) -> Node:
    """A combination by an operator of the library, or a macro of such."""
    first, second = operands[:2]
    width = float(rng.choice([0.02, 0.2, 0.5]))
    match rng.integers(0, 12):
        case 0:
            return SuperellipticBlend(operands, width=width, exponent=float(rng.choice([1.5, 2.0, 20.0])))
        case 1:
            return SmoothIntersection(first, second, width=width)
        case 2:
            return SmoothDifference(first, second, width=width)
        case 3:
            left, right = rng.choice([0.0, 10.0, 30.0, 44.0], 2).tolist()
            return ControllableBlend(first, second, left_angle=left, right_angle=right)
        case 4:
            return LocalBlend(first, second, operands[-1])
        case 5:
            names = tuple("abcd"[: len(operands)])
            pairs = [pair for pair in combinations(names, 2) if rng.random() < 0.6]
            return BlendGraph(tuple(operands), names=names, pairs=tuple(pairs))
        case 6:
            return Shell(random_leaf(rng), 0.1)
        case kind:
            kinds = (RUnion, RIntersection, RDifference, CleanUnion, SymmetricDifference)
            return kinds[int(kind) - 7](first, second)


BLENDED = MoreKinds(random_leaf, random_blend)


def random_transform(rng: np.random.Generator, node: Node) -> Node:
    """Moved, turned, and scaled by one factor or by three of any sign."""
    turned = node.rotate(rng.normal(size=3), float(rng.uniform(-180.0, 180.0)))
    factors = rng.uniform(0.7, 1.4, 3) * rng.choice([-1.0, 1.0], 3)
    if rng.random() < 0.4:
        factors = np.full(3, factors[0])
    placed = turned.scale(factors).translate(rng.uniform(-0.3, 0.3, 3))
    if rng.random() < 0.3:
        return placed.twist(float(rng.uniform(-60.0, 60.0)))
    return placed.offset(float(rng.uniform(-0.03, 0.05))) if rng.random() < 0.3 else placed


def random_tree(rng: np.random.Generator, depth: int = 4, more: MoreKinds | None = None) -> Node:
    """A tree of all kinds of nodes, about two units wide, at most `depth` deep."""
    kind = rng.integers(0, 11 if more and more.combine else 8) if depth else 0
    if kind <= 1:
        return random_leaf(rng, more)
    if kind == 2:
        return random_transform(rng, random_tree(rng, depth - 1, more))
    operands = [random_tree(rng, depth - 1, more) for _ in range(rng.integers(2, 5))]
    if more and more.combine and kind >= 8:
        return more.combine(rng, operands)
    if kind == 3:
        return Ricci(tuple(operands), exponent=float(rng.choice([1.0, 1.5, 2.0, 4.0, 20.0])))
    if kind == 4:
        return operands[0] - operands[1]
    combine = {5: add, 6: or_, 7: and_}[int(kind)]
    return reduce(combine, operands)


class RandomTrees(Sequence[Node]):
    """Trees with at least one combination each, made when they are asked for.

    Every kind of node occurs among two dozen of them.
    """

    def __init__(self, seed: int, count: int, depth: int = 4, more: MoreKinds | None = None) -> None:
        self._rng = np.random.default_rng(seed)
        self._count, self._depth, self._more = count, depth, more
        self._made: list[Node] = []

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, place: int) -> Node: ...

    @overload
    def __getitem__(self, place: slice) -> list[Node]: ...

    def __getitem__(self, place: int | slice) -> Node | list[Node]:
        places = range(self._count)[place]
        last = places if isinstance(places, int) else max(places, default=-1)
        while len(self._made) <= last:
            tree = random_tree(self._rng, self._depth, self._more)
            if len(tree.children) > 1:
                self._made.append(tree)
        return self._made[place]


def random_trees(seed: int, count: int, depth: int = 4, more: MoreKinds | None = None) -> list[Node]:
    """Return `RandomTrees` as a list."""
    return list(RandomTrees(seed, count, depth, more))


_coordinate = st.floats(-10.0, 10.0)
_vector = st.tuples(_coordinate, _coordinate, _coordinate)
_direction = _vector.filter(any)
_extents = st.tuples(*[st.floats(0.0, 10.0)] * 3)
_radius = st.floats(1e-3, 10.0)
_color = st.tuples(*[st.floats(0.0, 1.0)] * 3)
_factor = st.floats(0.1, 10.0) | st.floats(-10.0, -0.1)


def _extend(children: st.SearchStrategy[Node]) -> st.SearchStrategy[Node]:
    operands = st.lists(children, min_size=1, max_size=4).map(tuple)
    return st.one_of(
        st.builds(Sum, operands),
        st.builds(Union, operands),
        st.builds(Intersection, operands),
        st.builds(Ricci, operands, exponent=st.floats(1.0, 100.0)),
        st.builds(Difference, children, children),
        st.builds(lambda node, offset: node.translate(offset), children, _vector),
        st.builds(lambda node, factors: node.scale(factors), children, st.tuples(*[_factor] * 3)),
        st.builds(lambda node, degrees: node.rotate((1, 2, 3), degrees), children, st.floats(-360.0, 360.0)),
    )


def trees(max_leaves: int = 12) -> st.SearchStrategy[Node]:
    """Any tree of moderate numbers."""
    leaves = st.one_of(
        st.builds(Point, _vector, radius=_radius, color=_color),
        st.builds(Segment, _vector, _vector, radius=_radius, color=_color),
        st.builds(Box, _vector, _extents, radius=_radius, color=_color),
        st.builds(Torus, _vector, _direction, _radius, radius=_radius, color=_color),
        st.builds(Ellipsoid, _vector, st.tuples(*[st.floats(0.1, 10.0)] * 3), color=_color),
        st.builds(Disc, _vector, _direction, _radius, radius=_radius, color=_color),
        st.builds(Circle, _vector, _direction, _radius, radius=_radius, color=_color),
        st.builds(QuadraticBezier, _vector, _vector, _vector, radius=_radius, color=_color),
        st.builds(CubicBezier, *[_vector] * 4, radius=_radius, color=_color),
    )
    return st.recursive(leaves, _extend, max_leaves=max_leaves)
