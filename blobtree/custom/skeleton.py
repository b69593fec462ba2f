"""Custom skeletons: a primitive from one typed function that returns the closest point of the skeleton.

    @wp.func
    def ring(q: wp.vec3, center: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
        ...
        return closest_point

    Ring = define_skeleton(ring, limits={"size": (0.0, None)})
    model = Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2) + Point((1, 0, 0), radius=0.5)

Maps do not fold into the parameters, whose meaning is unknown: a primitive under a map carries that map on
the tape. `blobtree.nodes.primitives.Primitive` is the base of the class that it makes.
"""

from collections.abc import Mapping
from typing import Any

import warp as wp

from blobtree.custom.definition import Limits, custom_parameters, point_function, short_form
from blobtree.declare.formula import kind_name
from blobtree.nodes.primitives import Primitive

CustomPrimitive = Primitive
"""The former name of the base of the classes that `define_skeleton` returns."""


def define_skeleton(
    function: Any,
    *,
    convex: bool = False,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[Primitive]:
    """Return a class of primitives from a closest-point function: a short form of `Primitive`.

    Parameters
    ----------
    function
        ``(q: wp.vec3, parameters...) -> wp.vec3``, parameters being wp.float32, wp.int32, wp.vec2, wp.vec3 or
        wp.vec4; with or without ``@wp.func``. Of the constructs of Python it may use those that Warp and GLSL
        share (see `blobtree.transpile.glsl`).
    convex
        Straight lines between points of the skeleton stay in it; rays then take longer steps.
    name
        Name of the kind in files; by default the function's name. The class has the same name in CamelCase.
    limits
        By parameter (smallest or None, largest or None): of a number, or of the length of a vector.

    Returns
    -------
    type[Primitive]
        A node class: the function's parameters in order, then the keywords `radius` and `color`.

    Raises
    ------
    InvalidDefinition
        The function has no types or no source, or samples within the limits show that it does not return the
        closest point of any set. Nothing has been compiled by then.
    UntranslatableFunction
        The function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree.custom import define_skeleton
    >>> @wp.func
    ... def rod(q: wp.vec3, half: wp.float32) -> wp.vec3:
    ...     return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)
    >>> Rod = define_skeleton(rod, convex=True, limits={"half": (0.0, None)})  # doctest: +SKIP
    >>> Rod(1.0, radius=0.2)([[1.2, 0.0, 0.0]])  # doctest: +SKIP
    array([0.5], dtype=float32)
    """
    source, names = point_function(function, wp.vec3)
    parameters = custom_parameters(source, names, limits, Primitive)
    kind = kind_name(source, name)
    node: type[Primitive] = short_form(
        Primitive, kind, source, parameters, {"closest": source}, convex=convex
    )
    return node
