"""Custom warps: a deformation from one typed function that says where a point of space comes from.

    @wp.func
    def wave(q: wp.vec3, height: wp.float32) -> wp.vec3:
        return q - wp.vec3(0.0, 0.0, height * wp.sin(q[0]))

    Wave = define_warp(wave, stretch=wave_stretch, box=wave_height)
    model = Wave(Point((0, 0, 0), radius=1.0), 0.2)

`blobtree.nodes.warp.Warp` is the base of the class that it makes.
"""

from collections.abc import Mapping
from typing import Any

import warp as wp

from blobtree.custom.definition import Limits, custom_parameters, point_function, short_form
from blobtree.declare.formula import kind_name
from blobtree.nodes.warp import Warp
from blobtree.validation import positive_number

CustomWarp = Warp
"""The former name of the base of the classes that `define_warp` returns."""


def define_warp(
    forward: Any,
    *,
    stretch: Any,
    box: Any,
    pullback: Any = None,
    extent: float = 4.0,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[Any]:
    """Return a class of nodes that deform their child: a short form of `Warp`.

    Parameters
    ----------
    forward
        ``(q: wp.vec3, parameters...) -> wp.vec3``: the point of the child's space that the deformation takes
        to q. It must be continuous. Parameters are wp.float32, wp.int32, wp.vec2, wp.vec3 or wp.vec4.
    stretch
        Upper bound of the norm of the Jacobian of `forward`: a number, or a typed function ``(parameters...)
        -> wp.float32``, or ``(q: wp.vec3, reach: wp.float32, parameters...) -> wp.float32`` for the ball of
        radius `reach` around q.
    box
        Largest distance by which `forward` moves a point, as a number; or a plain function ``(lower, upper,
        **parameters) -> (lower, upper)`` that returns a box outside of which `forward` takes no point into
        the box lower, upper.
    pullback
        ``(q: wp.vec3, g: wp.vec3, parameters...) -> wp.vec3``: the transposed Jacobian at q times g. By
        default it is derived from `forward`.
    extent
        Half side of the cube around the origin in which samples try the claims.
    name
        Name of the kind in files; by default the function's name. The class has the same name in CamelCase.
    limits
        By parameter (smallest or None, largest or None): of a number, or of the length of a vector.

    Returns
    -------
    type[Warp]
        A node class: `child`, then the function's parameters in order.

    Raises
    ------
    InvalidDefinition
        A function has no types or no source; or samples contradict a claim, or show a singular Jacobian.
        Nothing has been compiled by then.
    UntranslatableFunction
        A function leaves the shared subset; the message names file and line.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import Point
    >>> from blobtree.custom import define_warp
    >>> @wp.func
    ... def sway(q: wp.vec3, width: wp.float32) -> wp.vec3:
    ...     return wp.vec3(q[0] - width * wp.sin(q[2]), q[1], q[2])
    >>> @wp.func
    ... def sway_stretch(width: wp.float32) -> wp.float32:
    ...     return 1.0 + wp.abs(width)
    >>> Sway = define_warp(sway, stretch=sway_stretch, box=0.5, limits={"width": (-0.5, 0.5)})
    >>> Sway(Point((0, 0, 0), radius=1.0), 0.3).values
    {'width': 0.3}
    """
    source, names = point_function(forward, wp.vec3)
    parameters = custom_parameters(source, names, limits, Warp)
    claim = {"outer_box": staticmethod(box)} if callable(box) else {"motion": box}
    node: type[Any] = short_form(
        Warp,
        kind_name(source, name),
        source,
        parameters,
        {"forward": source, "lipschitz": stretch, "pullback": pullback},
        trial_extent=positive_number("extent", extent),
        **claim,
    )
    return node
