"""Primitives around flat skeletons: rectangles and triangles, with rounded edges."""

from dataclasses import KW_ONLY, dataclass
from itertools import product
from typing import Annotated

import numpy as np

from blobtree._typing import Float64Array
from blobtree.errors import InvalidNode
from blobtree.formulas.flat_skeletons import RECTANGLE, TRIANGLE
from blobtree.nodes.parameters import Color, Parameter, Quantity, unit_vectors
from blobtree.nodes.primitives import DEFAULT_COLOR, Columns, Primitive, beside
from blobtree.validation import Vector

SMALLEST_SINE = 1e-6
"""Sine of an angle below which two directions count as parallel."""


@dataclass(frozen=True, eq=False, repr=False)
class Rectangle(Primitive):
    """A flat rectangle with a rounded edge: everything within `radius` of the rectangle.

    Raises
    ------
    InvalidNode
        `side` is parallel to `axis`.

    Examples
    --------
    >>> from blobtree import Rectangle
    >>> plate = Rectangle((0, 0, 0), (0, 0, 1), (1, 0, 0), 2.0, 1.0, radius=0.1)
    >>> plate([[0.9, 0.4, 0.1], [1.1, 0, 0], [0, 0.6, 0]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    file_tag = "rectangle"
    skeleton = RECTANGLE

    center: Annotated[Vector, Parameter(Quantity.POINT, "centre of the rectangle")]
    axis: Annotated[Vector, Parameter(Quantity.DIRECTION, "normal of the rectangle's plane, of any length")]
    side: Annotated[
        Vector, Parameter(Quantity.DIRECTION, "direction of the width; its part along the axis is left out")
    ]
    width: Annotated[float, Parameter(Quantity.LENGTH, "length along `side`, without the radius")]
    height: Annotated[float, Parameter(Quantity.LENGTH, "length across `side`, without the radius")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius of the edge, half the thickness")]
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        across = np.cross(*unit_vectors(np.array([self.axis, self.side])))
        if np.linalg.norm(across) < SMALLEST_SINE:
            raise InvalidNode(
                f"side: expected a direction in the plane across the axis, got {self.side}, which is "
                f"parallel to the axis {self.axis}; give another direction"
            )

    @classmethod
    def hull(cls, columns: Columns) -> Float64Array:
        """Return the corners of the rectangle."""
        u, v = _sides(columns)
        signs = np.array(list(product((-0.5, 0.5), repeat=2)))
        across, along = (columns["width"] * u)[:, None], (columns["height"] * v)[:, None]
        corners: Float64Array = columns["center"][:, None] + signs[:, :1] * across + signs[:, 1:] * along
        return corners

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return centre and influence radius; unit vectors along the sides with half their lengths."""
        u, v = _sides(columns)
        sides = [beside(u, 0.5 * columns["width"]), beside(v, 0.5 * columns["height"])]
        return np.stack([beside(columns["center"], influences[:, 0]), *sides], axis=1)


def _sides(columns: Columns) -> tuple[Float64Array, Float64Array]:
    """Return unit vectors (n, 3) along both sides of rectangles."""
    normals = unit_vectors(columns["axis"])
    v = unit_vectors(np.cross(normals, unit_vectors(columns["side"])))
    return np.cross(v, normals), v


@dataclass(frozen=True, eq=False, repr=False)
class Triangle(Primitive):
    """A flat triangle with a rounded edge: everything within `radius` of the triangle.

    Raises
    ------
    InvalidNode
        The corners lie on a line: then use a `Segment`.

    Examples
    --------
    >>> from blobtree import Triangle
    >>> fin = Triangle((0, 0, 0), (1, 0, 0), (0, 1, 0), radius=0.1)
    >>> fin([[0.2, 0.2, 0.1], [0.5, -0.1, 0], [1.1, 0, 0]]).round(3).tolist()
    [0.5, 0.5, 0.5]
    """

    file_tag = "triangle"
    skeleton = TRIANGLE

    a: Annotated[Vector, Parameter(Quantity.POINT, "first corner")]
    b: Annotated[Vector, Parameter(Quantity.POINT, "second corner")]
    c: Annotated[Vector, Parameter(Quantity.POINT, "third corner")]
    _: KW_ONLY
    radius: Annotated[float, Parameter(Quantity.RADIUS, "visible radius of the edge, half the thickness")]
    color: Color = DEFAULT_COLOR

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = np.array([self.a, self.b, self.c])
        edges = corners - np.roll(corners, 1, axis=0)
        longest = np.abs(edges).max()
        if not longest or np.linalg.norm(np.cross(*(edges[:2] / longest))) < SMALLEST_SINE:
            raise InvalidNode(
                f"triangle: expected three corners that span a plane, got {self.a}, {self.b}, {self.c}, "
                "which lie on a line or are equal; use a Segment"
            )

    @classmethod
    def texels(cls, columns: Columns, influences: Float64Array) -> Float64Array:
        """Return the first corner and the influence radius; the edges from it; the unit normal."""
        a, b, c = columns["a"], columns["b"], columns["c"]
        normals = unit_vectors(np.cross(unit_vectors(b - a), unit_vectors(c - a)))
        zeros = np.zeros(len(a))
        rows = [beside(vectors, zeros) for vectors in (b - a, c - a, normals)]
        return np.stack([beside(a, influences[:, 0]), *rows], axis=1)
