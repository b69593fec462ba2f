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
from typing import TYPE_CHECKING, Any

import warp as wp

from blobtree.custom.definition import (
    CustomNode,
    Limits,
    bound_call,
    claimed_bound,
    claimed_function,
    custom_parameters,
    defined_kind,
    point_function,
    tape_readings,
    texel_lines,
)
from blobtree.custom.field_checks import FieldClaims, check_field
from blobtree.declare.formula import Formula, generated, kind_name, returned_type
from blobtree.declare.parameters import Parameter
from blobtree.formulas.fields import FieldKind
from blobtree.nodes.fields import BoxedField
from blobtree.transpile.derivative import partial_derivatives
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
    source, names = point_function(function, wp.vec4 if returns is wp.vec4 else wp.float32)
    parameters = custom_parameters(source, names, limits, CustomField)
    kind = kind_name(source, name)
    ball = {"center": wp.vec3, "radius": wp.float32}
    claims = FieldClaims(
        claimed_bound(source, parameters, steepest, "steepest", ("center", "radius"), positive=False),
        None
        if interval is None
        else claimed_function(source, parameters, interval, "interval", ball, wp.vec2),
        positive_number("extent", extent),
        derived=returns is not wp.vec4,
    )
    digest = source.digest_with(kind, parameters, claims.digest)
    node: type[CustomField] = defined_kind(
        CustomField,
        source,
        kind,
        digest,
        parameters,
        check=lambda: check_field(source, parameters, claims),
        row=lambda: {"field_kind": _row(kind, digest, source, parameters, claims)},
    )
    return node


def _row(
    kind: str, digest: str, source: Formula, parameters: tuple[Parameter, ...], claims: FieldClaims
) -> FieldKind:
    """Return the row of the table, with functions generated around the user's."""
    readings, texels = tape_readings(parameters, FIRST_NUMBER)
    shared = {
        "texels": texel_lines(texels),
        "call": f"{source.function.key}({', '.join(['x', *readings])})",
    }
    scope: dict[str, Any] = {source.function.key: source.function}
    body = _GIVEN.format(**shared)
    if claims.derived:
        partials = partial_derivatives(source.function, [next(iter(source.parameters))])
        scope[partials.key] = partials
        body = _DERIVED.format(call=f"{partials.key}({', '.join(['x', *readings])})")
    value_gradient = generated(kind, digest, "value_gradient", _VALUE, scope, body=body, **shared)
    slope, called = bound_call(claims.steepest, ("x", "radius"), readings)
    scope = {source.function.key: source.function, **called}
    value = shared["call"] if claims.derived else f"{shared['call']}[0]"
    between = f"    f = {value}\n    r = wp.vec2(f - slope * radius, f + slope * radius)\n"
    if claims.interval is not None:
        call, called = bound_call(claims.interval, ("x", "radius"), readings)
        between, scope = f"    r = {call}\n", {**scope, **called}
    bounds = generated(kind, digest, "bounds", _BOUNDS, scope, slope=slope, range=between, **shared)
    return FieldKind(kind, value_gradient, bounds, texels, windowed=True, digest=digest)


_VALUE = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """The user's field and its gradient, seen from the middle of its box."""
{texels}    x = q - wp.vec3(t0[0], t0[1], t0[2])
{body}    return f
'''

_GIVEN = "    f = {call}\n"

_DERIVED = """\
    value, along_x, along_y, along_z = {call}
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
