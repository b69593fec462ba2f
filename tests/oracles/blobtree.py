"""Node trees in plain float64 NumPy, by recursion over their structure: no program, no tape, no interpreter.

Colours are folded from left to right with the weights |∂F/∂a|·a and |∂F/∂b|·b. In a sum and a Ricci blend
these are aⁿ and bⁿ over a common divisor, and union and intersection choose one operand: so the order of a
fold does not matter, save on exact ties of a union or an intersection. A difference has an order of its own.
"""

from dataclasses import dataclass, fields, replace
from functools import reduce
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree import (
    Bend,
    BlendGraph,
    Box,
    Bulge,
    Circle,
    Cone,
    ConvolutionArc,
    ConvolutionSegment,
    ConvolutionStroke,
    ConvolutionTriangle,
    CurveWarp,
    Cylinder,
    Difference,
    Disc,
    Ellipsoid,
    EndlessRepeat,
    Expression,
    GradientBlend,
    Gyroid,
    HalfSpace,
    Intersection,
    LimitedTwist,
    LocalBlend,
    Masked,
    Mirror,
    Node,
    Noise,
    NoiseWarp,
    Offset,
    Operator,
    Point,
    PolarRepeat,
    Polygon,
    Polyline,
    Press,
    Primitive,
    RatedUnion,
    Repeat,
    Ricci,
    RoundDifference,
    RoundIntersection,
    RoundUnion,
    Segment,
    Shear,
    Shell,
    SolidContact,
    Stretch,
    Stroke,
    Sum,
    Superquadric,
    SymmetricDifference,
    Taper,
    TaperedBezier,
    Torus,
    Transform,
    Transition,
    Twist,
    Union,
    Unmasked,
    Volume,
)
from blobtree.declare.claims import Support
from blobtree.declare.parameters import Quantity, parameters_of
from blobtree.nodes.deformations import Deformation
from blobtree.nodes.primitives import Leaf, Profile
from blobtree.nodes.tree import Macro
from blobtree.nodes.values import parameter_values
from tests.oracles import (
    blends,
    convolution,
    custom_kinds,
    deformations,
    direct_fields,
    expressions,
    falloffs,
    shapes,
    sharp,
    volumes,
)

Floats = NDArray[np.float64]

HUGE = 64.0
"""Factor of radii that takes every point of a test into a primitive's influence."""

RIM = np.sqrt(1.0 - 0.5 ** (1.0 / 3.0))


ENDLESS_REACH = 14.0
"""Distance up to which an endless repeat has copies here."""


@dataclass(frozen=True)
class Field:
    """Value (n,), colour (n, 3), and how far (n,), in field values, the next kink of an operator is away."""

    value: Floats
    color: Floats
    margin: Floats


def evaluate(node: Node, points: ArrayLike) -> Field:
    """The field of `node` at `points` (n, 3), raised to 0 as operators other than the sum read it."""
    field = signed(node, points)
    if (field.value >= 0.0).all():
        return field
    margin = np.where(field.value == 0.0, field.margin, np.minimum(field.margin, np.abs(field.value)))
    return replace(field, value=np.maximum(field.value, 0.0), margin=margin)


def signed(node: Node, points: ArrayLike) -> Field:
    """The field of `node` at `points` (n, 3), below 0 where negative weights outweigh the rest."""
    q = np.asarray(points, np.float64)
    match node:
        case Leaf() if sharp.is_sharp(node):
            ratio, margin = sharp.ratio(node, q)
            return _falling(ratio, sharp.mean_radius(node), getattr(node, "width", None), node, margin)
        case HalfSpace(point=point, normal=normal, radius=0.0):
            end = np.array(point) - node.extent * np.array(normal) / np.linalg.norm(normal)
            same: Any = {name: getattr(node, name) for name in ("falloff", "width", "weight", "color")}
            return signed(Cylinder(point, tuple(end), node.extent, radius=0.0, **same), q)
        case Expression(size=size, width=width):
            (d, margin), mean = expressions.distances(node, q), 0.25 * min(size)
            return _falling(1.0 + d / mean, mean, width, node, margin / mean)
        case Primitive() if node.profiled:
            return _profiled(node, q)
        case Ellipsoid(semi_axes=axes, width=width):
            ratio = np.linalg.norm((q - np.array(node.center)) / np.array(axes), axis=1)
            relative = None if width is None else width / float(np.cbrt(np.prod(axes)))
            return _falling(ratio, 1.0, relative, node, np.full(len(q), np.inf))
        case Point(center=center, radius=radius, color=color):
            return _leaf(q - np.array(center), radius, color)
        case Segment(start=start, end=end, radius=radius, color=color):
            return _leaf(q - _closest_on_segment(q, np.array(start), np.array(end)), radius, color)
        case (
            Circle(center=center, axis=axis, circle_radius=ring, radius=radius, color=color)
            | Torus(center=center, axis=axis, ring_radius=ring, radius=radius, color=color)
        ):
            across, along = _cylindrical(q, center, axis)
            leaf = _leaf_at(np.hypot(across - ring, along) * RIM / radius, color)
            return replace(leaf, margin=across)  # on the axis all points of the circle are closest
        case Disc(center=center, axis=axis, disc_radius=disc, radius=radius, color=color):
            across, along = _cylindrical(q, center, axis)
            return _leaf_at(np.hypot(np.maximum(across - disc, 0.0), along) * RIM / radius, color)
        case Box(center=center, size=size, radius=radius, color=color):
            beyond = np.maximum(np.abs(q - np.array(center)) - 0.5 * np.array(size), 0.0)
            return _leaf(beyond, radius, color)
        case Superquadric(center=center, semi_axes=semi_axes):
            x, y, z = (np.abs(q - np.array(center)) / np.array(semi_axes)).T
            vertical, horizontal = node.vertical, node.horizontal
            across = (x ** (2.0 / horizontal) + y ** (2.0 / horizontal)) ** (horizontal / vertical)
            ratio = (across + z ** (2.0 / vertical)) ** (vertical / 2.0)
            edges = np.minimum(np.minimum(x, y), z)  # diamonds have edges there
            return _falling(ratio, float(np.cbrt(np.prod(semi_axes))), node.width, node, edges)
        case Leaf() if isinstance(node, shapes.KINDS):
            radius = node.radii[0] + shapes.growth_of(node) if isinstance(node, Stroke) else node.radius
            width, free = node.width, np.full(len(q), np.inf)
            leaf, next_leaf = (_falling(d, radius, width, node, free) for d in shapes.distances(node, q))
            apart = np.where(next_leaf.value != 0.0, np.abs(leaf.value - next_leaf.value), np.inf)
            if isinstance(node, shapes.CURVES):
                apart[shapes.near_focus(node, q)] = 0.0
            return replace(leaf, margin=np.minimum(apart, leaf.margin))
        case Gyroid(center=center, period=period, thickness=thickness):
            x, y, z = 2.0 * np.pi / period * (q - np.array(center)).T
            level = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
            ratio = np.abs(level) / (0.5 * thickness * 2.0 * np.pi / period * 1.529)
            leaf = _falling(ratio, 0.5 * thickness, node.width, node, np.full(len(q), np.inf))
            return replace(leaf, value=leaf.value * direct_fields.window(node, q))
        case Noise(center=center, wavelength=wavelength, color=color):
            noise = direct_fields.gradient_noise((q - np.array(center)) / wavelength, node.seed)
            t = np.clip(0.5 + (noise - node.level) / (2.0 * node.softness), 0.0, 1.0)
            value = t * t * (3.0 - 2.0 * t) * direct_fields.window(node, q)
            return replace(_leaf_at(np.zeros(len(q)), color), value=node.weight * value)
        case ConvolutionSegment() | ConvolutionArc() | ConvolutionTriangle():
            value = node.weight * convolution.evaluate(node, q)[:, 0]
            return Field(value, np.tile(np.array(node.color), (len(q), 1)), np.full(len(q), np.inf))
        case Volume():
            ratio = 1.0 + volumes.distance(node, q) * (1.0 / RIM - 1.0) / node.width
            return _falling(ratio, 1.0, 1.0 / RIM - 1.0, node, volumes.clearance(node, q))
        case Primitive(radius=radius, color=color) if node.digest:
            closest, clearance = custom_kinds.CLOSEST[node.kind](q, **node.values)
            return replace(_leaf(q - closest, radius, color), margin=clearance)
        case Operator() if node.digest:
            return reduce(
                lambda a, b: _custom(a, b, node), [evaluate(operand, q) for operand in node.operands]
            )
        case Cone(color=color):
            return _leaf_at(_least_ratio(q, node), color)
        case Twist(child=child, degrees=degrees):
            return signed(child, _turned(q, -np.radians(degrees) * q[:, 2]))
        case Taper() | Shear() | Stretch() | LimitedTwist() | Bend() | NoiseWarp() | CurveWarp():
            unwarped, kink = deformations.unwarped(node, q)
            inner = signed(node.child, unwarped)
            return replace(inner, margin=np.minimum(inner.margin, kink))
        case Offset(child=child, distance=distance):
            return signed(grown(child, distance), q)
        case Transform(child=child, matrix=matrix):
            linear, offset = np.array(matrix)[:, :3], np.array(matrix)[:, 3]
            return signed(child, np.linalg.solve(linear, (q - offset).T).T)
        case Difference(solid=solid, tool=tool):
            return _difference(evaluate(solid, q), evaluate(tool, q))
        case Bulge(solid=solid, obstacle=obstacle):
            a, b = evaluate(solid, q), evaluate(obstacle, q)
            pressed = pressed_field(a, b, node.stiffness_ratio, node.width, node.height)
            beyond = 0.5 - rated(b.value, node.stiffness_ratio)
            value = np.where(beyond > 0.0, pressed.value, a.value)
            margin = np.where(beyond > 0.0, pressed.margin, a.margin)
            return Field(value, a.color, np.minimum(margin, np.abs(beyond)))
        case Press(solid=solid, obstacle=obstacle):
            shape = node.stiffness_ratio, node.width, node.height
            return pressed_field(evaluate(solid, q), evaluate(obstacle, q), *shape)
        case RatedUnion(first=first, second=second, stiffness_ratio=ratio):
            a, b = evaluate(first, q), evaluate(second, q)
            b = replace(b, value=rated(b.value, ratio))
            return _choose(a, b, a.value >= b.value)
        case SolidContact():
            return evaluate(outside_of(node), q)
        case Sum(operands=operands):
            return reduce(_sum, [signed(operand, q) for operand in operands])
        case Ricci(operands=operands, exponent=1.0):
            return reduce(_sum, [signed(operand, q) for operand in operands])
        case Ricci(operands=operands, exponent=exponent):
            return reduce(lambda a, b: _ricci(a, b, exponent), [evaluate(operand, q) for operand in operands])
        case Union(operands=operands):
            return reduce(lambda a, b: _choose(a, b, a.value >= b.value), [evaluate(x, q) for x in operands])
        case Intersection(operands=operands):
            return reduce(lambda a, b: _choose(a, b, a.value <= b.value), [evaluate(x, q) for x in operands])
        case GradientBlend(operands=(first, second)):
            return _blended(evaluate(first, q), evaluate(second, q), node, opening=opening_of(node, q))
        case Operator() if node.operator.name in blends.VALUES:
            values = parameter_values(node)
            fields = [evaluate(x, q) for x in node.operands]
            return reduce(lambda a, b: _blended(a, b, node, **values), fields)
        case ConvolutionStroke() | Mirror() | Repeat() | EndlessRepeat() | PolarRepeat():
            return signed(written_out(node), q)
        case Macro():
            return evaluate(written_out(node), q)
    raise TypeError(type(node))


def value(node: Node, points: ArrayLike) -> Floats:
    """The field's values (n,)."""
    return signed(node, points).value


def gradient(node: Node, points: ArrayLike, step: float = 1e-6) -> Floats:
    """Central differences (n, 3)."""
    q = np.asarray(points, np.float64)
    shifts = step * np.concatenate([np.eye(3), -np.eye(3)])
    values = value(node, (q + shifts[:, None]).reshape(-1, 3)).reshape(2, 3, -1)  # few calls of many points
    sides: Floats = ((values[0] - values[1]) / (2.0 * step)).T
    return sides


def opening_of(node: GradientBlend, q: Floats) -> Floats:
    """The openings (n,) of a gradient blend."""
    first, second = (direction(operand, q) for operand in node.operands)
    return blends.opening(first, second, node.start_angle, node.full_angle)


def direction(node: Node, q: Floats) -> Floats:
    """The gradient (n, 3), in which the openings of gradient blends, and of sums of them, are held fixed."""
    match node:
        case GradientBlend(operands=(first, second)):
            opening = opening_of(node, q)
            a, b = value(first, q), value(second, q)
            by_a, by_b, _ = blends.partials(blends.opened, a, b, opening=opening)
            towards: Floats = by_a[:, None] * direction(first, q) + by_b[:, None] * direction(second, q)
            return towards
        case Sum(operands=operands):
            return np.asarray(np.sum([direction(operand, q) for operand in operands], axis=0))
    return gradient(node, q, step=1e-4)


def grown(node: Node, distance: float) -> Node:
    """`node` with every radius larger by `distance`, those of tools and of negative weights smaller."""
    if isinstance(node, Profile) and node.weight < 0.0:
        distance = -distance
    match node:
        case Leaf() if sharp.is_sharp(node):
            return cast(Node, sharp.grown(node, distance))
        case Operator(operands=(solid, tool)) if node.operator.support is Support.LEFT:
            return replace(node, operands=(grown(solid, distance), grown(tool, -distance)))
        case Operator():
            return replace(node, operands=tuple(grown(operand, distance) for operand in node.operands))
        case ConvolutionArc() | ConvolutionTriangle():
            return replace(node, radius=node.radius + distance)
        case ConvolutionSegment():
            return replace(node, radius=node.radius + distance, end_radius=node.end_radius + distance)
        case Ellipsoid():  # an offset of the unit ball that is scaled
            larger = 1.0 + distance / float(np.cbrt(np.prod(node.semi_axes)))
            return replace(node, semi_axes=tuple(larger * np.array(node.semi_axes)))
        case Superquadric():
            x, y, z = node.semi_axes
            return replace(node, semi_axes=(x + distance, y + distance, z + distance))
        case TaperedBezier(radius=radius, control_radius=control, end_radius=end):
            radius, control, end = (value + distance for value in (radius, control, end))
            return replace(node, radius=radius, control_radius=control, end_radius=end)
        case Stroke():
            return shapes.GrownStroke.of(node, distance)
        case HalfSpace(point=point, normal=normal, radius=radius):
            moved = np.array(point) + distance * np.array(normal) / np.linalg.norm(normal)
            return replace(node, point=tuple(moved), radius=radius + distance)
        case Noise():
            return replace(node, level=node.level - 1.18 * distance / node.wavelength)
        case Volume():
            return replace(node, growth=node.growth + distance)
        case Gyroid():
            return replace(node, thickness=node.thickness + 2.0 * distance)
        case Cone():
            return replace(node, radius=node.radius + distance, end_radius=node.end_radius + distance)
        case Primitive() | Polyline() | Polygon():
            return _with_radius(node, node.radius + distance)
        case Offset(child=child, distance=more):
            return grown(child, distance + more)
        case Transform(child=child, matrix=matrix):
            volume = abs(np.linalg.det(np.array(matrix)[:, :3]))
            return Transform(grown(child, distance / float(np.cbrt(volume))), matrix)
        case Twist(child=child) | Deformation(child=child) | NoiseWarp(child=child) | CurveWarp(child=child):
            return replace(node, child=grown(child, distance))
        case Press(solid=solid, obstacle=obstacle):
            return replace(node, solid=grown(solid, distance), obstacle=grown(obstacle, -distance))
        case RatedUnion(first=first, second=second):
            return replace(node, first=grown(first, distance), second=grown(second, distance))
        case SolidContact():
            return grown(outside_of(node), distance)
        case Difference(solid=solid, tool=tool):
            return Difference(grown(solid, distance), grown(tool, -distance))
        case Macro():
            return grown(written_out(node), distance)
    raise TypeError(type(node))


def written_out(node: Node) -> Node:
    """The nodes that a macro of blends stands for."""
    match node:
        case Shell(child=child, thickness=thickness):
            return Difference(child, grown(child, -thickness))
        case Mirror(child=child, axis=axis):
            signs = [-1.0 if name == axis else 1.0 for name in "xyz"]
            return Sum(child, Transform(child, tuple((*row, 0.0) for row in np.diag(signs).tolist())))
        case Repeat() | EndlessRepeat() | PolarRepeat():
            kind: Any = Sum if node.joining == "sum" else Union
            return cast(Node, kind([Transform(node.child, matrix) for matrix in copy_maps(node)]))
        case RoundUnion() | RoundIntersection() | RoundDifference():
            return node.expanded  # `tests.blobtree.nodes.test_rounds` measures where its arcs end
        case SymmetricDifference(first=a, second=b):
            return Union(Difference(a, b), Difference(b, a))
        case ConvolutionStroke(points=points, radii=radii, color=color):
            ends = list(zip(pairwise(points), pairwise(radii), strict=True))
            same: Any = {"color": color, "weight": node.weight}
            return Sum([ConvolutionSegment(*p, radius=r[0], end_radius=r[1], **same) for p, r in ends])
        case LocalBlend(first=a, second=b, region=region):
            return Sum(Union(a, b), Masked(Intersection(a, b), region))
        case Transition(outside=outside, inside=inside, region=region):
            return Sum(Unmasked(outside, region), Masked(inside, region))
        case BlendGraph(operands=operands, names=names, pairs=pairs):
            return Union([Sum([operands[i] for i in group]) for group in blends.cliques(names, pairs)])
    raise TypeError(type(node))


def copy_maps(node: Repeat | EndlessRepeat | PolarRepeat) -> list[Any]:
    """The maps, three rows of four numbers, from the child of a repeat to its copies.

    Of an endless one they are the copies within `ENDLESS_REACH`.
    """
    if isinstance(node, PolarRepeat):
        n = np.array(node.axis) / np.linalg.norm(node.axis)
        cross = np.cross(np.eye(3), n)
        maps = []
        for angle in 2.0 * np.pi * np.arange(node.count) / node.count:
            linear = np.cos(angle) * np.eye(3) + np.sin(angle) * cross
            maps.append(np.column_stack([linear + (1.0 - np.cos(angle)) * np.outer(n, n), np.zeros(3)]))
    else:
        step = np.array(node.step)
        mirror = np.eye(3) - 2.0 * np.outer(step, step) / np.dot(step, step)
        last = int(ENDLESS_REACH / np.linalg.norm(step)) if isinstance(node, EndlessRepeat) else 0
        numbers = range(-last, last + 1) if isinstance(node, EndlessRepeat) else range(node.count)
        odd = mirror if node.copies == "mirrored" else np.eye(3)
        maps = [np.column_stack([odd if number % 2 else np.eye(3), number * step]) for number in numbers]
    return [tuple(map(tuple, matrix.tolist())) for matrix in maps]


def pressed_solids(contact: SolidContact) -> tuple[Node, ...]:
    """The solids of a contact, each pressed by all others at once."""
    solids = contact.operands
    pressed: list[Node] = []
    for i, solid in enumerate(solids):
        others = [(contact.stiffness_ratio(i, j), solids[j]) for j in range(len(solids)) if j != i]
        if not others:
            return solids
        first, obstacle = others[0]
        for ratio, other in others[1:]:
            obstacle = RatedUnion(obstacle, other, stiffness_ratio=ratio / first)
        height = bulge_height(contact, i)
        pressed.append(Press(solid, obstacle, stiffness_ratio=first, width=contact.width, height=height))
    return tuple(pressed)


def outside_of(contact: SolidContact) -> Union:
    """The union of the solids of a contact, each with its bulges, but not compressed."""
    return Union(
        tuple(
            Bulge(**{item.name: getattr(solid, item.name) for item in fields(Press)})
            if isinstance(solid, Press)
            else solid
            for solid in pressed_solids(contact)
        )
    )


def bulge_height(contact: SolidContact, number: int) -> float:
    """Height as given for a solid; a single one is that of the softest, others divide it by stiffness."""
    count = len(contact.operands)
    heights = np.atleast_1d(contact.height).tolist()
    if len(heights) == count:
        return float(heights[number])
    size = len(contact.stiffness) // count
    rows = (
        [sum(contact.stiffness[i * size : (i + 1) * size]) for i in range(count)] if size else [1.0] * count
    )
    return float(heights[0] * min(rows) / rows[number])


def rated(value: Floats, ratio: float) -> Floats:
    """Linear above ½; below, x = 2f becomes x / (k + (1 − k) x)."""
    x = 2.0 * value
    return np.where(
        x >= 1.0, 0.5 + ratio * (value - 0.5), 0.5 * x / (ratio + (1.0 - ratio) * np.minimum(x, 1.0))
    )


def pressed_field(a: Field, b: Field, ratio: float, w: float, h: float) -> Field:
    """a − (m − ½) inside the obstacle; outside, a plus (a parabola, then a cubic) · smoothstep(4a)."""
    t = 0.5 - rated(b.value, ratio)
    rising = t - t**2 / (4.0 * h) if h else np.zeros_like(t)
    v = (t - 2.0 * h) / (w - 2.0 * h)
    humps = np.select(
        [t <= 0.0, t <= 2.0 * h, t < w], [0.0, rising, h * (1.0 - 3.0 * v**2 + 2.0 * v**3)], 0.0
    )
    x = np.minimum(4.0 * a.value, 1.0)
    fade = 3.0 * x**2 - 2.0 * x**3
    value = np.where(t > 0.0, a.value + humps * fade, np.maximum(a.value + t, 0.0))
    margin = np.minimum(a.margin, b.margin)
    if h == 0.0:
        margin = np.minimum(margin, np.abs(t))
    margin = np.where(x < 1.0, np.minimum(margin, np.abs(t)), margin)
    margin = np.where(t <= 0.0, np.minimum(margin, np.abs(a.value + t)), margin)
    return Field(value, a.color, margin)


def _with_radius(node: Any, radius: float) -> Node:
    changed: Node = replace(node, radius=radius)
    return changed


def _profiled(node: Primitive, q: Floats) -> Field:
    """A primitive with a profile; its ratio |q − c| / radius comes from a huge one without a profile."""
    radii = [name for name, p in parameters_of(type(node)).items() if p.quantity is Quantity.RADIUS]
    plain: Any = {"falloff": "wyvill", "width": None, "weight": 1.0}
    huge = replace(node, **plain, **{name: HUGE * getattr(node, name) for name in radii})
    base = evaluate(huge, q)
    ratio = HUGE * np.sqrt(np.maximum(1.0 - np.cbrt(base.value), 0.0)) / RIM
    return _falling(ratio, float(getattr(node, radii[0])), node.width, node, base.margin)


def _falling(ratio: Floats, radius: float, width: float | None, node: Any, margin: Floats) -> Field:
    """The field at distances (n,) over the radius, by the falloff of a node."""
    name = str(getattr(node.falloff, "name", node.falloff))
    rim = falloffs.rim(name)
    d = rim * ratio if width is None else rim + (ratio - 1.0) * radius * (1.0 - rim) / width
    value = node.weight * falloffs.value(name, np.clip(d, 0.0, 1.0))
    if width is not None and width * rim > radius * (1.0 - rim):  # the field has a kink on the skeleton
        margin = np.minimum(margin, 0.1 * ratio)  # beside it, float32 has few digits of the direction
    return Field(value, np.tile(np.array(node.color), (len(ratio), 1)), margin)


def _sum(a: Field, b: Field) -> Field:
    if (a.value >= 0.0).all() and (b.value >= 0.0).all():
        return _ricci(a, b, 1.0)
    weights = np.maximum(a.value, 0.0), np.maximum(b.value, 0.0)
    total = weights[0] + weights[1]
    share = np.where(total > 0.0, weights[1] / np.where(total > 0.0, total, 1.0), b.value > a.value)
    return Field(a.value + b.value, _mixed(a, b, 1.0 - share, share), np.minimum(a.margin, b.margin))


def _turned(q: Floats, angle: Floats) -> Floats:
    x, y, z = q.T
    return np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z], axis=1)


def _cylindrical(q: Floats, center: Any, axis: Any) -> tuple[Floats, Floats]:
    """Distances (n,) from the line through `center` along `axis`, and heights (n,) along it."""
    normal = np.array(axis) / np.linalg.norm(axis)
    offsets = q - np.array(center)
    along = offsets @ normal
    return np.linalg.norm(offsets - along[:, None] * normal, axis=1), along


def _least_ratio(q: Floats, cone: Cone) -> Floats:
    """Least |q − c(t)| / influence(t) over the balls along the axis, by ternary search."""

    def ratio(t: Floats) -> Floats:
        center = (1.0 - t)[:, None] * np.array(cone.start) + t[:, None] * np.array(cone.end)
        influence = ((1.0 - t) * cone.radius + t * cone.end_radius) / RIM
        distance: Floats = np.linalg.norm(q - center, axis=1) / influence
        return distance

    return sharp.least(ratio, len(q), rounds=42)


def _leaf_at(ratio: Floats, color: Any) -> Field:
    count = len(ratio)
    value = np.maximum(1.0 - ratio**2, 0.0) ** 3
    return Field(value, np.tile(np.array(color), (count, 1)), np.full(count, np.inf))


def _leaf(offset: Floats, radius: float, color: Any) -> Field:
    return _leaf_at(np.linalg.norm(offset, axis=1) * RIM / radius, color)


def _closest_on_segment(q: Floats, start: Floats, end: Floats) -> Floats:
    axis = end - start
    squared = float(axis @ axis)
    share = np.clip((q - start) @ axis / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(q))
    closest: Floats = start + share[:, None] * axis
    return closest


def _custom(a: Field, b: Field, node: Operator) -> Field:
    value, by_a, by_b, kink = custom_kinds.OPERATORS[node.kind](a.value, b.value, **node.values)
    weights = np.abs(by_a) * a.value, np.abs(by_b) * b.value
    total = weights[0] + weights[1]
    share = np.where(total > 0.0, weights[1] / np.where(total > 0.0, total, 1.0), b.value > a.value)
    margin = np.minimum(np.minimum(a.margin, b.margin), kink)
    return Field(value, _mixed(a, b, 1.0 - share, share), margin)


def _blended(a: Field, b: Field, node: Operator, **values: Any) -> Field:
    """A blend of the library; its partial derivatives are differences."""
    name = node.operator.name
    value = blends.VALUES[name](a.value, b.value, **values)
    by_a, by_b, _ = blends.partials(blends.VALUES[name], a.value, b.value, **values)
    weights = np.abs(by_a) * a.value, np.abs(by_b) * b.value
    total = weights[0] + weights[1]
    share = np.where(total > 0.0, weights[1] / np.where(total > 0.0, total, 1.0), b.value > a.value)
    kink = blends.kink(name, a.value, b.value, **values)
    return Field(value, _mixed(a, b, 1.0 - share, share), np.minimum(np.minimum(a.margin, b.margin), kink))


def _ricci(a: Field, b: Field, exponent: float) -> Field:
    larger = np.maximum(a.value, b.value)
    safe = np.where(larger > 0.0, larger, 1.0)
    powers = (a.value / safe) ** exponent, (b.value / safe) ** exponent
    total = powers[0] + powers[1]
    weights = [power / np.where(total > 0.0, total, 1.0) for power in powers]
    weights[0] = np.where(total > 0.0, weights[0], 1.0)
    return Field(larger * total ** (1.0 / exponent), _mixed(a, b, *weights), np.minimum(a.margin, b.margin))


def _choose(a: Field, b: Field, takes_a: NDArray[np.bool_]) -> Field:
    winner = np.where(takes_a, a.value, b.value)
    tie = np.abs(a.value - b.value)
    tie[(a.value == 0.0) & (b.value == 0.0)] = np.inf
    margin = np.minimum(np.minimum(a.margin, b.margin), tie)
    return Field(winner, np.where(takes_a[:, None], a.color, b.color), margin)


def _difference(a: Field, b: Field) -> Field:
    top = np.maximum(a.value, 1.0)
    complement = top - b.value * (2.0 * top - 1.0)
    keeps = (a.value < complement) | (b.value == 0.0)
    above = a.value > 1.0
    slope_a = np.where(keeps, 1.0, np.where(above, 1.0 - 2.0 * b.value, 0.0))
    slope_b = np.where(keeps, 0.0, np.where(above, 1.0 - 2.0 * a.value, -1.0))
    weight_a, weight_b = np.abs(slope_a) * a.value, np.abs(slope_b) * b.value
    result = np.where(keeps, a.value, np.maximum(complement, 0.0))
    kinks = np.minimum(np.abs(a.value - complement), np.minimum(np.abs(complement), np.abs(a.value - 1.0)))
    kinks[b.value == 0.0] = np.inf
    total = weight_a + weight_b
    total[total == 0.0] = 1.0
    color = _mixed(a, b, weight_a / total, weight_b / total)
    return Field(result, color, np.minimum(np.minimum(a.margin, b.margin), kinks))


def _mixed(a: Field, b: Field, weight_a: Floats, weight_b: Floats) -> Floats:
    mixed: Floats = a.color * weight_a[:, None] + b.color * weight_b[:, None]
    return mixed
