"""Custom operators: a combination from one typed function of two operands.

    @wp.func
    def soft(a: wp.float32, b: wp.float32, hardness: wp.float32) -> wp.float32:
        ...
        return f

    Soft = define_operator(soft, steepest=1.0, like="blend", monotone=True, limits={"hardness": (0.0, 1.0)})
    model = Soft((Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)), 0.3)

The engine excludes cells by the claims of a definition, so checks look for samples that contradict a claim.
A missing claim costs speed only: fewer cells are pruned.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

import warp as wp

from blobtree.custom.definition import CustomNode, Limits, custom_parameters, defined_kind
from blobtree.declare.claims import UNBOUNDED, Like, OperatorRow, widened_range
from blobtree.declare.formula import Formula, derived, formula_of, generated, kind_name, returned_type
from blobtree.declare.operator_checks import Claims, check_directed_operator, check_operator
from blobtree.declare.parameters import Parameter
from blobtree.nodes.tree import AssociativeCombination
from blobtree.tape.data_region import TEXEL
from blobtree.transpile.derivative import directional_derivative
from blobtree.validation import finite_number

LEAST_OPERAND = 1e-18
"""Operands below are raised to it where partial derivatives are derived: quotients of them stay finite."""


class CustomCombination(CustomNode, AssociativeCombination):
    """A combination by a custom operator: the base of the classes that `define_operator` returns.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import CustomCombination, Point, define_operator
    >>> @wp.func
    ... def mean(a: wp.float32, b: wp.float32) -> wp.float32:
    ...     return 0.5 * (a + b)
    >>> Mean = define_operator(mean, steepest=0.5)
    >>> issubclass(Mean, CustomCombination)
    True
    >>> Mean((Point((0, 0, 0), radius=1), Point((1, 0, 0), radius=1))).kind
    'mean'
    """


def define_operator(
    function: Any,
    *,
    steepest: Any = None,
    like: Like | None = None,
    monotone: bool = False,
    order_free: bool = False,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
    gradients: bool = False,
    envelope: Any = None,
) -> type[CustomCombination]:
    """Return a class of combinations from a function that returns F(a, b).

    Parameters
    ----------
    function
        ``(a: wp.float32, b: wp.float32) -> wp.float32``, or with any number of wp.float32 more, its
        parameters; with or without ``@wp.func``. F must be continuous, nowhere negative, and 0 where both
        operands are. ∂F/∂a and ∂F/∂b are derived from its source. A function that returns
        ``wp.vec3(F, ∂F/∂a, ∂F/∂b)`` gives them itself: faster, or more exact in single precision.
    steepest
        Upper bound of ``abs(∂F/∂a)`` and ``abs(∂F/∂b)`` for all operands; or a typed function
        ``(max_a, max_b, parameters if any) -> wp.vec2`` of the largest values that the operands may have.
    like
        What F is where an operand is absent (0): with "blend" it is the other operand, with "intersection" 0,
        with "difference" a where b is absent and 0 where a is. Cells and boxes are pruned by it.
    monotone
        F never falls as an operand grows; with ``like="difference"``, never falls with a nor rises with b.
    order_free
        F(a, b) = F(b, a) and F(F(a, b), c) = F(a, F(b, c)): it takes any number of operands.
    name
        Name of the kind in files; by default the function's name. The class has the same name in CamelCase.
    limits
        ``{parameter: (smallest or None, largest or None)}``.
    gradients
        The function reads the gradients of its operands: its parameters are ``(a: wp.float32, b: wp.float32,
        gradient_a: wp.vec3, gradient_b: wp.vec3, ...)``, and ∂F/∂a and ∂F/∂b are those for fixed gradients.
        The gradient of the field also takes the change of the operands' gradients into account, exactly. F
        should be continuous in the gradients too. Give `envelope` in place of `steepest`; `monotone` and
        `order_free` cannot be claimed. Where rays cross such a blend, they take small steps.
    envelope
        With `gradients`: a typed function ``(a, b, parameters if any) -> wp.vec2`` of the smallest and the
        largest F for any gradients. Neither falls as an operand grows; with ``like="difference"`` neither
        falls with a nor rises with b.

    Returns
    -------
    type[CustomCombination]
        A node class: a tuple of operands, then the parameters by position or name.

    Raises
    ------
    InvalidDefinition
        The function has no types or no source, or sampled operands contradict a claim. Nothing has been
        compiled by then.
    UntranslatableFunction
        The function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import define_operator
    >>> @wp.func
    ... def average(a: wp.float32, b: wp.float32) -> wp.float32:
    ...     return 0.5 * (a + b)
    >>> Average = define_operator(average, steepest=0.5)  # doctest: +SKIP
    """
    value_alone = returned_type(function) in (wp.float32, float)
    source = formula_of(function, returns=wp.float32 if value_alone else wp.vec3)
    parameters = _parameters(source, limits, gradients)
    if value_alone:
        a, b = list(source.parameters)[:2]
        source = derived(source, (a, b), _WITH_PARTIALS.replace("{a}", a).replace("{b}", b), LEAST_OPERAND)
    if like is not None and like not in get_args(Like):
        known_likes = ", ".join(map(repr, get_args(Like)))
        raise source.refusal(f"like: expected one of {known_likes} or None, got {like!r}")
    if order_free and like == "difference":
        raise source.refusal("order_free: a difference depends on the order of its operands")
    bound = _bound(source, parameters, steepest, envelope, gradients)
    if gradients and (monotone or order_free):
        raise source.refusal("gradients: expected neither monotone nor order_free, which it cannot claim")
    kind = kind_name(source, name)
    bound_digest = bound if isinstance(bound, float) else bound.digest
    digest = source.digest_with(
        kind, parameters, bound_digest, like, monotone, order_free, *(["gradients"] * gradients)
    )
    claims = Claims(bound, like, monotone, order_free)

    def check() -> None:
        if gradients:
            directional_derivative(source.function, _operands_of(source, gradients=True))  # or refuse it here
            check_directed_operator(source, parameters, claims)
        else:
            check_operator(source, parameters, claims)

    node: type[CustomCombination] = defined_kind(
        CustomCombination,
        source,
        kind,
        digest,
        parameters,
        check=check,
        row=lambda: {"operator": (_directed_row if gradients else _row)(kind, digest, source, claims)},
    )
    return node


def _operands_of(source: Formula, gradients: bool) -> list[str]:
    """Return the names of the operands, and of their gradients if the operator reads them."""
    return list(source.parameters)[: 4 if gradients else 2]


def _parameters(
    source: Formula, limits: Mapping[str, Limits] | None, gradients: bool
) -> tuple[Parameter, ...]:
    """Return the parameters beside the operands."""
    operands = _operands_of(source, gradients)
    hints = list(source.parameters.values())
    floats = all(hint in (wp.float32, float) for hint in (*hints[:2], *hints[len(operands) :]))
    if not floats or len(hints) < 2 or (gradients and hints[2:4] != [wp.vec3, wp.vec3]):
        several = ", gradient_a: wp.vec3, gradient_b: wp.vec3" if gradients else ""
        raise source.refusal(
            f"expected (a: wp.float32, b: wp.float32{several}), and parameters of type wp.float32"
        )
    return custom_parameters(source, list(source.parameters)[len(operands) :], limits, CustomCombination)


def _bound(
    source: Formula, parameters: tuple[Parameter, ...], steepest: Any, envelope: Any, gradients: bool
) -> "float | Formula":
    """Return the bound that a definition needs: its envelope if it reads gradients, else `steepest`."""
    if not gradients:
        if envelope is not None:
            raise source.refusal("envelope: it is for operators with gradients=True; give steepest")
        if steepest is None:
            raise source.refusal("steepest: expected a bound on the partial derivatives, got none")
        return _steepness(source, steepest)
    if steepest is not None or not callable(envelope):
        raise source.refusal(
            f"gradients: expected envelope, a typed function, and no steepest; got envelope={envelope!r}"
        )
    bound = formula_of(envelope, returns=wp.vec2)
    if list(bound.parameters.values()) != [wp.float32] * (2 + len(parameters)):
        raise bound.refusal(f"expected (a, b, ...) with the {len(parameters)} parameters of {source.name}")
    return bound


def _steepness(source: Formula, steepest: Any) -> "float | Formula":
    """Return the bound on the partial derivatives, a number or a function."""
    if not callable(steepest):
        number = finite_number("steepest", steepest)
        if number <= 0.0:
            raise source.refusal(f"steepest: expected a number above 0 or a typed function, got {steepest!r}")
        return number
    bound = formula_of(steepest, returns=wp.vec2)
    if list(bound.parameters.values()) != list(source.parameters.values()):
        raise bound.refusal(f"expected (max_a, max_b, ...) of the same types as {source.name}")
    return bound


@dataclass(frozen=True)
class _Shape:
    """What a claim `like` implies."""

    absent: str
    """Lines that return the exact result where an operand is absent."""
    alone: str
    """Lines that return the slope where the result does not depend on the gradient of an absent operand."""
    corners: tuple[str, str] = ("a[0], b[0]", "a[1], b[1]")
    """Operands of the smallest and of the largest F, where it is monotone."""


_KEEP_A = "    if b <= 0.0:\n        return wp.vec3(a, 1.0, 0.0)\n"
_KEEP_B = "    if a <= 0.0:\n        return wp.vec3(b, 0.0, 1.0)\n"
_NOTHING = "    if {}:\n        return wp.vec3(0.0, 0.0, 0.0)\n"
_SLOPE_ALONE = "    if {}:\n        return {}\n"
_SHAPES: dict[str | None, _Shape] = {
    "blend": _Shape(
        _KEEP_A + _KEEP_B,
        _SLOPE_ALONE.format("max_b <= 0.0", "slope_a") + _SLOPE_ALONE.format("max_a <= 0.0", "slope_b"),
    ),
    "intersection": _Shape(
        _NOTHING.format("a <= 0.0 or b <= 0.0"),
        _SLOPE_ALONE.format("max_a <= 0.0 or max_b <= 0.0", "0.0"),
    ),
    "difference": _Shape(
        _NOTHING.format("a <= 0.0") + _KEEP_A,
        _SLOPE_ALONE.format("max_a <= 0.0", "0.0") + _SLOPE_ALONE.format("max_b <= 0.0", "slope_a"),
        ("a[0], b[1]", "a[1], b[0]"),
    ),
    None: _Shape(
        _NOTHING.format("a <= 0.0 and b <= 0.0"),
        _SLOPE_ALONE.format("max_a <= 0.0 and max_b <= 0.0", "0.0"),
    ),
}

_PARTIALS = '''\
def {name}(a: wp.float32, b: wp.float32, parameter: wp.float32{tape}) -> wp.vec3:
    """The user's operator, exact where an operand is absent."""
{absent}    return {function}(a, b{extra})
'''

_SLOPE = '''\
def {name}(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32,
    parameter: wp.float32{tape}
) -> wp.float32:
    """|F'| ≤ |∂F/∂a| |a'| + |∂F/∂b| |b'|; an operand that falls makes no F rise that rises with it."""
    k = {steepest}
    return k[0] * wp.max(slope_a, 0.0) + k[1] * wp.max(slope_b, 0.0)
'''

_WITH_PARTIALS = '''\
def {name}({typed}) -> wp.vec3:
    """The user's operator and its partial derivatives."""
    if {a} <= 0.0 and {b} <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    value, by_a, by_b = {partials}
    return wp.vec3(value, by_a, by_b)
'''

_RANGE = '''\
def {name}(a: wp.vec2, b: wp.vec2, parameter: wp.float32{tape}) -> wp.vec2:
    """From the middle of the operands' ranges F changes no faster than `steepest` says."""
    max_a = a[1]
    max_b = b[1]
    k = {steepest}
    middle = {partials}(0.5 * (a[0] + a[1]), 0.5 * (b[0] + b[1]), parameter{passed})[0]
    change = 0.5 * (k[0] * (a[1] - a[0]) + k[1] * (b[1] - b[0]))
    return widened_range(middle - change, middle + change)
'''

_DIRECTED_PARTIALS = '''\
def {name}(
    a: wp.float32, b: wp.float32, parameter: wp.float32, tape: wp.array(dtype=wp.vec4),
    direction_a: wp.vec3, direction_b: wp.vec3
) -> wp.vec3:
    """The user's operator, exact where an operand is absent."""
{absent}    return {function}(a, b, direction_a, direction_b{extra})
'''

_DIRECTED_SLOPE = '''\
def {name}(
    slope_a: wp.float32, slope_b: wp.float32, max_a: wp.float32, max_b: wp.float32
) -> wp.float32:
    """No bound is known where F depends on gradients."""
{alone}    return UNBOUNDED
'''

_DIRECTED_RANGE = '''\
def {name}(a: wp.vec2, b: wp.vec2, parameter: wp.float32, tape: wp.array(dtype=wp.vec4)) -> wp.vec2:
    """The user's envelope is monotone, so its extremes lie at corners."""
    if a[1] <= 0.0 and b[1] <= 0.0:
        return wp.vec2(0.0, 0.0)
    return widened_range({envelope}({low}{extra})[0], {envelope}({high}{extra})[1])
'''


def _directed_row(kind: str, digest: str, source: Formula, claims: Claims) -> OperatorRow:
    """Return the row of an operator that reads gradients."""
    shape, envelope, function = _SHAPES[claims.like], claims.steepest, source.function
    assert isinstance(envelope, Formula)
    low, high = shape.corners
    texts = {"absent": shape.absent, "alone": shape.alone, "low": low, "high": high}
    texts |= {"function": function.key, "envelope": envelope.function.key}
    texts |= _slots(len(source.parameters) - 4)
    scope: dict[str, Any] = {function.key: function, envelope.function.key: envelope.function}
    scope |= {"UNBOUNDED": UNBOUNDED, "widened_range": widened_range}
    return OperatorRow(
        kind,
        generated(kind, digest, "partials", _DIRECTED_PARTIALS, scope, **texts),
        generated(kind, digest, "slope", _DIRECTED_SLOPE, scope, **texts),
        claims.like,
        generated(kind, digest, "range", _DIRECTED_RANGE, scope, **texts),
        commutes=False,
        gradients=True,
        digest=digest,
    )


def _slots(count: int) -> dict[str, str]:
    """Return the text of generated functions that depends on the number of parameters.

    One parameter is the number `parameter` itself; several are on the tape from texel `parameter` on.
    """
    if count <= 1:
        return {"tape": "", "passed": "", "extra": ", parameter" * count}
    readings = [f", tape[int(parameter) + {number // TEXEL}][{number % TEXEL}]" for number in range(count)]
    return {"tape": ", tape: wp.array(dtype=wp.vec4)", "passed": ", tape", "extra": "".join(readings)}


def _row(kind: str, digest: str, source: Formula, claims: Claims) -> OperatorRow:
    """Return the row of the table, with functions generated around the user's."""
    shape, bound, function = _SHAPES[claims.like], claims.steepest, source.function
    texts = _slots(len(source.parameters) - 2) | {"absent": shape.absent, "function": function.key}
    scope: dict[str, Any] = {function.key: function, "widened_range": widened_range}
    if isinstance(bound, float):
        texts["steepest"] = f"wp.vec2({bound!r}, {bound!r})"
    else:
        texts["steepest"] = f"{bound.function.key}(max_a, max_b{texts['extra']})"
        scope[bound.function.key] = bound.function
    partials = generated(kind, digest, "partials", _PARTIALS, scope, **texts)
    texts["partials"] = partials.key
    scope[partials.key] = partials
    return OperatorRow(
        kind,
        partials,
        generated(kind, digest, "slope", _SLOPE, scope, **texts),
        claims.like,
        None if claims.monotone else generated(kind, digest, "range", _RANGE, scope, **texts),
        commutes=claims.order_free,
        monotone=claims.monotone and claims.like != "difference",
        digest=digest,
    )
