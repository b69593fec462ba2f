"""Nodes of a BlobTree: immutable values that combine with Python's operators (Wyvill, Guy & Galin 1999).

    body = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0, 0), radius=0.4)
    model = (body | Point((2, 1, 0), radius=0.5)) - Point((0, 0, 1), radius=0.5)

`radius` is the visible radius of an isolated primitive; its influence radius is radius / RIM.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import MISSING, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, cast, get_type_hints

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array
from blobtree.cells.prune_kernels import measure_range
from blobtree.declare.registry import NODE_KINDS, kind_of
from blobtree.derivatives.curvature import Curvatures, curvatures_of, hessians_at
from blobtree.errors import InvalidNode, InvalidPoints
from blobtree.formulas.operators import DIFFERENCE, INTERSECTION, RICCI, SUM, UNION, Operator
from blobtree.formulas.warps import TWIST, SpaceWarp
from blobtree.graphics import opens_window
from blobtree.kernels import loaded
from blobtree.lazy import Lazy
from blobtree.meshing.creases import split_creases
from blobtree.meshing.polygonize import MAX_TRIANGLES, polygonize
from blobtree.nodes.numeric_parameters import NumericParameter
from blobtree.nodes.parameter_gradient import ParameterGradient, parameter_gradient_of
from blobtree.nodes.parameters import Parameter, Quantity, documented, parameters_of
from blobtree.nodes.values import (
    children_of,
    content_hash_of,
    equal,
    fields_of,
    from_records,
    hash_of,
    outline,
    text_of,
    to_records,
)
from blobtree.progress import Cancel, Progress
from blobtree.pyvista_views import LEVELS, SLICE_RESOLUTION, slice_tree, to_polydata
from blobtree.tape.attributes import attribute_at, attribute_names, rest_coordinates_at, rest_tape
from blobtree.tape.model import ImplicitModel, one_or_rows
from blobtree.tape.poses import has_warps, invert_map, maps_to_rest
from blobtree.tape.program import Placement
from blobtree.tape.tape import Tape
from blobtree.tracing.trace import Hits, raycast
from blobtree.validation import (
    Matrix,
    affine_matrix,
    finite_number,
    finite_vector,
    point_array,
    points_or_point,
    shown,
    texts,
    truth,
)

if TYPE_CHECKING:
    import pyvista as pv

LARGEST_EXPONENT = 100.0
"""Beyond it a Ricci blend differs from a union by less than float32 can tell at the surface."""

REST_RESOLUTION = 48
"""Cells along the longest side of the mesh of a tree at rest, from which its warps are inverted."""

COORDINATE_MARGIN = 2.0**-21
"""Margin around a box of `Node.interval`, over its largest coordinate, for the rounding of its centre."""


class Node(ImplicitModel):
    """Part of a BlobTree: a field that is 0 far away and larger than ISO inside.

    A node is a value: it never changes, and equal trees compare equal. `==`, `hash`, `repr`, pickling and
    copying work for trees of any depth. ``a + b`` blends, ``a | b`` is the union, ``a & b`` the intersection
    and ``a - b`` the difference of two nodes.

    A class of nodes is a dataclass with `eq=False, repr=False` whose fields declare a `Parameter` or hold
    operands.

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
        return _folded(Sum, self, other)

    def __radd__(self, other: int) -> "Node":
        return self if isinstance(other, int) and other == 0 else NotImplemented  # the start of `sum`

    def __or__(self, other: "Node") -> "Node":
        return _folded(Union, self, other)

    def __and__(self, other: "Node") -> "Node":
        return _folded(Intersection, self, other)

    def __sub__(self, other: "Node") -> "Node":
        return Difference(self, other) if isinstance(other, Node) else NotImplemented

    # -- maps ---------------------------------------------------------------------------------------

    def transform(self, matrix: ArrayLike) -> "Transform":
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
        return Transform(self, affine_matrix(matrix))

    def translate(self, offset: ArrayLike) -> "Transform":
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

    def rotate(self, axis: ArrayLike, degrees: float) -> "Transform":
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
        length = np.linalg.norm(direction)
        if length == 0.0:
            raise InvalidNode("axis: expected a direction, got the zero vector")
        x, y, z = direction / length
        angle = math.radians(finite_number("degrees", degrees))
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        linear = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
        return self.transform(np.column_stack([linear, np.zeros(3)]))

    def scale(self, factor: float | ArrayLike) -> "Transform":
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
            return Twist(self, degrees)
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

    def offset(self, distance: float) -> "Offset":
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
        return Offset(self, distance)

    # -- queries ------------------------------------------------------------------------------------

    @Lazy
    def bounds(self) -> tuple[Float32Array, Float32Array]:
        """Lower and upper corner of the surface, float32[3] each; `support` is the larger box of the field.

        The box of the vertices of ``polygonize(self)``, which lie on the surface. It may be too small by a
        cell at most, a 64th of the longest side of the support. A tree without a surface raises
        `InvalidNode`.

        Examples
        --------
        >>> from blobtree import Point
        >>> lower, upper = Point((0, 0, 0), radius=1.0).bounds
        >>> upper.round(2).tolist()
        [1.0, 1.0, 1.0]
        """
        vertices = polygonize(self).vertices
        if not len(vertices):
            raise InvalidNode(
                "bounds: expected a tree with a surface, got none in 64 cells; `support` is its field's box"
            )
        return vertices.min(axis=0), vertices.max(axis=0)

    def hessian(self, points: ArrayLike) -> Float32Array:
        """Return the exact second derivatives of the field at points.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.

        Returns
        -------
        numpy.ndarray
            float32[n, 3, 3], or float32[3, 3] at one point, per squared model unit: symmetric matrices. Where
            the gradient has a kink it is the matrix of one side.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0).hessian([0, 0, 0]).diagonal().astype(float).round(3).tolist()
        [-1.238, -1.238, -1.238]
        """
        return one_or_rows(points, lambda rows: hessians_at(self.tape, rows)[1])

    def curvatures(self, points: ArrayLike) -> Curvatures:
        """Return mean, Gauss and principal curvatures at points of the surface.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, in model units. Elsewhere than on the surface the curvatures are those of the
            level set through the point.

        Returns
        -------
        Curvatures
            Curvatures per model unit, positive where the model is convex, and the principal directions. All
            of it is NaN where the gradient is 0.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=2.0).curvatures([[2, 0, 0]]).mean.round(3).tolist()
        [0.5]
        """
        array, _ = points_or_point(points)
        f, hessians = hessians_at(self.tape, array)
        return curvatures_of(f[:, 1:].astype(np.float64), hessians.astype(np.float64))

    def parameter_gradient(
        self, points: ArrayLike, parameters: Iterable[NumericParameter] | None = None
    ) -> ParameterGradient:
        """Return the derivatives of the field at points by the parameters of the nodes.

        Parameters
        ----------
        points : array-like (n, 3)
            Points in the world, in model units.
        parameters : iterable of NumericParameter, optional
            Parameters of this tree, see `numeric_parameters`; all by default. Each component of a vector is
            one; colours and whole numbers are none.

        Returns
        -------
        ParameterGradient
            float32[n, p] `values` and the p `parameters`.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> gradient = Point((0, 0, 0), radius=1.0).parameter_gradient([[1, 0, 0]])
        >>> [str(parameter) for parameter in gradient.parameters]
        ['root: center[0]', 'root: center[1]', 'root: center[2]', 'root: radius']
        >>> gradient.values.astype(float).round(3).tolist()
        [[0.78, 0.0, 0.0, 0.78]]
        """
        return parameter_gradient_of(self, point_array(points), parameters)

    @property
    def attribute_names(self) -> list[str]:
        """Names of the attributes of all leaves, sorted."""
        return attribute_names(self._program)

    def attribute(
        self, name: str, points: ArrayLike, *, default: float | ArrayLike | str | None = None
    ) -> NDArray[Any]:
        """Return an attribute of the leaves at points, blended with the weights of their colours.

        Numbers and vectors are averaged. Of labels, the one with the largest weight is chosen.

        Parameters
        ----------
        name : str
            Name of the attribute.
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.
        default : float, array-like or str, optional
            Value of leaves without the attribute, and outside every influence; 0 or "" if it is left out.

        Returns
        -------
        numpy.ndarray
            float32[n], float32[n, k] for vectors of k numbers, or str[n]; without n at one point.

        Raises
        ------
        InvalidNode
            No leaf has the attribute, its values differ in type, or the default has another type.
        InvalidPoints
            The points are not n rows of three finite numbers.

        Examples
        --------
        >>> from blobtree import Point
        >>> old = Point((0, 0, 0), radius=1.0, attributes={"age": 10, "bone": "arm"})
        >>> pair = old + Point((1, 0, 0), radius=1.0, attributes={"age": 20, "bone": "hand"})
        >>> pair.attribute("age", [[0.5, 0, 0], [-1, 0, 0]]).astype(float).round(1).tolist()
        [15.0, 10.1]
        >>> pair.attribute("bone", [[0.2, 0, 0], [0.9, 0, 0]]).tolist()
        ['arm', 'hand']
        """
        if not isinstance(name, str):
            raise InvalidNode(f"name: expected the name of an attribute, got {shown(name)}")
        return one_or_rows(points, lambda rows: attribute_at(self.tape, self._program, name, rows, default))

    @Lazy
    def _rest_tape(self) -> Tape:
        return rest_tape(self.tape, self._program)

    def rest_coordinates(self, points: ArrayLike, *, rest: "Node | None" = None) -> Float32Array:
        """Return where points lie in the leaves' own spaces, behind all maps and warps above them.

        Where leaves blend, their rest coordinates are averaged with the weights of their colours. Textures
        and noise in rest coordinates move and bend with the model.

        Parameters
        ----------
        points : array-like (n, 3) or (3,)
            Points in the world, or one point, in model units.
        rest : Node, optional
            The same tree in another pose: where the points lie in its world instead. It has the same leaves,
            from left to right. A skeleton that moved takes its surroundings along. Warps of this tree are
            inverted near its surface, by Newton's method.

        Returns
        -------
        numpy.ndarray
            float32[n, 3], or float32[3] at one point; NaN where the field is 0.

        Raises
        ------
        InvalidPoints
            The points are not n rows of three finite numbers.
        InvalidNode
            `rest` has other leaves.

        Examples
        --------
        >>> from blobtree import Point, Segment
        >>> arm = Segment((0, 0, 0), (0, 0, 2), radius=0.5)
        >>> raised = Segment((0, 0, 0), (2, 0, 0), radius=0.5)
        >>> raised.rest_coordinates([1, 0.5, 0], rest=arm).round(3).tolist()
        [0.0, 0.5, 1.0]
        >>> Point((1, 0, 0), radius=1.0).rotate((0, 0, 1), 90).rest_coordinates([0, 1, 0]).round(3).tolist()
        [1.0, 0.0, 0.0]
        """
        array, single = points_or_point(points)
        tape = self._rest_tape
        if rest is not None:
            if not isinstance(rest, Node):
                raise InvalidNode(f"rest: expected a BlobTree, got {shown(rest)}; leave it out")
            tape = rest_tape(self.tape, self._program, maps_to_rest(self, self._program, rest))
        rows = rest_coordinates_at(tape, array)
        if rest is not None and has_warps(rest):
            unwarped = rest_tape(rest.tape, rest._program, maps_to_rest(rest, rest._program, rest))
            starts = polygonize(rest, resolution=REST_RESOLUTION).vertices
            rows = invert_map(partial(rest_coordinates_at, unwarped), rows, starts)
        return rows[0] if single else rows

    def interval(self, lower: ArrayLike, upper: ArrayLike) -> tuple[float, float]:
        """Return bounds on the field over a box, by interval arithmetic.

        They hold for the cube around the box too, so a box of equal sides gives the tightest ones.

        Parameters
        ----------
        lower, upper : array-like (3,)
            Corners of the box, in model units.

        Returns
        -------
        tuple[float, float]
            A lower and an upper bound of the values; the values need not reach them.

        Raises
        ------
        InvalidPoints
            The corners are not finite, or `lower` exceeds `upper`.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0).interval((5, 5, 5), (6, 6, 6))
        (0.0, 0.0)
        """
        corners = point_array(cast(Any, [lower, upper])).astype(np.float64)
        if (corners[0] > corners[1]).any():
            raise InvalidPoints(f"box: expected lower ≤ upper, got {lower!r} and {upper!r}")
        center, half = corners.mean(axis=0), float((corners[1] - corners[0]).max()) / 2.0
        pad = float(np.abs(corners).max()) * COORDINATE_MARGIN
        uploaded = self.tape.on("cpu")
        out = wp.empty(1, dtype=wp.vec4, device="cpu")
        inputs = [wp.vec3(*center), half + pad, uploaded.data, uploaded.span]
        kernel = self.tape.instruction_set.kernel_for(measure_range)
        wp.launch(loaded(kernel, "cpu"), dim=1, inputs=inputs, outputs=[out], device="cpu")
        smallest, largest, _, _ = out.numpy()[0].tolist()
        return smallest, largest

    def raycast(self, origins: ArrayLike, directions: ArrayLike, *, device: str | None = None) -> Hits:
        """Return the first intersections of rays with the surface.

        Parameters
        ----------
        origins : array-like (n, 3) or (3,)
            Starts of the rays, or of one ray. A ray that starts inside hits at once.
        directions : array-like (n, 3) or (3,)
            Directions of any length above 0.
        device : str, optional
            Warp device that does the work; the current one by default.

        Returns
        -------
        Hits
            Distances, positions, normals and colours.

        Raises
        ------
        InvalidPoints
            Origins and directions differ in number, or a direction has no length.
        InvalidDevice
            Warp has no such device.

        Examples
        --------
        >>> from blobtree import Point
        >>> hits = Point((0, 0, 0), radius=1.0).raycast([[5, 0, 0]], [[-1, 0, 0]])
        >>> hits.distances.round(3).tolist()
        [4.0]
        """
        return raycast(self, origins, directions, device=device)

    # -- pyvista ------------------------------------------------------------------------------------

    def to_pyvista(
        self,
        *,
        resolution: int | None = None,
        cell_size: float | None = None,
        chord_error: float | None = None,
        max_triangles: int = MAX_TRIANGLES,
        adaptive: bool = True,
        creases: bool = False,
        split_normals: bool = False,
        attributes: Iterable[str] = (),
        rest_coordinates: bool = False,
        device: str | None = None,
        progress: Progress | None = None,
        cancel: Cancel | None = None,
    ) -> "pv.PolyData":
        """Return the surface as a pyvista mesh with normals and, as "RGB", colours.

        Parameters
        ----------
        resolution, cell_size, chord_error, max_triangles, adaptive, creases, device, progress, cancel
            As for `polygonize`.
        split_normals : bool
            Give each side of a crease its own vertices and normals; implies `creases`. Creases then look
            sharp, and the mesh is not closed there.
        attributes : str or iterable of str
            Names of attributes to add as point data, see `attribute`.
        rest_coordinates : bool
            Add point data "rest_coordinates".

        Returns
        -------
        pyvista.PolyData
            Triangles with active normals, point data "RGB" (uint8) and, with `creases`, "sheet_counts".

        Raises
        ------
        MissingPackage
            pyvista is not installed.
        InvalidResolution, InvalidDevice, Cancelled
            As for `polygonize`.

        Examples
        --------
        >>> from blobtree import Point
        >>> mesh = Point((0, 0, 0), radius=1.0).to_pyvista(resolution=8)
        >>> mesh.is_manifold
        True
        """
        names = (attributes,) if isinstance(attributes, str) else texts("attributes", attributes)
        split_normals = truth("split_normals", split_normals, InvalidNode)
        rest_coordinates = truth("rest_coordinates", rest_coordinates, InvalidNode)
        mesh = polygonize(
            self,
            resolution=resolution,
            cell_size=cell_size,
            chord_error=chord_error,
            max_triangles=max_triangles,
            adaptive=adaptive,
            creases=split_normals or creases,
            device=device,
            progress=progress,
            cancel=cancel,
        )
        surface = to_polydata(split_creases(self, mesh) if split_normals else mesh)
        if surface.n_points:
            for name in names:
                surface.point_data[name] = self.attribute(name, surface.points)
            if rest_coordinates:
                surface.point_data["rest_coordinates"] = self.rest_coordinates(surface.points)
        return surface

    def plot(self, *, resolution: int | None = None, **options: Any) -> Any:
        """Show the surface in a window, or in a notebook.

        Parameters
        ----------
        resolution : int, optional
            Cells along the longest side of the support; see `polygonize` for the default.
        options
            Arguments of ``pyvista.PolyData.plot``, such as ``color`` and ``screenshot``.

        Returns
        -------
        object
            Result of ``pyvista.PolyData.plot``.

        Raises
        ------
        InvalidNode
            The tree has no surface at this resolution.
        InvalidResolution
            The resolution is not a usable number of cells.
        MissingPackage
            pyvista is not installed.
        NoGraphics
            There is no screen for the window.

        Examples
        --------
        >>> from blobtree import Point
        >>> Point((0, 0, 0), radius=1.0, color="tomato").plot()  # doctest: +SKIP
        """
        surface = self.to_pyvista(resolution=resolution)
        if not surface.n_points:
            raise InvalidNode("expected a tree with a surface, got none; its parts may be too small")
        opens_window(options)
        colors = {} if "color" in options else {"scalars": "RGB", "rgb": True}
        return surface.plot(**{**colors, **options})

    def slice(
        self,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        normal: ArrayLike = (0.0, 0.0, 1.0),
        *,
        resolution: int = SLICE_RESOLUTION,
        values: Iterable[float] = LEVELS,
    ) -> "pv.MultiBlock":
        """Return the field on a plane, and its lines of equal field value.

        Parameters
        ----------
        origin : array-like (3,)
            A point of the plane.
        normal : array-like (3,)
            Normal of the plane, of any length above 0.
        resolution : int
            Squares along the longer side of the plane's part in the tree's support.
        values : iterable of float
            Field values that get lines; by default 0.1, 0.2, …, 1.

        Returns
        -------
        pyvista.MultiBlock
            "plane", coloured by "field"; "lines", at the values; "surface", the line at 0.5. Points of lines
            lie on their level exactly, save in kinks, where they lie between the neighbouring samples.

        Raises
        ------
        InvalidPoints
            The plane misses the model, or has no direction; or a value is not above 0.
        InvalidResolution
            The resolution is not a usable number of squares.
        MissingPackage
            pyvista is not installed.

        Examples
        --------
        >>> from blobtree import Point
        >>> blocks = Point((0, 0, 0), radius=1.0).slice(resolution=16)
        >>> blocks.keys()
        ['plane', 'lines', 'surface']
        """
        return slice_tree(self, origin, normal, resolution=resolution, values=values)


class Macro(Node):
    """A node that stands for a tree of other nodes.

    Programs hold that tree. Files, `repr`, paths and edits know the node with its parameters and operands.
    """

    @property
    def expanded(self) -> Node:
        """The tree that this node stands for; subclasses compute it once, see `Lazy`."""
        raise NotImplementedError

    @property
    def program_children(self) -> tuple[Node, ...]:
        """The expanded tree alone."""
        return (self.expanded,)


class Combination(Node):
    """An operator folded over its operands from left to right.

    The operator takes the parameters that the class declares, in their order.
    """

    combines = True
    operator: ClassVar[Operator]

    @property
    def operator_parameters(self) -> tuple[float, ...]:
        """The numbers that the operator takes besides its operands."""
        values = ((p, getattr(self, name)) for name, p in parameters_of(type(self)).items())
        return tuple(number for p, value in values for number in p.components(value))


@dataclass(frozen=True, eq=False, repr=False, init=False)
class ManyOperands(Node):
    """A node with any number of `operands`, which come one by one or as one iterable.

    Its parameters follow them, best by name.
    """

    operands: tuple[Node, ...]

    def __init__(self, *arguments: "Node | Iterable[Node] | float", **named: Any) -> None:
        for name, value in _bound(type(self), arguments, named).items():
            object.__setattr__(self, name, value)
        self.__post_init__()


@dataclass(frozen=True, eq=False, repr=False, init=False)
class AssociativeCombination(ManyOperands, Combination):
    """A combination of `operands`: any number of them, or two if their order matters to the operator."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.operator.commutes and len(self.operands) != 2:
            raise InvalidNode(
                f"operands: expected two, got {len(self.operands)}; {type(self).__name__} does not "
                "claim that operands may come in any order, so nest it"
            )


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Sum(AssociativeCombination):
    """Smooth blend F = Σ fᵢ (Blinn 1982; Wyvill et al. 1986).

    Examples
    --------
    >>> from blobtree import Point, Sum
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Sum(parts) == Sum(parts[0], parts[1]) == parts[0] + parts[1]
    True
    """

    file_tag = "sum"
    operator = SUM


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Union(AssociativeCombination):
    """Sharp union F = max fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Point, Union
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Union(tuple(parts)) == parts[0] | parts[1]
    True
    """

    file_tag = "union"
    operator = UNION


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Intersection(AssociativeCombination):
    """Sharp intersection F = min fᵢ (Ricci 1973).

    Examples
    --------
    >>> from blobtree import Intersection, Point
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> Intersection(tuple(parts)) == parts[0] & parts[1]
    True
    """

    file_tag = "intersection"
    operator = INTERSECTION


EXPONENT = Parameter(
    Quantity.FACTOR,
    "exponent n",
    low=1.0,
    high=LARGEST_EXPONENT,
    hint="1 is the sum; for more use a union",
)
"""Exponent of the sum of powers in a blend."""


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Ricci(AssociativeCombination):
    """Blend F = (Σ fᵢⁿ)^(1/n) (Ricci 1973): exponent 1 is the sum, a large one nears the union.

    Examples
    --------
    >>> from blobtree import Point, Ricci
    >>> parts = [Point((x, 0, 0), radius=1.0) for x in (0, 1)]
    >>> blend, total = Ricci(tuple(parts), exponent=3), parts[0] + parts[1]
    >>> bool(blend([[0.5, 0, 0]])[0] < total([[0.5, 0, 0]])[0])
    True
    """

    file_tag = "ricci"
    operator = RICCI

    exponent: Annotated[float, EXPONENT] = field(kw_only=True)


@dataclass(frozen=True, eq=False, repr=False)
class Difference(Combination):
    """`solid` without `tool`: F = min(f, 1 − g) while f ≤ 1 (Wyvill, Guy & Galin 1999).

    `operators.difference_partials` states what happens where fields add up to more than 1.

    Examples
    --------
    >>> from blobtree import Difference, Point
    >>> solid, tool = Point((0, 0, 0), radius=1.0), Point((0, 0, 1), radius=0.5)
    >>> Difference(solid, tool) == solid - tool
    True
    """

    file_tag = "difference"
    operator = DIFFERENCE

    solid: Node
    tool: Node


@dataclass(frozen=True, eq=False, repr=False)
class Placed(Node):
    """A node with one `child`, which it moves, grows or deforms."""

    child: Node


@dataclass(frozen=True, eq=False, repr=False)
class Transform(Placed):
    """`child` under an affine map.

    The map folds into the primitives below it when the tape is made, so it costs nothing afterwards.

    Examples
    --------
    >>> from blobtree import Point, Transform
    >>> moved = Transform(Point((0, 0, 0), radius=1.0), [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]])
    >>> moved == Point((0, 0, 0), radius=1.0).translate((5, 0, 0))
    True
    """

    file_tag = "transform"

    matrix: Annotated[
        Matrix, Parameter(Quantity.MATRIX, "rows of the map from the child's points (columns) to this node's")
    ]

    def child_placement(self, placement: Placement) -> Placement:
        """Return the placement of the child: this map below those above."""
        matrix = np.vstack([self.matrix, (0.0, 0.0, 0.0, 1.0)])
        volume_scale = abs(float(np.linalg.det(matrix[:3, :3])))
        growth = placement.growth / float(np.cbrt(volume_scale)) if placement.growth else 0.0
        return Placement(placement.matrix @ matrix, growth)


@dataclass(frozen=True, eq=False, repr=False)
class Offset(Placed):
    """`child` with every visible radius below it larger by `distance`, or smaller if that is negative.

    For primitives, and for unions and intersections of them, this is the surface at that distance. Where
    fields blend it is the blend of the larger primitives. Tools of differences change the other way.

    Examples
    --------
    >>> from blobtree import Offset, Point
    >>> Offset(Point((0, 0, 0), radius=1.0), 0.5)([[1.5, 0, 0]]).round(3).tolist()
    [0.5]
    """

    file_tag = "offset"

    distance: Annotated[float, Parameter(Quantity.DISTANCE, "growth of the visible radii")]

    def child_placement(self, placement: Placement) -> Placement:
        """Return the placement of the child: its radii grow by the distance too."""
        return replace(placement, growth=placement.growth + self.distance)


@dataclass(frozen=True, eq=False, repr=False)
class Twist(Placed):
    """`child` turned about the z axis by an angle that grows with the height (Barr 1984).

    Examples
    --------
    >>> from blobtree import Point, Twist
    >>> Twist(Point((1, 0, 1), radius=0.5), 90)([[0, 1, 1]]).round(3).tolist()
    [1.0]
    """

    file_tag = "twist"
    warp: ClassVar[SpaceWarp] = TWIST

    degrees: Annotated[
        float, Parameter(Quantity.ANGLE, "degrees per model unit of height, counter-clockwise from above")
    ]

    @property
    def warp_parameters(self) -> tuple[float, ...]:
        """The angle per unit of height in radians."""
        return (math.radians(self.degrees),)


_kind: Callable[[str], Callable[..., Node]] = kind_of
"""`kind_of` for classes whose files import this one."""

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


def _bound(kind: type[Node], arguments: tuple[Any, ...], named: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a combination's fields; nodes in front of all other arguments are its operands."""
    names = [item.name for item in fields_of(kind)]
    values = {item.name: item.default for item in fields_of(kind) if item.default is not MISSING}
    count = next((i for i, item in enumerate(arguments) if not isinstance(item, Node)), len(arguments))
    positional = (arguments[:count], *arguments[count:]) if count else arguments
    given = dict(zip(names, positional, strict=False)) | named
    missing = [name for name in names if name not in values | given]
    unknown = [name for name in named if name not in names]
    if missing or unknown or len(positional) > len(names) or len(given) < len(positional) + len(named):
        expected = ", ".join(f"{name}=…" for name in names[1:]) or "nothing else"
        problem = f"got {len(positional)} arguments by position and {', '.join(named) or 'none'} by name"
        if missing:
            problem = f"{', '.join(missing)} missing"
        elif unknown:
            problem = f"{', '.join(unknown)} unknown"
        raise TypeError(f"{kind.__name__}: expected operands and {expected}; {problem}")
    return values | given


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


def _folded(kind: type[Sum] | type[Union] | type[Intersection], first: Node, second: Node) -> Node:
    """Return both nodes under an operator of `kind`; a + b + c is one sum of three."""
    if not isinstance(second, Node):
        return NotImplemented
    operands = [item.operands if isinstance(item, kind) else (item,) for item in (first, second)]
    return kind((*operands[0], *operands[1]))
