"""The field of a tree on a grid, or the signed distances from its surface, and files of them."""

import gzip
import io
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from blobtree._typing import Float32Array, Float64Array
from blobtree.errors import InvalidFile, InvalidNode, InvalidResolution
from blobtree.files import write_atomically
from blobtree.progress import Cancel, Progress, reporting
from blobtree.pyvista_views import to_image_data, xml_bytes
from blobtree.sampling.mesh_distances import grid_points
from blobtree.sampling.tree_distances import TreeMeter
from blobtree.tape.model import ImplicitModel, checked_tree, values_at
from blobtree.validation import describe, positive_number, truth

if TYPE_CHECKING:
    import pyvista as pv

DEFAULT_RESOLUTION = 64
"""Cells along the longest side of a grid."""

MAX_POINTS = 1 << 26
"""Most points of a grid: those of a file of 256 MB."""

BLOCK_POINTS = 1 << 20
"""Points that are computed at once, at least those of one layer."""


@dataclass(frozen=True, eq=False)
class FieldGrid:
    """Numbers at the points of a grid; `field_grid` makes some.

    Attributes
    ----------
    values : float32[nx, ny, nz]
        Field, ½ on the surface and more inside; or signed distances, below 0 inside.
    origin : (x, y, z)
        Position of the first value.
    spacing : float
        Distance between neighbouring points along each axis.
    error : float, optional
        Distance by which signed distances differ from exact ones at most, see `SignedDistances`; None for a
        field.

    Examples
    --------
    >>> from blobtree import Point, field_grid
    >>> grid = field_grid(Point((0, 0, 0), radius=1.0), resolution=16)
    >>> grid.values.ndim, grid.name
    (3, 'field')
    """

    values: Float32Array
    origin: tuple[float, float, float]
    spacing: float
    error: float | None = None

    @property
    def name(self) -> str:
        """Name of the values in files: ``"field"`` or ``"distance"``."""
        return "field" if self.error is None else "distance"

    def to_pyvista(self) -> "pv.ImageData":
        """Return a grid of pyvista with the values at its points.

        Examples
        --------
        >>> from blobtree import Point, field_grid
        >>> grid = field_grid(Point((0, 0, 0), radius=1.0), resolution=16).to_pyvista()
        >>> bool(abs(grid.contour([0.5], scalars="field").length / (2 * 3**0.5) - 1) < 0.1)
        True
        """
        grid = to_image_data(self.name, self.values, self.origin, self.spacing)
        if self.error is not None:
            grid.field_data["error"] = [self.error]
        return grid

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the grid to a file, whole or not at all; the suffix is the format.

        Parameters
        ----------
        path : str or path
            The file: vti (VTK), nrrd, npz (arrays ``values``, ``origin``, ``spacing``, and ``error`` of
            distances) or npy (the values alone).

        Raises
        ------
        InvalidFile
            No path, or one with another suffix.
        UnusableFile
            The file cannot be written.

        Examples
        --------
        >>> import numpy
        >>> from blobtree import Point, field_grid
        >>> field_grid(Point((0, 0, 0), radius=1.0), resolution=8).save("ball.npy")
        >>> numpy.load("ball.npy").shape
        (9, 9, 9)
        """
        if not isinstance(path, str | os.PathLike):
            raise InvalidFile(f"path: expected the path of a file, got {describe(path)}")
        suffix = Path(path).suffix.lower()
        if suffix not in GRID_FORMATS:
            known = " or ".join(GRID_FORMATS)
            raise InvalidFile(f"expected a file that ends in {known}, got {os.fspath(path)!r}; rename it")
        write_atomically(path, GRID_FORMATS[suffix](self))


def _nrrd(grid: FieldGrid) -> bytes:
    """Return an NRRD file (format 4), packed by gzip."""
    step, numbers = f"{grid.spacing:.17g}", " ".join(map(str, grid.values.shape))
    header = [
        "NRRD0004",
        f"content: {grid.name}",
        "type: float",
        "dimension: 3",
        "space dimension: 3",
        f"sizes: {numbers}",
        f"space directions: ({step},0,0) (0,{step},0) (0,0,{step})",
        f"space origin: ({','.join(f'{value:.17g}' for value in grid.origin)})",
        "kinds: domain domain domain",
        "endian: little",
        "encoding: gzip",
        *([] if grid.error is None else [f"error:={grid.error:.17g}"]),
    ]
    packed = gzip.compress(grid.values.astype("<f4").tobytes(order="F"), 5, mtime=0)
    return "\n".join(header).encode() + b"\n\n" + packed


def _npy(grid: FieldGrid) -> bytes:
    file = io.BytesIO()
    np.save(file, grid.values)
    return file.getvalue()


def _npz(grid: FieldGrid) -> bytes:
    file = io.BytesIO()
    error: dict[str, Any] = {} if grid.error is None else {"error": grid.error}
    np.savez_compressed(file, values=grid.values, origin=grid.origin, spacing=grid.spacing, **error)
    return file.getvalue()


GRID_FORMATS: dict[str, Callable[[FieldGrid], bytes]] = {
    ".vti": lambda grid: xml_bytes(grid.to_pyvista()),
    ".nrrd": _nrrd,
    ".npz": _npz,
    ".npy": _npy,
}
"""Writers of grids, by the suffixes of their files."""


def field_grid(
    tree: ImplicitModel,
    *,
    resolution: int | None = None,
    spacing: float | None = None,
    distance: bool = False,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> FieldGrid:
    """Return the field of a tree, or the signed distances from its surface, on a grid over its support.

    Outside of the support the field is 0.

    Parameters
    ----------
    tree : Node
        The tree.
    resolution : int, optional
        Cells along the longest side of the grid. Default 64.
    spacing : float, optional
        Distance between grid points, in model units, in place of a resolution.
    distance : bool
        True for signed distances. Their error is stated.
    progress : callable, optional
        Called with the stage and the fraction done.
    cancel : callable, optional
        Called often; the work stops if it returns True.

    Raises
    ------
    InvalidNode
        `tree` is no tree, its field is 0, or distances are asked for and it has no surface.
    InvalidResolution
        Resolution or spacing are out of range, both are given, or the grid has too many points.

    See Also
    --------
    blobtree.from_sdf : a leaf from signed distances on a grid.

    Examples
    --------
    >>> from blobtree import Point, field_grid
    >>> grid = field_grid(Point((0, 0, 0), radius=1.0), resolution=32, distance=True)
    >>> grid.values.shape, bool(abs(grid.values[16, 16, 16] + 1) <= grid.error)
    ((33, 33, 33), True)
    """
    checked_tree(tree)
    truth("distance", distance, InvalidNode)
    lower, upper = (corner.astype(np.float64) for corner in tree.support)
    size = upper - lower
    if not np.isfinite(size).all() or size.max() <= 0.0:
        raise InvalidNode(
            "tree: expected a field that is above 0 somewhere, got one without support; check its operands"
        )
    step, cells = _steps(size, resolution, spacing)
    counts = cells + 1
    corner = 0.5 * (lower + upper - step * cells)
    values: Float32Array = np.empty(counts, np.float32)
    with reporting(progress, cancel) as report:
        report("finding the surface" if distance else "evaluating the field", 0.0)
        meter = TreeMeter(tree, int(cells.max())) if distance else None
        layers = max(1, BLOCK_POINTS // int(counts[1] * counts[2]))
        for first in range(0, int(counts[0]), layers):
            report("measuring distances" if distance else "evaluating the field", first / counts[0])
            part = values[first : first + layers]
            start = corner + np.array([first * step, 0.0, 0.0])
            points = grid_points(start, step, part.shape)
            found = (
                values_at(tree.tape, points.astype(np.float32)) if meter is None else meter.measure(points)
            )
            part[...] = found.reshape(part.shape)
    x, y, z = corner.tolist()
    return FieldGrid(values, (x, y, z), step, None if meter is None else meter.error)


def _steps(size: Float64Array, resolution: int | None, spacing: float | None) -> tuple[float, Any]:
    """Return the distance of grid points and the numbers of cells along the axes."""
    if resolution is not None and spacing is not None:
        raise InvalidResolution("expected a resolution or a spacing, got both; leave one out")
    if spacing is not None:
        step = positive_number("spacing", spacing)
    else:
        step = float(size.max()) / _whole_resolution(resolution)
    with np.errstate(over="ignore"):  # infinite counts are refused
        cells = np.maximum(np.ceil(size / step - 1e-6), 1.0)
        total = float((cells + 1.0).prod())
    if not total <= MAX_POINTS:
        raise InvalidResolution(
            f"expected at most {MAX_POINTS:,} grid points, got {total:,.0f}; "
            "take a lower resolution or a larger spacing"
        )
    return step, cells.astype(np.int64)


def _whole_resolution(resolution: Any) -> int:
    """Return a number of cells, by default `DEFAULT_RESOLUTION`; raise InvalidResolution for others."""
    if resolution is None:
        return DEFAULT_RESOLUTION
    whole = isinstance(resolution, int | np.integer) and not isinstance(resolution, bool)
    if not whole or not 1 <= resolution <= MAX_POINTS:
        raise InvalidResolution(
            f"resolution: expected a whole number from 1 to {MAX_POINTS:,}, got {describe(resolution)}"
        )
    return int(resolution)
