"""Nodes: trees as immutable values, which combine with Python's operators (Wyvill, Guy & Galin 1999).

    body = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.4)
    model = (body | Point((2, 1, 0), radius=0.5)) - Point((0, 0, 1), radius=0.5)

A node finds the classes of other nodes by their tags, because their files import this one. What can be asked
of a tree lies in `blobtree.nodes.model` and `blobtree.nodes.questions`.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import MISSING
from typing import Any, ClassVar, Self, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from blobtree.declare.parameters import annotate, documented, fields_of, parameters_of
from blobtree.declare.registry import NODE_KINDS, kind_of
from blobtree.errors import InvalidNode
from blobtree.nodes.extras import NodeMethods
from blobtree.nodes.values import (
    children_of,
    content_hash_of,
    equal,
    from_records,
    hash_of,
    outline,
    text_of,
    to_records,
)
from blobtree.validation import affine_matrix, finite_number, finite_vector


class Node(NodeMethods):
    """Part of a BlobTree: a field that is 0 far away and larger than ISO inside.

    A node is a value: it never changes, and equal trees compare equal. `==`, `hash`, `repr`, pickling and
    copying work for trees of any depth. ``a + b`` blends, ``a | b`` is the union, ``a & b`` the intersection
    and ``a - b`` the difference of two nodes.

    A class of nodes is a dataclass with `eq=False, repr=False` whose fields declare a `Parameter`, best by a
    specifier of `blobtree.par`, or hold operands.

    Examples
    --------
    >>> from blobtree import Point, Segment
    >>> model = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.4)
    >>> model([[0, 0, 0], [9, 0, 0]]).round(2).tolist()
    [2.0, 0.0]
    >>> print(model)
    Sum()
      Point(center=(0.0, 0.0, 0.0), radius=1.0, color=(0.8, 0.8, 0.8))
      Segment(start=(0.0, 0.0, 0.0), end=(2.0, 0.0, 0.0), radius=0.4, color=(0.8, 0.8, 0.8))
    """

    file_tag: ClassVar[str]
    """Name of this kind in files."""
    combines: ClassVar[bool] = False
    """True if the node combines its operands; else it places or deforms one."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        annotate(cls)
        if "file_tag" in vars(cls):
            cls.__doc__ = documented(cls.__doc__ or "", cls)
            NODE_KINDS[cls.file_tag] = cls

    def __post_init__(self) -> None:
        values = vars(self)
        for name, check, default in _checks(type(self)):
            if values[name] is not default:
                object.__setattr__(self, name, check(values[name]))

    @property
    def children(self) -> tuple["Node", ...]:
        """The operands of this node, from left to right; empty for a primitive."""
        return children_of(self)

    # -- values -------------------------------------------------------------------------------------

    def __eq__(self, other: object) -> bool:
        return equal(self, other) if isinstance(other, Node) else NotImplemented

    def __hash__(self) -> int:
        return hash_of(self)

    @property
    def content_hash(self) -> str:
        """Content hash of the tree, see `blobtree.content_hash`."""
        return content_hash_of(self)

    @classmethod
    def content_key(cls) -> tuple[str, ...]:
        """Return what names the class in content hashes: that of files."""
        return (vars(cls).get("file_tag", cls.__qualname__),)

    def __dask_tokenize__(self) -> str:
        return self.content_hash

    def __repr__(self) -> str:
        return text_of(self)

    def __str__(self) -> str:
        return outline(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return from_records, (to_records(self),)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        return self

    # -- combinations -------------------------------------------------------------------------------

    def __add__(self, other: "Node") -> "Node":
        return _folded("sum", self, other)

    def __radd__(self, other: int) -> "Node":
        return self if isinstance(other, int) and other == 0 else NotImplemented  # the start of `sum`

    def __or__(self, other: "Node") -> "Node":
        return _folded("union", self, other)

    def __and__(self, other: "Node") -> "Node":
        return _folded("intersection", self, other)

    def __sub__(self, other: "Node") -> "Node":
        return _kind("difference")(self, other) if isinstance(other, Node) else NotImplemented

    # -- maps ---------------------------------------------------------------------------------------

    def transform(self, matrix: ArrayLike) -> "Node":
        """Return this node under an affine map.

        Parameters
        ----------
        matrix : array-like (3, 4) or (4, 4)
            Map from this node's space to the world; it multiplies points as columns.

        Raises
        ------
        InvalidNode
            The matrix is not finite, affine and invertible.

        Examples
        --------
        >>> from blobtree import Point
        >>> moved = Point((0, 0, 0), radius=1.0).transform([[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]])
        >>> moved([[5, 0, 0]]).tolist()
        [1.0]
        """
        return _kind("transform")(self, affine_matrix(matrix))

    def translate(self, offset: ArrayLike) -> "Node":
        """Return this node moved by a vector.

        Parameters
        ----------
        offset : array-like (3,)
            Displacement, in model units.

        Raises
        ------
        InvalidNode
            The offset is not three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0).translate((5, 0, 0))([[5, 0, 0]]).tolist()
        [1.0]
        """
        return self.transform(np.column_stack([np.eye(3), finite_vector("offset", offset)]))

    def rotate(self, axis: ArrayLike, degrees: float) -> "Node":
        """Return this node turned about an axis through the origin.

        Parameters
        ----------
        axis : array-like (3,)
            Direction of the axis, of any length above 0.
        degrees : float
            Angle, counter-clockwise for a viewer towards whom the axis points.

        Raises
        ------
        InvalidNode
            The axis has no length, or a number is not finite.

        Examples
        --------
        >>> from blobtree import Point
        >>> turned = Point((5, 0, 0), radius=1.0).rotate((0, 0, 1), 90)
        >>> turned([[0, 5, 0]]).round(3).tolist()
        [1.0]
        """
        direction = np.array(finite_vector("axis", axis))
        length = math.hypot(*direction)
        if length == 0.0:
            raise InvalidNode("axis: expected a direction, got the zero vector")
        x, y, z = direction / length
        angle = math.radians(finite_number("degrees", degrees))
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        # Without BLAS, which rounds otherwise on other processors: content hashes would differ.
        squared = (cross[:, :, None] * cross).sum(axis=1)
        linear = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * squared
        return self.transform(np.column_stack([linear, np.zeros(3)]))

    def scale(self, factor: float | ArrayLike) -> "Node":
        """Return this node scaled about the origin.

        Parameters
        ----------
        factor : float or array-like (3,)
            One factor, or one per axis; negative factors mirror.

        Raises
        ------
        InvalidNode
            A factor is 0 or not finite.

        Examples
        --------
        >>> from blobtree import Point
        >>> ellipsoid = Point((0, 0, 0), radius=1.0).scale((2, 1, 1))
        >>> ellipsoid([[2, 0, 0]]).round(3).tolist()
        [0.5]
        """
        factors = finite_vector("factor", factor if isinstance(factor, Iterable) else (factor,) * 3)
        if 0.0 in factors:
            raise InvalidNode(f"factor: expected a scale other than 0, got {factor!r}")
        return self.transform(np.column_stack([np.diag(factors), np.zeros(3)]))

    def twist(self, degrees: float, limits: tuple[float, float] | None = None) -> "Node":
        """Return this node turned about the z axis by an angle that grows with the height.

        Parameters
        ----------
        degrees : float
            Angle per model unit of height, counter-clockwise seen from above.
        limits : tuple[float, float], optional
            Heights between which the angle grows, from 0. By default it grows everywhere, and is 0 at z = 0.

        Raises
        ------
        InvalidNode
            The angle is not a finite number, or the limits are not two ascending heights.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((1, 0, 1), radius=0.5).twist(90)([[0, 1, 1]]).round(3).tolist()
        [1.0]
        """
        if limits is None:
            return _kind("twist")(self, degrees)
        return _kind("limited_twist")(self, degrees, *_limits(limits))

    def taper(self, factor: float, limits: tuple[float, float]) -> "Node":
        """Return this node with cross-sections that grow with the height, see `Taper`.

        Parameters
        ----------
        factor : float
            Scale across z at the upper limit and above; it is 1 at the lower limit and below.
        limits : tuple[float, float]
            Heights between which the scale changes.

        Raises
        ------
        InvalidNode
            The factor is not from 0.001 to 1000, or the limits are not two ascending heights.

        Examples
        --------
        >>> from blobtree import Segment
        >>> Segment((0, 0, 0), (0, 0, 2), radius=0.5).taper(0.5, (0, 2))([[0.25, 0, 2]]).round(3).tolist()
        [0.5]
        """
        return _kind("taper")(self, factor, *_limits(limits))

    def bend(self, degrees: float, limits: tuple[float, float]) -> "Node":
        """Return this node bent about an axis parallel to y, see `Bend`.

        Parameters
        ----------
        degrees : float
            Angle per model unit of height, from z toward x.
        limits : tuple[float, float]
            Heights between which the model bends; below and above it stays rigid.

        Raises
        ------
        InvalidNode
            The angle is 360° or more in all, or the limits are not two ascending heights. `support` of the
            result raises it too, if the field of this node reaches the axis of the bend.

        Examples
        --------
        >>> from blobtree import Segment
        >>> arc = Segment((0, 0, 0), (0, 0, 3), radius=0.2).bend(30, (0, 3))
        >>> arc([[6 / 3.14159265, 0, 6 / 3.14159265]]).round(3).tolist()
        [1.0]
        """
        return _kind("bend")(self, degrees, *_limits(limits))

    def shear(self, slope_x: float, slope_y: float, limits: tuple[float, float]) -> "Node":
        """Return this node with cross-sections that move sideways, see `Shear`.

        Parameters
        ----------
        slope_x, slope_y : float
            Motion along x and y per unit of height.
        limits : tuple[float, float]
            Heights between which the motion grows.

        Raises
        ------
        InvalidNode
            A slope is not a finite number, or the limits are not two ascending heights.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 1), radius=0.5).shear(0.5, 0, (0, 2))([[0.5, 0, 1]]).round(3).tolist()
        [1.0]
        """
        return _kind("shear")(self, slope_x, slope_y, *_limits(limits))

    def stretch(self, factor: float, limits: tuple[float, float]) -> "Node":
        """Return this node with the part between two heights longer by a factor, see `Stretch`.

        Parameters
        ----------
        factor : float
            New length of the part over its old length.
        limits : tuple[float, float]
            Heights of the part, before the stretch. What is above moves with its upper end.

        Raises
        ------
        InvalidNode
            The factor is not from 0.001 to 1000, or the limits are not two ascending heights.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 2), radius=0.5).stretch(3, (0, 1))([[0, 0, 4]]).round(3).tolist()
        [1.0]
        """
        return _kind("stretch")(self, factor, *_limits(limits))

    def noise_warp(self, amplitude: float, wavelength: float, *, seed: int = 0) -> "Node":
        """Return this node displaced by smooth noise, see `NoiseWarp`.

        Parameters
        ----------
        amplitude : float
            Bound on the displacement, in model units; typical displacements are a third of it.
        wavelength : float
            Mean length of the waves, in model units, at least the amplitude.
        seed : int
            Number of the noise.

        Raises
        ------
        InvalidNode
            A length is not above 0, or the amplitude exceeds the wavelength.

        Examples
        --------
        >>> from blobtree import Point
        >>> rough = Point((0, 0, 0), radius=1.0).noise_warp(0.2, 1.0, seed=3)
        >>> bool(rough([[9, 0, 0]])[0] == 0.0)
        True
        """
        return _kind("noise_warp")(self, amplitude, wavelength, seed)

    def curve_warp(self, source: ArrayLike, target: ArrayLike, reach: float) -> "Node":
        """Return this node deformed so that points of a curve move to others, see `CurveWarp`.

        Parameters
        ----------
        source, target : array-like (n, 3)
            Points before and after the deformation, one for one; 256 at most.
        reach : float
            Distance from the target up to which space moves, in model units.

        Raises
        ------
        InvalidNode
            The points differ in number, lie too close together, or their motion folds space.

        Examples
        --------
        >>> from blobtree import Segment
        >>> rod = Segment((-1, 0, 0), (1, 0, 0), radius=0.2)
        >>> arched = rod.curve_warp([(0, 0, 0)], [(0, 0, 0.3)], reach=1.5)
        >>> arched([[0, 0, 0.3]]).round(3).tolist()
        [1.0]
        """
        return _kind("curve_warp")(self, source, target, reach)

    def offset(self, distance: float) -> "Node":
        """Return this node with every visible radius larger by a distance, see `Offset`.

        Parameters
        ----------
        distance : float
            Growth of the radii, in model units; negative values shrink them.

        Raises
        ------
        InvalidNode
            The distance is not a finite number. `tape` and `support` of the result raise it too, if a
            negative distance leaves nothing of a primitive.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0).offset(0.5)([[1.5, 0, 0]]).round(3).tolist()
        [0.5]
        """
        return _kind("offset")(self, distance)


_kind: Callable[[str], Callable[..., Node]] = kind_of
"""The class of nodes with a tag, see `kind_of`."""

_CHECKS: dict[type[Node], list[tuple[str, Callable[[Any], Any], Any]]] = {}


def _checks(kind: type[Node]) -> list[tuple[str, Callable[[Any], Any], Any]]:
    """Return a class's fields: names, functions that return checked values, values that need no check."""
    if kind in _CHECKS:
        return _CHECKS[kind]
    parameters, hints = parameters_of(kind), get_type_hints(kind)
    checks: list[tuple[str, Callable[[Any], Any], Any]] = []
    for item in fields_of(kind):
        if item.name in parameters:
            check = parameters[item.name].check
        else:
            check = _node if hints[item.name] is Node else _nodes
        checks.append((item.name, check, item.default if _passes(item.default, check) else MISSING))
    return _CHECKS.setdefault(kind, checks)


def _passes(default: Any, check: Callable[[Any], Any]) -> bool:
    """Return True if a check returns a default as it is."""
    return default is not MISSING and repr(check(default)) == repr(default)


def _node(operand: Any) -> Node:
    """Return `operand`; raise `InvalidNode` if it is no node."""
    return _nodes((operand,))[0]


def _nodes(operands: Iterable[Node]) -> tuple[Node, ...]:
    """Return `operands` as a tuple of nodes, at least one."""
    try:
        nodes = tuple(operands)
    except TypeError:
        raise InvalidNode(f"operands: expected several BlobTree nodes, got {operands!r}") from None
    if not nodes:
        raise InvalidNode("operands: expected at least one node, got none")
    for node in nodes:
        if not isinstance(node, Node):
            raise InvalidNode(f"operands: expected BlobTree nodes, got {node!r}")
    return nodes


def _limits(limits: tuple[float, float]) -> tuple[float, float]:
    """Return limits as two numbers; raise `InvalidNode` otherwise."""
    try:
        low, high = limits
    except (TypeError, ValueError):
        raise InvalidNode(f"limits: expected two heights (low, high), got {limits!r}") from None
    return finite_number("limits[0]", low), finite_number("limits[1]", high)


def _folded(tag: str, first: Node, second: Node) -> Node:
    """Return both nodes under the operator with a tag; a + b + c is one sum of three."""
    if not isinstance(second, Node):
        return NotImplemented
    kind = kind_of(tag)
    operands = [item.operands if isinstance(item, kind) else (item,) for item in (first, second)]
    combined: Node = kind((*operands[0], *operands[1]))
    return combined
