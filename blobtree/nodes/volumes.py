"""Volumes: solids by sampled distances, from grids, triangle meshes and functions.

The data region holds a texel for each grid point but those of the last column and row: the samples at (i, j),
(i + 1, j), (i, j + 1) and (i + 1, j + 1) of a layer. So two texels hold the corners of a cell. Samples are in
units of the spacing. Outside the grid the distance is that of the nearest point of the grid, or the distance
from the grid's box if that is larger: the solid ends at the box.

From a distance d, below 0 inside, the field is a falloff of u = RIM + d / s. So it is ½ on the surface, 0
from d = (1 − RIM) s outward, and 1 from −RIM s inward. For a ball of radius RIM · s that is the field of a
`Point`.
"""

from collections.abc import Callable
from dataclasses import KW_ONLY, replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from blobtree import par
from blobtree._typing import Box, Float32Array, Float64Array
from blobtree.declare.formula import formula
from blobtree.declare.parameters import Parameter, Quantity
from blobtree.errors import InvalidNode
from blobtree.formulas.falloff import RIM
from blobtree.nodes.fields import FieldPrimitive
from blobtree.nodes.primitives import DEFAULT_COLOR, Falling
from blobtree.nodes.samples import MAX_NUMBERS, Samples
from blobtree.sampling.mesh_distances import grid_points, mesh_distances, triangles_of
from blobtree.sized_cache import sized_cache
from blobtree.texels import Texels
from blobtree.validation import Vector, finite_vector, positive_number

wp.set_module_options({"enable_backward": False})

STEEPEST = 2.0
"""Change per unit of length beyond which numbers count as no distances."""

DEFAULT_RESOLUTION = 64
"""Cells along the longest side of a mesh, where no cell size is given."""

WIDTH_CELLS = 4.0
"""Blend width of a mesh in cells, where none is given."""

MAX_TEXELS_BYTES = 1 << 28
"""Bytes of texels that are kept for the next tapes, at most; they take four times the samples."""


@wp.func
def box_distance(x: wp.vec3, half: wp.vec3) -> wp.vec4:
    """Return (d, ∇d) of a box, seen from its middle (Quilez, Distance functions)."""
    a = wp.abs(x[0]) - half[0]
    b = wp.abs(x[1]) - half[1]
    c = wp.abs(x[2]) - half[2]
    sx = wp.where(x[0] < 0.0, -1.0, 1.0)
    sy = wp.where(x[1] < 0.0, -1.0, 1.0)
    sz = wp.where(x[2] < 0.0, -1.0, 1.0)
    beyond = wp.vec3(wp.max(a, 0.0), wp.max(b, 0.0), wp.max(c, 0.0))
    length = wp.length(beyond)
    if length > 0.0:
        return wp.vec4(length, sx * beyond[0] / length, sy * beyond[1] / length, sz * beyond[2] / length)
    if a >= b and a >= c:
        return wp.vec4(a, sx, 0.0, 0.0)
    if b >= c:
        return wp.vec4(b, 0.0, sy, 0.0)
    return wp.vec4(c, 0.0, 0.0, sz)


@wp.func
def sampled_distance(u: wp.vec3, counts: wp.vec4, tape: Texels, data: wp.int32) -> wp.vec4:
    """Return (d, ∇d) in cells at u, in cells from the first grid point, without the box."""
    x = wp.clamp(u[0], 0.0, counts[0] - 1.0)
    y = wp.clamp(u[1], 0.0, counts[1] - 1.0)
    z = wp.clamp(u[2], 0.0, counts[2] - 1.0)
    i = wp.min(int(x), int(counts[0]) - 2)
    j = wp.min(int(y), int(counts[1]) - 2)
    k = wp.min(int(z), int(counts[2]) - 2)
    layer = (int(counts[0]) - 1) * (int(counts[1]) - 1)
    at = data + (k * (int(counts[1]) - 1) + j) * (int(counts[0]) - 1) + i
    low = tape[at]
    high = tape[at + layer]
    s = x - float(i)
    t = y - float(j)
    r = z - float(k)
    near = low * (1.0 - r) + high * r
    beside = high - low
    front = near[0] + s * (near[1] - near[0])
    back = near[2] + s * (near[3] - near[2])
    along_x = (1.0 - t) * (near[1] - near[0]) + t * (near[3] - near[2])
    along_y = back - front
    along_z = (1.0 - t) * (beside[0] + s * (beside[1] - beside[0]))
    along_z += t * (beside[2] + s * (beside[3] - beside[2]))
    if x != u[0]:
        along_x = 0.0
    if y != u[1]:
        along_y = 0.0
    if z != u[2]:
        along_z = 0.0
    return wp.vec4(front + t * (back - front), along_x, along_y, along_z)


@wp.func
def grid_box_distance(u: wp.vec3, counts: wp.vec4) -> wp.vec4:
    """Return (d, ∇d) in cells of the grid's box at u."""
    half = wp.vec3(counts[0] - 1.0, counts[1] - 1.0, counts[2] - 1.0) * 0.5
    return box_distance(u - half, half)


@wp.func
def volume_distance(q: wp.vec3, tape: Texels, at: wp.int32) -> wp.vec4:
    """Return (u, ∇u) of sampled distances d: u = RIM + d / s.

    tape[at] = (first texel of the samples, first grid point); tape[at + 1] = (1 / spacing, 1 / s, growth in
    cells, largest slope of the samples); tape[at + 2] = (numbers of grid points, spacing).
    """
    first = tape[at]
    shape = tape[at + 1]
    counts = tape[at + 2]
    u = (q - wp.vec3(first[1], first[2], first[3])) * shape[0]
    d = sampled_distance(u, counts, tape, int(first[0]))
    box = grid_box_distance(u, counts)
    if box[0] > d[0]:
        d = box
    return wp.vec4(
        RIM + (d[0] - shape[2]) * counts[3] * shape[1], d[1] * shape[1], d[2] * shape[1], d[3] * shape[1]
    )


@wp.func
def volume_bounds(center: wp.vec3, radius: wp.float32, tape: Texels, at: wp.int32) -> wp.vec3:
    """Bound u over a ball by the largest slope of the samples; the box's distance has slope 1."""
    first = tape[at]
    shape = tape[at + 1]
    counts = tape[at + 2]
    u = (center - wp.vec3(first[1], first[2], first[3])) * shape[0]
    reach = radius * shape[0]
    d = sampled_distance(u, counts, tape, int(first[0]))[0]
    box = grid_box_distance(u, counts)[0]
    slope = wp.max(shape[3], 1.0)
    low = wp.max(d - slope * reach, box - reach) - shape[2]
    high = wp.max(d + slope * reach, box + reach) - shape[2]
    rate = counts[3] * shape[1]
    return wp.vec3(RIM + low * rate, RIM + high * rate, slope * shape[1])


class Volume(Falling, FieldPrimitive):
    """A solid by a grid of signed distances: below 0 inside, 0 on the surface.

    Distances are interpolated linearly. The field is g(RIM + d / s): ½ on the surface, and 0 from the
    distance `width` outward, with s = width / (1 − RIM). It ends there with every `falloff`. The solid ends
    at the box of the grid. `from_sdf` and `from_mesh` make volumes.

    Examples
    --------
    >>> import numpy as np
    >>> from blobtree import from_sdf
    >>> def distance(points):
    ...     return np.linalg.norm(points, axis=1) - 1.0
    >>> ball = from_sdf(distance, (-2, -2, -2), (2, 2, 2), spacing=0.25, width=0.5)
    >>> ball([[0.0, 0.0, 1.0], [0.0, 0.0, 1.5]]).tolist()
    [0.5, 0.0]
    """

    texels_read = 3
    value_gradient = formula(volume_distance)
    bounds = formula(volume_bounds)

    samples: Annotated[
        Samples, Parameter(Quantity.SAMPLES, "signed distances at the grid points, in spacings")
    ]
    corner: Vector = par.point("first point of the grid")
    spacing: float = par.length("distance between neighbouring grid points")
    _: KW_ONLY
    width: float = par.length("distance from the surface at which the field is 0")
    growth: float = par.distance(
        "distance by which the surface lies outside that of the samples", default=0.0
    )

    @property
    def mean_radius(self) -> float:
        """The radius to which the width is in proportion with the usual falloff."""
        return self.width / (1.0 / RIM - 1.0)

    @property
    def profile_factor(self) -> float:
        """Factor k of `evaluators.profile_distance`: whatever the falloff, the field ends at the width."""
        return (1.0 / self.profile[0].rim - 1.0) / (1.0 / RIM - 1.0)

    def grown(self, distance: float) -> "Volume":
        """Return this volume with its surface farther out, as far as the samples' distances reach."""
        return replace(self, growth=self.growth + distance)

    @property
    def data(self) -> ArrayLike:
        """The samples as texels (nz, ny − 1, nx − 1, 4), see the head of this file."""
        return _texels_of(self.samples)

    @classmethod
    def boxes(cls, leaves: Any) -> Box:
        """Return the grids' boxes, larger by the width and the growth."""
        counts = np.array([leaf.samples.shape for leaf in leaves], np.float64)
        spacings = np.array([[leaf.spacing] for leaf in leaves])
        corners = np.array([leaf.corner for leaf in leaves], np.float64)
        margins = (
            np.array([[max(leaf.width + leaf.growth, 0.0)] for leaf in leaves]) + 1e-5 * counts * spacings
        )
        return corners - margins, corners + (counts - 1.0) * spacings + margins

    @classmethod
    def packed_fields(cls, leaves: Any) -> Float64Array:
        """Return the numbers that the formulas read; the index of the samples is filled in later."""
        rows = [
            [0.0, *leaf.corner, 1.0 / leaf.spacing, (1.0 - RIM) / leaf.width, leaf.growth / leaf.spacing,
             _steepest_of(leaf.samples), *leaf.samples.shape, leaf.spacing]
            for leaf in leaves
        ]  # fmt: skip
        return np.array(rows, np.float64).reshape(len(rows), 3, 4)


def from_sdf(
    distances: ArrayLike | Callable[[Float64Array], ArrayLike],
    lower: ArrayLike,
    upper: ArrayLike | None = None,
    *,
    spacing: float,
    width: float,
    color: Any = DEFAULT_COLOR,
    **keywords: Any,
) -> Volume:
    """Return the solid of a signed distance, sampled on a grid.

    The surface differs from that of an exact distance by at most spacing² · κ / 4 where no principal
    curvature exceeds κ, and by less than a spacing at sharp edges.

    Parameters
    ----------
    distances : array-like (nx, ny, nz) or function
        Signed distances at grid points, below 0 inside; or a function of points (n, 3) that returns them.
    lower : array-like (3,)
        First grid point.
    upper : array-like (3,), optional
        Corner of the box in which a function is sampled.
    spacing : float
        Distance between grid points.
    width : float
        Distance from the surface at which the field becomes 0.
    color : color
        Colour of the solid.
    keywords
        `falloff`, `weight` and `attributes` of the solid.

    Raises
    ------
    InvalidNode
        Numbers are not finite, are no distances, or no number is below 0.

    Examples
    --------
    >>> import numpy as np
    >>> from blobtree import from_sdf
    >>> slab = from_sdf(lambda p: np.abs(p[:, 2]) - 0.25, (0, 0, -1), (2, 2, 1), spacing=0.125, width=0.5)
    >>> slab([[1.0, 1.0, 0.25]]).round(4).tolist()
    [0.5]
    """
    corner = finite_vector("lower", lower)
    step = positive_number("spacing", spacing)
    if callable(distances):
        if upper is None:
            raise InvalidNode("upper: expected the other corner of the box in which the function is sampled")
        numbers = _sampled(distances, corner, finite_vector("upper", upper), step)
    else:
        numbers = Samples.of(distances).array.astype(np.float64)
    samples = Samples.of(numbers / step)
    steepest = _steepest_of(samples)
    if steepest > STEEPEST:
        raise InvalidNode(
            f"distances: expected numbers that change by about 1 per unit of length, got {steepest:.3g}; "
            "sample a distance, and give its spacing"
        )
    if samples.array.min() >= 0.0:
        raise InvalidNode("distances: expected some below 0, inside the solid, got none")
    return Volume(samples, corner, step, width=width, color=color, **keywords)


def from_mesh(
    mesh: Any,
    *,
    cell_size: float | None = None,
    radius: float | None = None,
    width: float | None = None,
    color: Any = DEFAULT_COLOR,
    **keywords: Any,
) -> Volume:
    """Return the solid in a closed triangle mesh, or a shell around any mesh.

    Distances are sampled on a grid, exactly at its points. The surface lies within a cell of the mesh's.

    Parameters
    ----------
    mesh
        A pyvista mesh, an object with ``vertices`` and ``faces`` (trimesh, `Mesh`), or a pair of such arrays.
    cell_size : float, optional
        Spacing of the grid; by default a 64th of the mesh's longest side.
    radius : float, optional
        Distance of the surface from the mesh. The mesh may then be open. By default the mesh is closed, and
        its own surface is shown.
    width : float, optional
        Distance from the surface at which the field becomes 0; by default four cells.
    color : color
        Colour of the solid.
    keywords
        `falloff`, `weight` and `attributes` of the solid.

    Raises
    ------
    InvalidNode
        The mesh has no triangles, its arrays are wrong, or it is open and no radius is given.

    Examples
    --------
    >>> import pyvista
    >>> from blobtree import from_mesh
    >>> cube = from_mesh(pyvista.Cube(), cell_size=0.125, width=0.25)
    >>> cube([[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]).round(3).tolist()
    [0.5, 1.0]
    """
    triangles = triangles_of(mesh)
    size = triangles.upper - triangles.lower
    step = (
        float(size.max()) / DEFAULT_RESOLUTION
        if cell_size is None
        else positive_number("cell_size", cell_size)
    )
    blend = WIDTH_CELLS * step if width is None else positive_number("width", width)
    shell = 0.0 if radius is None else positive_number("radius", radius)
    if radius is None:
        triangles = triangles.closed()
    margin = shell + 2.0 * step
    corner = triangles.lower - margin
    counts = np.ceil((size + 2.0 * margin) / step).astype(np.int64) + 1
    if counts.prod() > MAX_NUMBERS:
        raise InvalidNode(
            f"cell_size: expected a grid of at most {MAX_NUMBERS:,} points, got {counts.prod():,}; "
            "take larger cells"
        )
    distances = mesh_distances(
        triangles, corner, step, counts, farthest=2.0 * blend + shell, solid=radius is None
    )
    samples = Samples.of((distances - shell) / step)
    x, y, z = corner.tolist()
    return Volume(samples, (x, y, z), step, width=blend, color=color, **keywords)


def _sampled(
    function: Callable[[Float64Array], ArrayLike], lower: Vector, upper: Vector, step: float
) -> Float64Array:
    """Return the results of a function on a grid between two corners."""
    size = np.subtract(upper, lower)
    if (size <= 0.0).any():
        raise InvalidNode(f"upper: expected a corner above {lower}, got {upper}")
    counts = np.maximum(np.ceil(size / step - 1e-6).astype(np.int64) + 1, 2)
    if counts.prod() > MAX_NUMBERS:
        raise InvalidNode(f"spacing: expected at most {MAX_NUMBERS:,} grid points, got {counts.prod():,}")
    points = grid_points(np.array(lower), step, counts)
    try:
        values = np.asarray(function(points), np.float64)
    except Exception as error:  # the function is the user's own
        raise InvalidNode(f"distances: the function fails: {type(error).__name__}: {error}") from error
    if values.shape != (len(points),):
        raise InvalidNode(
            f"distances: expected {len(points)} numbers of the function, got the shape {values.shape}"
        )
    return values.reshape(counts)


@sized_cache(MAX_TEXELS_BYTES)
def _texels_of(samples: Samples) -> Float32Array:
    """Return samples as the texels that the formulas read."""
    v = samples.array
    corners = [v[:-1, :-1], v[1:, :-1], v[:-1, 1:], v[1:, 1:]]
    return np.ascontiguousarray(np.stack(corners, axis=-1).transpose(2, 1, 0, 3))


@lru_cache(maxsize=256)
def _steepest_of(samples: Samples) -> float:
    """Return the largest slope of the interpolated samples in any cell, per spacing."""
    total = np.zeros(np.subtract(samples.shape, 1))
    for axis in range(3):
        steps = np.abs(np.diff(samples.array.astype(np.float64), axis=axis))
        for other in range(3):
            if other != axis:
                low = np.take(steps, range(steps.shape[other] - 1), axis=other)
                high = np.take(steps, range(1, steps.shape[other]), axis=other)
                steps = np.maximum(low, high)
        total += steps**2
    return float(np.sqrt(total.max()) * (1.0 + 1e-6))
