"""What else can be asked of a tree: derivatives, attributes, rest coordinates and views.

`Questions` joins the answers of other files to one class, of which `blobtree.nodes.node.Node` is the value.
"""

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array
from blobtree.derivatives.curvature import Curvatures, curvatures_of, hessians_at
from blobtree.errors import InvalidNode
from blobtree.graphics import opens_window
from blobtree.lazy import Lazy
from blobtree.meshing.creases import split_creases
from blobtree.meshing.polygonize import MAX_TRIANGLES, polygonize
from blobtree.nodes.model import Model
from blobtree.nodes.numeric_parameters import NumericParameter
from blobtree.nodes.parameter_gradient import ParameterGradient, parameter_gradient_of
from blobtree.progress import Cancel, Progress
from blobtree.pyvista_views import to_polydata
from blobtree.slicing import LEVELS, SLICE_RESOLUTION, slice_tree
from blobtree.tape.attributes import attribute_at, attribute_names, rest_coordinates_at, rest_tape
from blobtree.tape.model import one_or_rows
from blobtree.tape.poses import has_warps, invert_map, maps_to_rest
from blobtree.tape.tape import Tape
from blobtree.validation import describe, point_array, points_or_point, texts, truth

if TYPE_CHECKING:
    import pyvista as pv

REST_RESOLUTION = 48
"""Cells along the longest side of the mesh of a tree at rest, from which its warps are inverted."""


class Questions(Model):
    """A field, and everything that can be asked of it; `blobtree.Node` is the class to use."""

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
            raise InvalidNode(f"name: expected the name of an attribute, got {describe(name)}")
        return one_or_rows(points, lambda rows: attribute_at(self.tape, self._program, name, rows, default))

    @Lazy
    def _rest_tape(self) -> Tape:
        return rest_tape(self.tape, self._program)

    def rest_coordinates(self, points: ArrayLike, *, rest: "Questions | None" = None) -> Float32Array:
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
            if not isinstance(rest, Questions):
                raise InvalidNode(f"rest: expected a BlobTree, got {describe(rest)}; leave it out")
            tape = rest_tape(self.tape, self._program, maps_to_rest(self, self._program, rest))
        rows = rest_coordinates_at(tape, array)
        if rest is not None and has_warps(rest):
            unwarped = rest_tape(rest.tape, rest._program, maps_to_rest(rest, rest._program, rest))
            starts = polygonize(rest, resolution=REST_RESOLUTION).vertices
            rows = invert_map(partial(rest_coordinates_at, unwarped), rows, starts)
        return rows[0] if single else rows

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
            Cells along the longest side of the support, see `polygonize`, also for the default.
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
