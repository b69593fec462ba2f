"""Custom warps: a deformation from one typed function that says where a point of space comes from.

    @wp.func
    def wave(q: wp.vec3, height: wp.float32) -> wp.vec3:
        return q - wp.vec3(0.0, 0.0, height * wp.sin(q[0]))

    Wave = define_warp(wave, stretch=wave_stretch, box=wave_height)
    model = Wave(Point((0, 0, 0), radius=1.0), 0.2)

The function maps a point of the deformed space to the space of the child, as `formulas.warps` describes. Its
transposed Jacobian is derived from the source, unless a function for it is given.
"""

import inspect
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from blobtree._typing import Box, Float64Array
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
from blobtree.custom.warp_checks import WarpClaims, check_warp
from blobtree.declare.formula import Formula, generated, kind_name
from blobtree.declare.parameters import Parameter
from blobtree.errors import InvalidNode
from blobtree.formulas.warps import SpaceWarp
from blobtree.nodes.node import Node
from blobtree.nodes.tree import Placed
from blobtree.transpile.derivative import partial_derivatives
from blobtree.validation import positive_number

FIRST_NUMBER = 1
"""Place of the first parameter on the tape, in floats: behind the stretch of the map."""


@dataclass(frozen=True, eq=False, repr=False)
class CustomWarp(CustomNode, Placed):
    """A node under a user's warp: the base of the classes that `define_warp` returns.

    Examples
    --------
    >>> import warp as wp
    >>> from blobtree import CustomWarp, define_warp
    >>> @wp.func
    ... def lean(q: wp.vec3) -> wp.vec3:
    ...     return wp.vec3(q[0] - 0.2 * wp.sin(q[2]), q[1], q[2])
    >>> Lean = define_warp(lean, stretch=1.11, box=0.2)
    >>> issubclass(Lean, CustomWarp)
    True
    """

    if TYPE_CHECKING:

        def __init__(self, child: Node, *parameters: Any, **named: Any) -> None: ...

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The numbers of the parameters, one after the other."""
        numbers = (item.components(getattr(self, item.name)) for item in self.parameters)
        return tuple(itertools.chain.from_iterable(numbers))


def define_warp(
    forward: Any,
    *,
    stretch: Any,
    box: Any,
    pullback: Any = None,
    extent: float = 4.0,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[CustomWarp]:
    """Return a class of nodes that deform their child.

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
    type[CustomWarp]
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
    >>> from blobtree import Point, define_warp
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
    parameters = custom_parameters(source, names, limits, CustomWarp)
    kind = kind_name(source, name)
    at_point = {"q": wp.vec3, "g": wp.vec3}
    claims = WarpClaims(
        claimed_bound(source, parameters, stretch, "stretch", ("q", "reach"), positive=True),
        _box(source, parameters, box),
        None
        if pullback is None
        else claimed_function(source, parameters, pullback, "pullback", at_point, wp.vec3),
        positive_number("extent", extent),
    )
    digest = source.digest_with(kind, parameters, claims.digest, _box_text(box))
    node: type[CustomWarp] = defined_kind(
        CustomWarp,
        source,
        kind,
        digest,
        parameters,
        check=lambda: check_warp(source, parameters, claims),
        row=lambda: {"warp": _row(kind, digest, source, parameters, claims)},
    )
    return node


def _box(
    source: Formula, parameters: tuple[Parameter, ...], box: Any
) -> Callable[[Float64Array, Float64Array, tuple[float, ...]], Box]:
    """Return the function (lower, upper, numbers of the parameters) of the claim."""
    if isinstance(box, int | float | np.number) and not isinstance(box, bool):
        if not 0.0 <= box < np.inf:
            raise source.refusal(f"box: expected a distance from 0 or a function, got {box!r}")
        distance = float(box)
        return lambda lower, upper, _numbers: (lower - distance, upper + distance)
    if not callable(box):
        raise source.refusal(f"box: expected a distance or a function (lower, upper, ...), got {box!r}")

    def outer(lower: Float64Array, upper: Float64Array, numbers: tuple[float, ...]) -> Box:
        values: dict[str, Any] = {}
        remaining = list(numbers)
        for item in parameters:
            taken, remaining = remaining[: item.size], remaining[item.size :]
            values[item.name] = tuple(taken) if item.size > 1 else int(taken[0]) if item.whole else taken[0]
        try:
            low, high = box(lower.copy(), upper.copy(), **values)
            corners = np.asarray(low, np.float64), np.asarray(high, np.float64)
        except Exception as error:  # the function is the user's own
            raise InvalidNode(f"{source.name}: its box fails: {type(error).__name__}: {error}") from error
        if not all(corner.shape == (3,) and np.isfinite(corner).all() for corner in corners):
            raise InvalidNode(
                f"{source.name}: expected its box to be two corners (3,), got {low!r}, {high!r}"
            )
        return corners

    return outer


def _box_text(box: Any) -> str:
    """Return a text that differs between boxes."""
    try:
        return inspect.getsource(box) if callable(box) else repr(float(box))
    except (OSError, TypeError):
        return repr(box)


def _row(
    kind: str, digest: str, source: Formula, parameters: tuple[Parameter, ...], claims: WarpClaims
) -> SpaceWarp:
    """Return the row of the table, with functions generated around the user's."""
    readings, count = tape_readings(parameters, FIRST_NUMBER)
    made = partial(generated, kind, digest, texels=texel_lines(count if parameters else 0))
    rest = "".join(f", {reading}" for reading in readings)
    function = source.function
    forward = made("forward", _FORWARD, {function.key: function}, call=f"{function.key}(q{rest})")
    if claims.pullback is None:
        partials = partial_derivatives(function, [next(iter(source.parameters))])
        pullback = made("pullback", _DERIVED, {partials.key: partials}, call=f"{partials.key}(q{rest})")
    else:
        function = claims.pullback.function
        call = f"{function.key}(q, g{rest})"
        pullback = made("pullback", _GIVEN, {function.key: function}, call=call)
    call, called = bound_call(claims.stretch, ("q", "reach"), readings)
    stretch = made("stretch", _STRETCH, called, call=call)
    return SpaceWarp(kind, forward, pullback, stretch, claims.box, digest=digest)


_FORWARD = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """The user's warp."""
{texels}    return {call}
'''

_GIVEN = '''\
def {name}(q: wp.vec3, g: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """The user's transposed Jacobian times g."""
{texels}    return {call}
'''

_DERIVED = '''\
def {name}(q: wp.vec3, g: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec3:
    """The transposed Jacobian times g, from the derivatives along the axes."""
{texels}    moved, along_x, along_y, along_z = {call}
    return wp.vec3(wp.dot(along_x, g), wp.dot(along_y, g), wp.dot(along_z, g))
'''

_STRETCH = '''\
def {name}(q: wp.vec3, reach: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.float32:
    """The claimed bound on the norm of the Jacobian."""
{texels}    return {call}
'''
