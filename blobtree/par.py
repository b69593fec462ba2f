"""Specifiers of fields: what a parameter of a kind means, its range and its natural value.

    class Soft(Operator):
        hardness: float = par.factor("how sharp the blend is", low=0.0, high=4.0, natural=1.0)

Checks, documentation, files, panels and handles follow from it. Every specifier takes a description, a noun
phrase, and by name:

* `low` and `high`, the range of the number;
* `hint`, what to do about a number out of range;
* `default`, which makes the parameter optional;
* `natural`, the value of a new node in an editor; by default the default.
"""

import math
from dataclasses import MISSING, field, replace
from functools import partial
from typing import Any

from blobtree.declare.parameters import SPECIFIED, Parameter, Quantity
from blobtree.errors import InvalidDefinition, InvalidNode
from blobtree.validation import describe, real_number


def _field(
    quantity: Quantity,
    doc: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    hint: str = "",
    default: Any = MISSING,
    natural: Any = None,
    is_whole: bool = False,
) -> Any:
    """Return a field of a dataclass that declares a parameter."""
    if not isinstance(doc, str):
        raise InvalidDefinition(f"par.{quantity.value}: expected a description, got {describe(doc)}")
    if not _in_order(low, high):
        raise InvalidDefinition(
            f"{doc}: expected numbers low ≤ high, got {describe(low)} and {describe(high)}"
        )
    if natural is None and default is not MISSING:
        natural = default
    parameter = Parameter(quantity, doc, low=low, high=high, hint=hint, natural=natural, whole=is_whole)
    for name, value in (("default", default), ("natural", natural)):
        if value is not None and value is not MISSING:
            try:
                replace(parameter, name=name).check(value)
            except InvalidNode as error:
                raise InvalidDefinition(f"{doc}: {error}") from None
    return field(default=default, metadata={SPECIFIED: parameter})


def _in_order(low: object, high: object) -> bool:
    """Return True for two numbers of which the first is not the larger one."""
    try:
        return real_number(low) <= real_number(high)
    except (TypeError, ValueError):
        return False


factor = partial(_field, Quantity.FACTOR)
"""A number without unit."""

angle = partial(_field, Quantity.ANGLE)
"""An angle or a rate of turning, in degrees."""

length = partial(_field, Quantity.LENGTH)
"""A length above 0, in model units."""

distance = partial(_field, Quantity.DISTANCE)
"""A signed length, in model units."""

radius = partial(_field, Quantity.RADIUS)
"""A visible radius above 0, in model units; offsets and resizing change it."""

point = partial(_field, Quantity.POINT)
"""A point (3,); it moves with the node."""

points = partial(_field, Quantity.POINTS)
"""Points (n, 3); they move with the node."""

radii = partial(_field, Quantity.RADII)
"""Visible radii (n,), one for each point, above 0, in model units."""

direction = partial(_field, Quantity.DIRECTION)
"""A vector (3,) of any length above 0; rotations turn it. Formulas get it at length 1."""

extents = partial(_field, Quantity.EXTENTS)
"""Lengths (3,) along the axes, 0 or more, in model units."""

semi_axes = partial(_field, Quantity.SEMI_AXES)
"""Visible radii (3,) along the axes, above 0, in model units; resizing changes them."""

whole = partial(_field, Quantity.NUMBERS, is_whole=True)
"""A whole number."""
