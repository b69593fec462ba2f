"""Custom skeletons: a primitive from one typed function that returns the closest point of the skeleton.

    @wp.func
    def ring(q: wp.vec3, center: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
        ...
        return closest_point

    Ring = define_skeleton(ring, limits={"size": (0.0, None)})
    model = Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2) + Point((1, 0, 0), radius=0.5)

The engine derives the rest from the function. The distance to a closest point changes by at most 1 per unit,
so balls bound the field over a cell and along a ray. Closest points seen from far away bound the skeleton
itself (`bounds_kernels`). Maps do not fold into the parameters, whose meaning is unknown: a primitive under
a map carries that map on the tape. Offsets change its radius.
"""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from itertools import product
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.custom.bounds_kernels import skeleton_boxes
from blobtree.custom.definition import (
    CustomNode,
    Limits,
    custom_parameters,
    defined_kind,
    point_function,
    tape_readings,
    texel_lines,
)
from blobtree.custom.skeleton_checks import check_skeleton
from blobtree.declare.formula import Formula, generated, kind_name
from blobtree.declare.parameters import Color, Parameter, Radius
from blobtree.errors import InvalidNode
from blobtree.formulas.skeletons import Skeleton, min_influence_of_one
from blobtree.nodes.primitives import DEFAULT_COLOR, INFLUENCE_SLOT, Primitive
from blobtree.tape.program import ProgramPrimitive
from blobtree.validation import Vector

Floats = NDArray[np.float64]


class CustomPrimitive(CustomNode, Primitive):
    """A primitive around a custom skeleton: the base of the classes that `define_skeleton` returns.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import CustomPrimitive, define_skeleton
    >>> @wp.func
    ... def bar(q: wp.vec3, half: wp.float32) -> wp.vec3:
    ...     return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)
    >>> Bar = define_skeleton(bar, convex=True, limits={"half": (0.0, None)})
    >>> issubclass(Bar, CustomPrimitive)
    True
    >>> Bar(1.0, radius=0.2).values
    {'half': 1.0}
    """

    if TYPE_CHECKING:

        def __init__(self, *parameters: Any, radius: float, color: Vector = ..., **named: Any) -> None: ...

    @classmethod
    def hulls(cls, primitives: Sequence[ProgramPrimitive]) -> Floats:
        """Return the corners (n, 8, 3) of boxes that hold the skeletons."""
        texels = cls.packed(primitives, np.ones((len(primitives), 1)), None)
        numbers = np.delete(texels.reshape(len(texels), -1), INFLUENCE_SLOT, axis=1)
        sizes = np.abs(numbers).max(axis=1, initial=0.0)
        lower, upper = skeleton_boxes(cls.skeleton, texels, sizes)
        unbounded = ~np.isfinite(lower).all(axis=1) | ~np.isfinite(upper).all(axis=1)
        if unbounded.any():
            raise InvalidNode(
                f"{primitives[int(np.argmax(unbounded))]!r}: its skeleton is unbounded or too large for "
                "float32, or a closest point is not finite; a skeleton must be bounded"
            )
        boxes = np.stack([lower, upper])
        corners = [boxes[list(sides), :, range(3)].T for sides in product((0, 1), repeat=3)]
        return np.stack(corners, axis=1)


def define_skeleton(
    function: Any,
    *,
    convex: bool = False,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[CustomPrimitive]:
    """Return a class of primitives whose skeleton is defined by a closest-point function.

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
    type[CustomPrimitive]
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
    >>> from blobtree import define_skeleton
    >>> @wp.func
    ... def rod(q: wp.vec3, half: wp.float32) -> wp.vec3:
    ...     return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)
    >>> Rod = define_skeleton(rod, convex=True, limits={"half": (0.0, None)})  # doctest: +SKIP
    >>> Rod(1.0, radius=0.2)([[1.2, 0.0, 0.0]])  # doctest: +SKIP
    array([0.5], dtype=float32)
    """
    source, names = point_function(function, wp.vec3)
    parameters = custom_parameters(source, names, limits, CustomPrimitive)
    kind = kind_name(source, name)
    digest = source.digest_with(kind, parameters, convex)
    node: type[CustomPrimitive] = defined_kind(
        CustomPrimitive,
        source,
        kind,
        digest,
        parameters,
        check=lambda: check_skeleton(source, parameters, convex=convex),
        row=lambda: {"skeleton": _row(kind, digest, source, parameters, convex=convex)},
        fields=[("_", KW_ONLY), ("radius", Radius), ("color", Color, field(default=DEFAULT_COLOR))],
    )
    return node


def _row(
    kind: str, digest: str, source: Formula, parameters: tuple[Parameter, ...], *, convex: bool
) -> Skeleton:
    """Return the row of the table, with functions generated around the user's."""
    readings, texels = tape_readings(parameters, skipped=INFLUENCE_SLOT)
    texels = max(texels, 1)
    texts = {"texels": texel_lines(texels), "influence": str(INFLUENCE_SLOT)}
    texts["call"] = f"{source.function.key}({', '.join(['q', *readings])})"
    scope = {source.function.key: source.function}
    closest = generated(kind, digest, "closest", _CLOSEST, scope, **texts)
    apart = (
        generated(kind, digest, "apart", _APART, {closest.key: closest}, call=closest.key) if convex else 1.0
    )
    smallest = cast(wp.Function, min_influence_of_one)
    return Skeleton(
        kind, closest, smallest, texels, folds_maps=False, convex=convex, apart=apart, digest=digest
    )


_CLOSEST = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """The user's closest point, and the influence."""
{texels}    c = {call}
    return wp.vec4(c[0], c[1], c[2], t0[{influence}])
'''

_APART = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """The squared distance from the skeleton, over the squared influence."""
    c = {call}(q, tape, at)
    w = q - wp.vec3(c[0], c[1], c[2])
    return wp.dot(w, w) / (c[3] * c[3])
'''
