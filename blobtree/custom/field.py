"""Custom direct fields: a leaf from one typed function of position.

    @wp.func
    def wave(q: wp.vec3, rate: wp.float32) -> wp.float32:
        return 0.5 + 0.5 * wp.sin(rate * q[0])

    Wave = define_field(wave, steepest=wave_slope)
    model = Wave((0, 0, 0), (4, 2, 2), 3.0) + Point((1, 0, 0), radius=0.5)

The function may return its value alone; then its gradient is derived (`transpile.derivative`). Rays and cells
rely on the claimed slope, so checks look for samples that contradict it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import warp as wp

from blobtree.custom.definition import CustomNode, Limits, custom_parameters, register, registered
from blobtree.custom.field_checks import FieldClaims, check_field
from blobtree.custom.source import (
    CustomSource,
    custom_source,
    generated,
    kind_name,
    node_class,
    returned_type,
)
from blobtree.formulas.fields import FieldKind
from blobtree.nodes.fields import BoxedField
from blobtree.nodes.parameters import Parameter
from blobtree.transpile.derivative import directional_derivative
from blobtree.validation import Vector, positive_number

FIRST_NUMBER = 7
"""Place of the first parameter on the tape, in floats: behind the middle, `fade` and the half lengths."""

ROUNDING = 4e-6
"""Widening of a custom field's range, for the rounding errors of the user's function."""


class CustomField(CustomNode, BoxedField):
    """A field in a box by a user's function: the base of the classes that `define_field` returns.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import CustomField, define_field
    >>> @wp.func
    ... def layers(q: wp.vec3) -> wp.float32:
    ...     return 0.5 + 0.5 * wp.cos(3.0 * q[2])
    >>> Layers = define_field(layers, steepest=1.5)
    >>> issubclass(Layers, CustomField)
    True
    """

    if TYPE_CHECKING:

        def __init__(
            self,
            center: Vector,
            size: Vector,
            *parameters: Any,
            fade: float = ...,
            color: Vector = ...,
            **named: Any,
        ) -> None: ...


@dataclass(frozen=True)
class _Definition:
    """A user's functions, their parameters and claims."""

    source: CustomSource
    parameters: tuple[Parameter, ...]
    claims: FieldClaims


def define_field(
    function: Any,
    *,
    steepest: Any,
    interval: Any = None,
    extent: float = 4.0,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[CustomField]:
    """Return a class of leaves whose field is a function of position.

    Parameters
    ----------
    function
        ``(q: wp.vec3, parameters...) -> wp.float32``, the field, or ``-> wp.vec4``, the field and its
        gradient (f, ∂f/∂x, ∂f/∂y, ∂f/∂z). q counts from the middle of the leaf's box. f must be continuous
        and nowhere negative; the surface is where it is ½, and it is larger inside. Parameters are
        wp.float32, wp.int32, wp.vec2, wp.vec3 or wp.vec4.
    steepest
        Upper bound of the gradient's length: a number, or a typed function ``(parameters...) ->
        wp.float32``, or ``(center: wp.vec3, radius: wp.float32, parameters...) -> wp.float32`` of a ball.
    interval
        Typed function ``(center: wp.vec3, radius: wp.float32, parameters...) -> wp.vec2``: the smallest and
        largest value in a ball, or wider bounds. By default they follow from `steepest`. It saves time where
        it is tighter.
    extent
        Half side of the cube around the origin in which samples try the claims, in the function's units.
    name
        Name of the kind in files; by default the function's name. The class has the same name in CamelCase.
    limits
        By parameter (smallest or None, largest or None): of a number, or of the length of a vector.

    Returns
    -------
    type[CustomField]
        A node class: `center` and `size` of its box, the function's parameters in order, then the keywords
        `fade` and `color`. The field fades to 0 inside the faces of the box, see `BoxedField`.

    Raises
    ------
    InvalidDefinition
        A function has no types or no source, or samples contradict a claim. Nothing has been compiled by
        then.
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import define_field
    >>> @wp.func
    ... def ripples(q: wp.vec3, rate: wp.float32) -> wp.float32:
    ...     return 0.5 + 0.5 * wp.sin(rate * q[0])
    >>> @wp.func
    ... def ripple_slope(rate: wp.float32) -> wp.float32:
    ...     return 0.5 * wp.abs(rate)
    >>> Ripples = define_field(ripples, steepest=ripple_slope)
    >>> Ripples((0, 0, 0), (4, 2, 2), 3.0).values
    {'rate': 3.0}
    """
    returns = returned_type(function)
    source = custom_source(function, returns=wp.vec4 if returns is wp.vec4 else wp.float32)
    first, *names = list(source.parameters) or [""]
    if source.parameters.get(first) is not wp.vec3:
        raise source.refusal("expected the point `q: wp.vec3` as its first parameter")
    parameters = custom_parameters(source, names, limits, CustomField)
    kind = kind_name(source, name)
    claims = FieldClaims(
        _steepest(source, parameters, steepest),
        None if interval is None else _claim(source, parameters, interval, wp.vec2, "interval"),
        positive_number("extent", extent),
        derived=returns is not wp.vec4,
    )
    digest = source.digest_with(kind, parameters, claims.digest)
    known = registered(kind)
    if known is not None and issubclass(known, CustomField) and known.digest == digest:
        return known
    check_field(source, parameters, claims)
    definition = _Definition(source, parameters, claims)
    node: type[CustomField] = node_class(
        kind,
        source,
        [(parameter.name, Annotated[Any, parameter]) for parameter in parameters],
        CustomField,
        {
            "__doc__": source.python.__doc__ or f"A field by the function {kind!r}.",
            "kind": kind,
            "digest": digest,
            "parameters": parameters,
            "field_kind": _row(kind, digest, definition),
        },
    )
    register(node)
    return node


def _steepest(source: CustomSource, parameters: tuple[Parameter, ...], claim: Any) -> float | CustomSource:
    """Return the claimed slope as a number or a function."""
    if isinstance(claim, int | float | np.number) and not isinstance(claim, bool):
        if not 0.0 <= claim < np.inf:
            raise source.refusal(f"steepest: expected a number from 0 or a typed function, got {claim!r}")
        return float(claim)
    return _claim(source, parameters, claim, wp.float32, "steepest")


def _claim(
    source: CustomSource, parameters: tuple[Parameter, ...], function: Any, returns: Any, name: str
) -> CustomSource:
    """Return a claim's function, whose parameters must be those of the field, behind a ball or not."""
    claim = custom_source(function, returns=returns)
    names, types = list(claim.parameters), list(claim.parameters.values())
    ball = types[:2] in ([wp.vec3, wp.float32], [wp.vec3, float])
    expected = [source.parameters[parameter.name] for parameter in parameters]
    if types[2:] == expected and ball:
        return claim
    if types == expected and name == "steepest":
        return claim
    wanted = ", ".join(["center: wp.vec3", "radius: wp.float32", *(item.name for item in parameters)])
    raise source.refusal(f"{name}: expected a function of ({wanted}), got one of ({', '.join(names)})")


def _row(kind: str, digest: str, definition: _Definition) -> FieldKind:
    """Return the row of the table, with functions generated around the user's."""
    source, parameters, claims = definition.source, definition.parameters, definition.claims
    texels = -(-(FIRST_NUMBER + sum(parameter.size for parameter in parameters)) // 4)
    readings = _readings(parameters)
    shared = {
        "texels": "".join(f"    t{i} = tape[at + {i}]\n" for i in range(texels)),
        "call": f"{source.function.key}({', '.join(['x', *readings])})",
    }
    value_name = f"custom_{kind}_value_gradient_{digest}"
    scope: dict[str, Any] = {source.function.key: source.function}
    body = _GIVEN.format(**shared)
    if claims.derived:
        derivative = directional_derivative(source.function, [next(iter(source.parameters))])
        scope[derivative.key] = derivative
        rest = "".join(f", {reading}" for reading in readings)
        body = _DERIVED.format(derivative=derivative.key, rest=rest)
    value_gradient = generated(value_name, _VALUE.format(name=value_name, body=body, **shared), scope)
    bounds_name = f"custom_{kind}_bounds_{digest}"
    scope = {source.function.key: source.function}
    bounds = generated(
        bounds_name,
        _BOUNDS.format(
            name=bounds_name,
            slope=_claim_call(claims.steepest, readings, scope),
            range=_range(definition, shared["call"], readings, scope),
            **shared,
        ),
        scope,
    )
    return FieldKind(kind, value_gradient, bounds, texels, windowed=True, digest=digest)


def _claim_call(claim: float | CustomSource, readings: list[str], scope: dict[str, Any]) -> str:
    """Return the expression of a claim, and put its function into the scope."""
    if isinstance(claim, float):
        return repr(claim)
    scope[claim.function.key] = claim.function
    ball = ["x", "radius"] if len(claim.parameters) > len(readings) else []
    return f"{claim.function.key}({', '.join([*ball, *readings])})"


def _range(definition: _Definition, call: str, readings: list[str], scope: dict[str, Any]) -> str:
    """Return the lines that compute the range of the user's function over a ball."""
    if definition.claims.interval is not None:
        return f"    r = {_claim_call(definition.claims.interval, readings, scope)}\n"
    value = call if definition.claims.derived else f"{call}[0]"
    return f"    f = {value}\n    r = wp.vec2(f - slope * radius, f + slope * radius)\n"


_VALUE = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """The user's field and its gradient, seen from the middle of its box."""
{texels}    x = q - wp.vec3(t0[0], t0[1], t0[2])
{body}    return f
'''

_GIVEN = "    f = {call}\n"

_DERIVED = """\
    value, along_x = {derivative}(x, wp.vec3(1.0, 0.0, 0.0){rest})
    same_value, along_y = {derivative}(x, wp.vec3(0.0, 1.0, 0.0){rest})
    again_value, along_z = {derivative}(x, wp.vec3(0.0, 0.0, 1.0){rest})
    f = wp.vec4(value, along_x, along_y, along_z)
"""

_BOUNDS = f'''\
def {{name}}(
    center: wp.vec3, radius: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32
) -> wp.vec3:
    """Bounds of the user's field over a ball, by the claims about it."""
{{texels}}    x = center - wp.vec3(t0[0], t0[1], t0[2])
    slope = {{slope}}
{{range}}    low = wp.max(r[0] - {ROUNDING} * (1.0 + wp.abs(r[0])), 0.0)
    high = wp.max(r[1] + {ROUNDING} * (1.0 + wp.abs(r[1])), 0.0)
    return wp.vec3(low, high, slope)
'''


def _readings(parameters: tuple[Parameter, ...]) -> list[str]:
    """Return the expressions that read each parameter from the texels t0, t1 and so on."""
    readings, place = [], FIRST_NUMBER
    for parameter in parameters:
        components = [f"t{k // 4}[{k % 4}]" for k in range(place, place + parameter.size)]
        place += parameter.size
        if parameter.size > 1:
            readings.append(f"wp.vec{parameter.size}({', '.join(components)})")
        else:
            readings.append(f"int({components[0]})" if parameter.whole else components[0])
    return readings
