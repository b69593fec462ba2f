"""Custom direct fields: a leaf from one typed function of position.

    @wp.func
    def wave(q: wp.vec3, rate: wp.float32) -> wp.float32:
        return 0.5 + 0.5 * wp.sin(rate * q[0])

    Wave = define_field(wave, steepest=wave_slope)
    model = Wave((0, 0, 0), (4, 2, 2), 3.0) + Point((1, 0, 0), radius=0.5)

`blobtree.nodes.fields.BoxedField` is the base of the class that it makes.
"""

from collections.abc import Mapping
from typing import Any

import warp as wp

from blobtree.custom.definition import Limits, custom_parameters, point_function, short_form
from blobtree.declare.formula import kind_name, returned_type
from blobtree.nodes.fields import BoxedField
from blobtree.validation import positive_number

CustomField = BoxedField
"""The former name of the base of the classes that `define_field` returns."""


def define_field(
    function: Any,
    *,
    steepest: Any,
    interval: Any = None,
    extent: float = 4.0,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[Any]:
    """Return a class of leaves whose field is a function of position: a short form of `BoxedField`.

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
    type[BoxedField]
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
    >>> from blobtree.custom import define_field
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
    parameters = custom_parameters(source, names, limits, BoxedField)
    node: type[Any] = short_form(
        BoxedField,
        kind_name(source, name),
        source,
        parameters,
        {
            "value_gradient" if returns is wp.vec4 else "value": source,
            "lipschitz": steepest,
            "interval": interval,
        },
        trial_extent=positive_number("extent", extent),
    )
    return node
