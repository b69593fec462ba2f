"""New nodes for a scene: primitives of every kind, and what can stand above a node.

Values follow from the declarations of the classes, so a new class can be added at once.
"""

import itertools
import math
from dataclasses import replace
from functools import cache
from typing import Any, get_type_hints

import numpy as np

from blobtree import Node
from blobtree._typing import Float64Array
from blobtree.declare.parameters import OPTIONAL, Parameter, Quantity, fields_of, parameters_of
from blobtree.declare.registry import CUSTOM_KINDS
from blobtree.errors import InvalidNode
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.operator import Operator
from blobtree.nodes.primitives import Leaf
from decals.errors import InvalidEdit
from decals.validation import one_of

PLACES = np.array([(-0.6, 0.0, 0.0), (0.0, 0.5, 0.0), (0.6, 0.0, 0.0), (0.0, -0.5, 0.0)])
"""Points of a new primitive in turn: a planar, convex loop."""

SHARES: dict[Quantity, float | tuple[float, ...]] = {
    Quantity.LENGTH: 0.5,
    Quantity.RADIUS: 0.25,
    Quantity.RADII: (0.25,) * len(PLACES),
    Quantity.EXTENTS: (1.0, 1.0, 1.0),
    Quantity.SEMI_AXES: (0.7, 0.5, 0.4),
    Quantity.WIDTH: 0.3,
    Quantity.DISTANCE: 0.1,
}
"""Lengths of a new node, as parts of its size."""

ANGLE = 30.0
"""Degrees; per size where a class counts them per unit."""

NATURAL = {
    "factor": 1.5,
    "slope_x": 0.5,
    "height": 0.05,
}
"""Numbers without unit by the name of their parameter; others are as near to 1 as their range allows."""

DIRECTIONS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Directions of a new primitive in turn."""

NOT_OFFERED = ("transform", "volume", "press", "bulge", "rated_union", "endless_repeat")
"""Kinds that need data, are parts, or have no mesh alone.

The gizmo moves nodes, `SolidContact` makes presses, bulges and rated unions, and an endless repeat needs a
finite solid around it.
"""

GENTLER = 1.0, 2.0, 4.0, 8.0, 16.0
"""Factors of the size of an operand for which warps of it are tried: they bend less per unit."""

PLACED = {Quantity.POINT, Quantity.POINTS}
"""Quantities of ends and control points."""

NAMED_SHARES = {"low": -0.5, "high": 0.5, "thickness": 0.1, "end_radius": 0.1}
"""Lengths by the name of their parameter: ends of a deformation, thickness of a wall, end of a limb."""


def built_in_kinds() -> dict[str, type[Node]]:
    """Return the built-in classes of nodes that a scene can get, by name."""
    return {kind.__name__: kind for tag, kind in NODE_KINDS.items() if tag not in NOT_OFFERED}


def kinds() -> dict[str, type[Node]]:
    """Return all classes of nodes that a scene can get, by name: built-in ones, then custom ones.

    A custom class whose name another class has is called "NAME (custom)", or "NAME (TAG)" with its tag.
    """
    found = built_in_kinds()
    custom: Any = CUSTOM_KINDS
    for tag, kind in custom.items():
        names = kind.__name__, f"{kind.__name__} (custom)", f"{kind.__name__} ({tag})"
        found[next((name for name in names if name not in found), names[-1])] = kind
    return found


def name_of(kind: type[Node]) -> str:
    """Return the name of a class among `kinds`."""
    return next((name for name, known in kinds().items() if known is kind), kind.__name__)


def checked_kind(name: object) -> type[Node]:
    """Return the class of a name, or raise `InvalidEdit`."""
    known = kinds()
    return known[one_of("kind", name, known, InvalidEdit)]


def operand_range(kind: type[Node]) -> tuple[int, float]:
    """Return the least and the largest number of operands: 0 for primitives, 1 for warps."""
    several = _operand_fields(kind).values()  # type: ignore[arg-type]  # classes are hashable
    ordered = issubclass(kind, Operator) and not kind.operator.commutes
    return len(several) + sum(several), math.inf if any(several) and not ordered else len(several) + ordered


@cache
def _operand_fields(kind: Any) -> dict[str, bool]:
    """Return the fields that hold operands: True for several, False for one."""
    hints, declared = get_type_hints(kind), parameters_of(kind)
    names = [field.name for field in fields_of(kind) if field.name not in declared]
    return {name: hints[name] is not Node for name in names}


def node_above(name: str, node: Node) -> Node:
    """Return a node of a class above another one, gentler than usual if the node is too large for it."""
    low, high = node.bounds
    size = float((high - low).max())
    for factor in GENTLER:
        try:
            return new_node(name, (node,), size=factor * size)
        except InvalidNode:
            continue
    return new_node(name, (node,), size=size)


def alternatives(node: Node) -> list[str]:
    """Return the names of the classes whose nodes can take the place of a node, with the same operands."""
    count = len(node.children)

    def takes(kind: type[Node]) -> bool:
        least, most = (0, 0) if issubclass(kind, Leaf) else operand_range(kind)
        return least <= count <= most

    return [name for name, kind in kinds().items() if takes(kind)]


def exchanged_node(node: Any, name: str) -> Node:
    """Return a node of another class with the same operands, in the place of a node.

    Parameters that both classes declare alike keep their values; lengths do so if ends or control points do.
    """
    low, high = node.bounds
    middle, size = (low + high).astype(np.float64) / 2, float((high - low).max())
    operands: tuple[Node, ...] = node.children
    single = len(operands) == 1
    fresh: Any = node_above(name, operands[0]) if single else new_node(name, operands, middle, size)
    before = parameters_of(type(node))
    alike = {
        shared: after.quantity
        for shared, after in parameters_of(type(fresh)).items()
        if shared in before and before[shared].quantity is after.quantity
    }
    ends = {quantity for shared, quantity in alike.items() if shared != "center"} & PLACED
    kept = {shared: getattr(node, shared) for shared, q in alike.items() if ends or q not in SHARES}
    if "points" in kept and "radii" not in kept and hasattr(fresh, "radii"):  # one for each point
        kept["radii"] = (getattr(node, "radius", fresh.radii[0]),) * len(kept["points"])
    changed: Node = replace(fresh, **kept)
    return changed


def families() -> dict[str, list[str]]:
    """Return the names of all classes in the order of `kinds`, by their number of operands.

    "primitives" have no operands, "modifiers" (warps, offsets, shells) have one, "combinations" more.
    """
    found: dict[str, list[str]] = {"primitives": [], "modifiers": [], "combinations": []}
    for name, kind in kinds().items():
        least = 0 if issubclass(kind, Leaf) else operand_range(kind)[0]
        found[[*found][min(least, 2)]].append(name)
    return found


def new_node(
    name: str, operands: tuple[Node, ...] = (), center: Float64Array | None = None, size: float = 1.0
) -> Node:
    """Return a node of a class with natural values.

    Parameters
    ----------
    name
        Name of the class, see `kinds`.
    operands
        Its operands, in order. A combination of two takes more only if it takes any number.
    center
        Middle of a primitive, shape (3,). Default: the origin.
    size
        Size of a primitive, or of the operands.

    Raises
    ------
    InvalidEdit
        There is no such class, or it does not take so many operands.
    InvalidNode
        The class refuses the values.
    """
    kind = checked_kind(name)
    least, most = operand_range(kind)
    if not least <= len(operands) <= most:
        raise InvalidEdit(f"{name}: expected {least} or more operands, at most {most:g}, got {len(operands)}")
    declared, several = parameters_of(kind), _operand_fields(kind)  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    pending = list(operands)
    used: dict[Quantity, int] = {}
    for field in fields_of(kind):
        parameter = declared.get(field.name)
        if parameter is None:
            values[field.name] = tuple(pending) if several[field.name] else pending[0]
            pending = [] if several[field.name] else pending[1:]
        elif OPTIONAL not in field.metadata and parameter.quantity is not Quantity.COLOR:
            turn = used.get(parameter.quantity, 0)
            used[parameter.quantity] = turn + 1
            middle = np.zeros(3) if center is None else center
            values[field.name] = _natural(parameter, turn, middle, size, len(operands))
    return kind(**values)


def _natural(parameter: Parameter, turn: int, center: Float64Array, size: float, operands: int) -> Any:
    """Return a value of the parameter that has this turn among those of its quantity."""
    match parameter.quantity:
        case Quantity.POINT:
            alone = parameter.name in ("center", "point", "corner", "origin")
            return tuple((center if alone else center + size * PLACES[turn % len(PLACES)]).tolist())
        case Quantity.POINTS:
            lift = np.array((0.0, 0.0, 0.2 * turn))
            return tuple(map(tuple, (center + size * (PLACES + lift)).tolist()))
        case Quantity.DIRECTION:
            return DIRECTIONS[turn % len(DIRECTIONS)]
        case Quantity.ANGLE:
            angle = ANGLE if parameter.natural is None else parameter.natural
            return min(angle, parameter.high) if parameter.is_bounded else angle / size
        case Quantity.FACTOR | Quantity.NUMBERS:
            natural = NATURAL.get(parameter.name, 1.0) if parameter.natural is None else parameter.natural
            number = float(np.clip(natural, parameter.low, parameter.high))
            if parameter.size > 1:
                return (number,) * parameter.size
            return int(number) if parameter.whole else number
        case Quantity.FACTORS | Quantity.DISTANCES:
            return (NATURAL["height"],) if parameter.name == "height" else ()
        case Quantity.OUTLINE:
            half = 0.5 * size  # a rectangle with a round side, beside the axis of a turn
            return f"M0 {-half}H{half}A{half} {half} 0 0 1 {half} {half}H0Z"
        case Quantity.CLAUSES:
            return f"x var-x\ny var-y\nz var-z\nf hypot x y\nd hypot f z\nr const {0.4 * size}\nv sub d r"
        case Quantity.NAMES:
            return _letters(operands)
        case Quantity.CHOICE:
            return parameter.choices[0]
        case Quantity.NAME_PAIRS:
            letters = _letters(operands)
            return tuple(itertools.pairwise(letters))
    share: Any = NAMED_SHARES.get(parameter.name, SHARES[parameter.quantity])
    return tuple(size * part for part in share) if isinstance(share, tuple) else size * share


def _letters(count: int) -> tuple[str, ...]:
    return tuple("abcdefghijklmnopqrstuvwxyz"[i % 26] + str(i // 26 or "") for i in range(count))
