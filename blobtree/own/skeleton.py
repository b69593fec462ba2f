"""Own skeletons: a primitive from one typed function that says which point of the skeleton is closest.

    @wp.func
    def ring(q: wp.vec3, center: wp.vec3, axis: wp.vec3, size: wp.float32) -> wp.vec3:
        ...
        return closest_point

    Ring = define_skeleton(ring, limits={"size": (0.0, None)})
    model = Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2) + Point((1, 0, 0), radius=0.5)

All that the engine needs follows from the function. The distance to a closest point changes by at most 1 per
unit, so balls bound the field over a cell and along a ray; closest points seen from far away bound the
skeleton itself (`extent`). Which parameters are places and which are lengths is not said, so maps and offsets
do not go into them: a primitive under a map carries that map on the tape, and offsets change its radius.
"""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field, replace
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np
import warp as wp
from numpy.typing import NDArray

from blobtree.errors import InvalidNode
from blobtree.formulas.skeletons import HALF_DIAGONAL, Skeleton, slimmest_of_one, squared_distances_to_ball
from blobtree.nodes.primitives import DEFAULT_COLOR, Primitive
from blobtree.own.extent import skeleton_boxes
from blobtree.own.parameters import Limits, Parameter, parameters_of
from blobtree.own.registry import OwnKind, register, registered
from blobtree.own.source import OwnSource, generated, kind_name, node_class, own_source
from blobtree.own.trials import try_skeleton
from blobtree.validation import Vector, color_triple, positive_number, settle

Floats = NDArray[np.float64]

INFLUENCE = 3
"""Where on the tape, in floats, the influence stands among the parameters: where points have it."""


class OwnPrimitive(Primitive, metaclass=OwnKind):
    """A primitive around a user's skeleton: what `define_skeleton` makes is a subclass of this."""

    kind: ClassVar[str]
    digest: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    if TYPE_CHECKING:

        def __init__(self, *parameters: Any, radius: float, color: Vector = ..., **named: Any) -> None: ...

    def __post_init__(self) -> None:
        checked = {p.name: p.checked(getattr(self, p.name)) for p in self.parameters}
        radius, color = positive_number("radius", self.radius), color_triple(self.color)
        settle(self, **checked, radius=radius, color=color)

    @property
    def values(self) -> dict[str, Any]:
        """The skeleton's parameters by name."""
        return {parameter.name: getattr(self, parameter.name) for parameter in self.parameters}

    @property
    def control_points(self) -> tuple[Vector, ...]:
        """Corners of a box that holds the skeleton."""
        corners: list[Vector] = [tuple(corner) for corner in self.hulls([self])[0].tolist()]
        return tuple(corners)

    @classmethod
    def hulls(cls, primitives: Sequence[Primitive]) -> Floats:
        """Corners (n, 8, 3) of boxes that hold the skeletons."""
        numbers = _numbers(primitives)
        sizes = np.abs(numbers).max(axis=1, initial=0.0)
        lower, upper = skeleton_boxes(cls.skeleton, _packed(numbers, np.ones(len(numbers))), sizes)
        unbounded = ~np.isfinite(lower).all(axis=1) | ~np.isfinite(upper).all(axis=1)
        if unbounded.any():
            raise InvalidNode(
                f"{primitives[int(np.argmax(unbounded))]!r}: its skeleton reaches farther than can be seen, "
                "or has no finite closest point; a skeleton must be bounded"
            )
        boxes = np.stack([lower, upper])
        corners = [boxes[list(sides), :, range(3)].T for sides in product((0, 1), repeat=3)]
        return np.stack(corners, axis=1)

    @classmethod
    def packed(cls, primitives: Sequence[Primitive], influences: Floats, matrices: Floats | None) -> Floats:
        """Parameters (n, ·, 4) on the tape; maps are carried beside them, never folded in."""
        assert matrices is None or np.array_equal(matrices, np.broadcast_to(np.eye(4), matrices.shape))
        return _packed(_numbers(primitives), influences[:, 0])


def define_skeleton(
    function: Any,
    *,
    convex: bool = False,
    name: str | None = None,
    limits: Mapping[str, Limits] | None = None,
) -> type[OwnPrimitive]:
    """Make a kind of primitive from `function`, which gives the point of the skeleton closest to `q`.

    Parameters
    ----------
    function
        ``(q: wp.vec3, parameters...) -> wp.vec3``, parameters being wp.float32, wp.int32, wp.vec2, wp.vec3 or
        wp.vec4; with or without ``@wp.func``. Of the constructs of Python it may use those that Warp and GLSL
        share (see `blobtree.typed.glsl`).
    convex
        Straight lines between points of the skeleton stay in it; rays then take longer steps.
    name
        What files call the kind; by default the function's name. The class is called the same in CamelCase.
    limits
        By parameter (smallest or None, largest or None): of a number, or of the length of a vector.

    Returns
    -------
    type[OwnPrimitive]
        A node class: the function's parameters in order, then the keywords `radius` and `color`.

    Raises
    ------
    InvalidDefinition
        The function has no types or no source, or trials within the limits found that what it returns is not
        the closest point of any skeleton. Nothing has been compiled by then.
    UntranslatableFunction
        It leaves the shared subset; the message names file and line.
    """
    source = own_source(function, returns=wp.vec3)
    first, *own = list(source.parameters) or [""]
    if source.parameters.get(first) is not wp.vec3:
        raise source.refusal("its first parameter is the place asked about; expected `q: wp.vec3`")
    parameters = parameters_of(source, own, limits, OwnPrimitive)
    kind = kind_name(source, name)
    digest = source.digest_with(kind, parameters, convex)
    known = registered(kind)
    if known is not None and issubclass(known, OwnPrimitive) and known.digest == digest:
        return known
    try_skeleton(source, parameters, convex=convex)
    node = _node_class(kind, digest, source, parameters, convex)
    register(node)
    return node


def _node_class(
    kind: str, digest: str, source: OwnSource, parameters: tuple[Parameter, ...], convex: bool
) -> type[OwnPrimitive]:
    fields: list[Any] = [(parameter.name, Any) for parameter in parameters]
    fields += [("_", KW_ONLY), ("radius", float), ("color", Vector, field(default=DEFAULT_COLOR))]
    namespace = {
        "__doc__": source.python.__doc__ or f"A primitive around the skeleton {kind!r}.",
        "kind": kind,
        "digest": digest,
        "parameters": parameters,
        "skeleton": replace(_row(kind, digest, source, parameters), convex=convex),
    }
    made: type[OwnPrimitive] = node_class(kind, source, fields, OwnPrimitive, namespace)
    return made


def _row(kind: str, digest: str, source: OwnSource, parameters: tuple[Parameter, ...]) -> Skeleton:
    """The row of the table, its functions generated around the user's."""
    texels = max(1, -(-(1 + sum(parameter.size for parameter in parameters)) // 4))
    closest_name = f"own_{kind}_closest_{digest}"
    closest = generated(
        closest_name,
        _CLOSEST.format(
            name=closest_name,
            texels="".join(f"    t{i} = tape[at + {i}]\n" for i in range(texels)),
            call=f"{source.function.key}({', '.join(['q', *_readings(parameters)])})",
            influence=INFLUENCE,
        ),
        {source.function.key: source.function},
    )
    box_name = f"own_{kind}_box_{digest}"
    box = generated(
        box_name,
        _BOX.format(name=box_name, closest=closest_name),
        {
            closest_name: closest,
            "HALF_DIAGONAL": HALF_DIAGONAL,
            "slimmest_of_one": slimmest_of_one,
            "squared_distances_to_ball": squared_distances_to_ball,
        },
    )
    return Skeleton(
        kind, closest, cast(wp.Function, slimmest_of_one), box, texels, takes_maps=False, digest=digest
    )


_CLOSEST = '''\
def {name}(q: wp.vec3, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec4:
    """The user's closest point, and the influence."""
{texels}    c = {call}
    return wp.vec4(c[0], c[1], c[2], t0[{influence}])
'''

_BOX = '''\
def {name}(center: wp.vec3, half: wp.float32, tape: wp.array(dtype=wp.vec4), at: wp.int32) -> wp.vec2:
    """Bounds on (|x − skeleton| / influence)² over the ball around the cube center ± half."""
    c = {closest}(center, tape, at)
    return squared_distances_to_ball(center, half * HALF_DIAGONAL, c, slimmest_of_one(tape, at))
'''


def _readings(parameters: tuple[Parameter, ...]) -> list[str]:
    """How each parameter is read from the texels t0, t1 and so on."""
    readings, place = [], 0
    for parameter in parameters:
        components = []
        for _ in range(parameter.size):
            place += place == INFLUENCE
            components.append(f"t{place // 4}[{place % 4}]")
            place += 1
        if parameter.size > 1:
            readings.append(f"wp.vec{parameter.size}({', '.join(components)})")
        else:
            readings.append(f"int({components[0]})" if parameter.whole else components[0])
    return readings


def _numbers(primitives: Sequence[Primitive]) -> Floats:
    """All parameters (n, ·) as they stand on the tape, the influence left out."""
    rows = []
    for node in primitives:
        assert isinstance(node, OwnPrimitive)
        rows.append([x for p in node.parameters for x in p.components(getattr(node, p.name))])
    return np.array(rows, np.float64).reshape(len(primitives), -1)


def _packed(numbers: Floats, influences: Floats) -> Floats:
    """Parameters and influences (n,) as texels (n, ·, 4)."""
    head, tail = numbers[:, :INFLUENCE], numbers[:, INFLUENCE:]
    head = np.pad(head, ((0, 0), (0, INFLUENCE - head.shape[1])))
    tail = np.pad(tail, ((0, 0), (0, -tail.shape[1] % 4)))
    return np.concatenate([head, influences[:, None], tail], axis=1).reshape(len(numbers), -1, 4)
