"""Meshes and slices as pyvista objects; only these functions import pyvista."""

import errno
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from blobtree._typing import Float32Array, Float64Array, Int32Array
from blobtree.errors import InvalidPoints, InvalidResolution, MissingPackage
from blobtree.files import replacing, write_atomically
from blobtree.formulas.falloff import ISO
from blobtree.tape.model import ImplicitModel
from blobtree.validation import finite_number, finite_vector, is_whole, items, shown

if TYPE_CHECKING:
    import pyvista as pv

    from blobtree.field_slice import FieldSlice

SLICE_RESOLUTION = 256
"""Squares along the longer side of a slice."""

MAX_SQUARES = 1 << 14
"""Largest number of squares along the longer side of a slice."""

LEVELS = tuple(level / 10.0 for level in range(1, 11))
"""Field values that get lines by default."""

STL_HEADER, STL_FACE = 84, 50
"""Bytes of the header and of a triangle of a binary STL file."""

PLY_SIZES = {"uchar": 1, "float": 4, "int": 4}
"""Bytes of the types in PLY files that VTK writes."""

NEWTON_STEPS = 8
LEVEL_TOLERANCE = 1e-6
"""Largest field error of a point on the line of its level."""


class ColoredMesh(Protocol):
    """Mesh of these functions, a `blobtree.Mesh`."""

    @property
    def vertices(self) -> Float32Array: ...  # noqa: D102
    @property
    def faces(self) -> Int32Array: ...  # noqa: D102
    @property
    def normals(self) -> Float32Array: ...  # noqa: D102
    @property
    def colors(self) -> Float32Array: ...  # noqa: D102
    @property
    def sheet_counts(self) -> NDArray[np.uint8] | None: ...  # noqa: D102


def to_polydata(mesh: ColoredMesh) -> "pv.PolyData":
    """Return a mesh as `pyvista.PolyData` with active normals, "RGB" (uint8) and any "sheet_counts"."""
    _require_pyvista()
    import pyvista as pv

    if len(mesh.vertices) == 0:  # pyvista refuses empty arrays
        return pv.PolyData()
    surface = _polydata(mesh.vertices, mesh.faces)
    surface.point_data["RGB"] = np.rint(np.clip(mesh.colors, 0.0, 1.0) * 255.0).astype(np.uint8)
    normals: NDArray[Any] = mesh.normals
    surface.point_data.active_normals = normals
    if mesh.sheet_counts is not None:
        surface.point_data["sheet_counts"] = mesh.sheet_counts
    return surface


def to_image_data(
    name: str, values: Float32Array, origin: tuple[float, float, float], spacing: float
) -> "pv.ImageData":
    """Return values ``float32[nx, ny, nz]`` at the points of a grid as `pyvista.ImageData`."""
    _require_pyvista()
    import pyvista as pv

    grid = pv.ImageData(dimensions=values.shape, spacing=3 * (spacing,), origin=origin)
    grid.point_data[name] = values.ravel(order="F")
    return grid


MESH_SUFFIXES = (".ply", ".obj", ".stl", ".vtp")
"""Formats of `write_polydata`."""


def write_polydata(path: str | os.PathLike[str], surface: "pv.PolyData") -> None:
    """Write a surface of triangles to a file, whole or not at all.

    Parameters
    ----------
    path : str or path-like
        The file; its suffix is the format: ply (with "RGB", if the surface has it), obj, stl or vtp.
    surface : pyvista.PolyData
        The surface.

    Raises
    ------
    UnusableFile
        The file cannot be written in full; an existing file stays as it was.
    """
    if Path(path).suffix.lower() == ".vtp":
        write_atomically(path, xml_bytes(surface))
        return
    from blobtree.vtk_errors import vtk_errors

    copy = surface.copy(deep=False)  # pyvista adds normals to the surface that it saves
    with replacing(path) as temporary:
        texture = "RGB" if temporary.suffix.lower() == ".ply" and "RGB" in copy.point_data else None
        with vtk_errors() as errors:
            copy.save(temporary, texture=texture)
        if errors or not _is_whole(temporary, copy):
            raise OSError(errno.ENOSPC, "the file could not be written in full")


def _is_whole(path: Path, surface: "pv.PolyData") -> bool:
    """Return True if a file has the length and the end that its format gives the surface.

    VTK's writers do not report every failure of the disk.
    """
    content = path.read_bytes()
    match path.suffix.lower():
        case ".stl":
            return len(content) == STL_HEADER + STL_FACE * surface.n_cells
        case ".obj":
            lines = content.count(b"\nf ") + content.startswith(b"f ")
            return content.endswith(b"\n") and lines == surface.n_cells
        case _:
            header, found, body = content.partition(b"end_header\n")
            return bool(found) and len(body) == _ply_length(header.decode("ascii"), surface)


def xml_bytes(dataset: "pv.PolyData | pv.ImageData") -> bytes:
    """Return a VTP or VTI file; on a full disk, VTK's own writing to the file kills the process."""
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter() if dataset.IsA("vtkPolyData") else vtkXMLImageDataWriter()
    writer.SetInputData(dataset)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return writer.GetOutputString().encode("ascii")


def _ply_length(header: str, surface: "pv.PolyData") -> int:
    """Return the bytes of the rows that the header of a binary PLY file announces."""
    sizes = [
        PLY_SIZES[line.split()[1]] for line in header.splitlines() if re.match(r"property (?!list)", line)
    ]
    (count, index) = re.findall(r"property list (\w+) (\w+)", header)[0]
    return surface.n_points * sum(sizes) + surface.n_cells * (PLY_SIZES[count] + 3 * PLY_SIZES[index])


def slice_tree(
    tree: ImplicitModel,
    origin: ArrayLike,
    normal: ArrayLike,
    *,
    resolution: int = SLICE_RESOLUTION,
    values: Iterable[float] = LEVELS,
) -> "FieldSlice":
    """Return the field on a plane, see `Node.slice`."""
    _require_pyvista()
    from blobtree.field_slice import FieldSlice

    levels = _levels(values)
    if not is_whole(resolution) or not 1 <= resolution <= MAX_SQUARES:
        raise InvalidResolution(
            f"resolution: expected a whole number of squares from 1 to {MAX_SQUARES}, got {resolution!r}"
        )
    corner, sides, counts = _rectangle(tree, origin, normal, int(resolution))
    plane = _plane(tree, corner, sides, counts)
    across = np.cross(*sides)
    step = float(max(np.linalg.norm(side) / count for side, count in zip(sides, counts, strict=True)))
    blocks = FieldSlice()
    blocks["plane"] = plane
    blocks["lines"] = _lines(tree, plane, levels, across, step)
    blocks["surface"] = _lines(tree, plane, [ISO], across, step)
    return blocks


def _require_pyvista() -> None:
    try:
        import pyvista  # noqa: F401  (tests the installation)
    except ImportError as error:
        raise MissingPackage(
            "this needs pyvista, which is not installed; run: pip install pyvista"
        ) from error


def _polydata(points: NDArray[Any], faces: NDArray[Any]) -> "pv.PolyData":
    import pyvista as pv

    surface: pv.PolyData = pv.PolyData.from_regular_faces(points, faces)
    return surface


def _levels(values: Iterable[float]) -> list[float]:
    found = items(values)
    if found is None:
        raise InvalidPoints(f"values: expected several field values, got {shown(values)}; put it in a list")
    levels = sorted({finite_number("values", value) for value in found})
    if levels and levels[0] <= 0.0:
        raise InvalidPoints(
            f"values: expected field values above 0, got {levels[0]!r}; 0 is everywhere outside"
        )
    return levels


def _rectangle(
    tree: ImplicitModel, origin: ArrayLike, normal: ArrayLike, resolution: int
) -> tuple[Float64Array, tuple[Float64Array, Float64Array], tuple[int, int]]:
    """Return lowest corner (3,), sides (3,) and counts of squares of the plane's part in the box."""
    start = np.array(finite_vector("origin", origin))
    axis = np.array(finite_vector("normal", normal))
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise InvalidPoints("normal: expected a direction, got the zero vector")
    axis /= length
    right = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    right = right - (right @ axis) * axis
    right /= np.linalg.norm(right)
    up = np.cross(axis, right)
    crossings = _crossings(tree, start, axis)
    if len(crossings) == 0:
        raise InvalidPoints(
            f"origin: the plane through {tuple(start.tolist())} misses the model, whose influence ends at "
            f"{tree.support[0].tolist()} and {tree.support[1].tolist()}; move it"
        )
    flat = np.column_stack([(crossings - start) @ right, (crossings - start) @ up])
    low, high = flat.min(axis=0), flat.max(axis=0)
    extent = np.maximum(high - low, 1e-6 * float((high - low).max()) or 1e-30)
    counts = np.maximum(np.rint(resolution * extent / extent.max()), 1).astype(int)
    sides = (extent[0] * right, extent[1] * up)
    return start + low[0] * right + low[1] * up, sides, (int(counts[0]), int(counts[1]))


def _crossings(tree: ImplicitModel, start: Float64Array, axis: Float64Array) -> Float64Array:
    """Return the points (n, 3) where edges of the tree's box cross the plane."""
    box = np.array(tree.support, np.float64)
    corners = np.array([[box[c >> i & 1, i] for i in range(3)] for c in range(8)])
    heights = (corners - start) @ axis
    points = []
    for a in range(8):
        for b in (a | 1, a | 2, a | 4):
            if a != b and (heights[a] <= 0.0) != (heights[b] <= 0.0):
                fraction = heights[a] / (heights[a] - heights[b])
                points.append(corners[a] + fraction * (corners[b] - corners[a]))
    return np.array(points).reshape(-1, 3)


def _plane(
    tree: ImplicitModel,
    corner: Float64Array,
    sides: tuple[Float64Array, Float64Array],
    counts: tuple[int, int],
) -> "pv.PolyData":
    """Return a grid of squares with the field at their corners."""
    nu, nv = counts
    u, v = np.linspace(0.0, 1.0, nu + 1), np.linspace(0.0, 1.0, nv + 1)
    points = (corner + v[:, None, None] * sides[1] + u[None, :, None] * sides[0]).reshape(-1, 3)
    lowest = (np.arange(nv)[:, None] * (nu + 1) + np.arange(nu)).reshape(-1, 1)
    squares = lowest + np.array([0, 1, nu + 2, nu + 1])
    plane = _polydata(points.astype(np.float32), squares)
    plane.point_data["field"] = tree(plane.points)
    return plane


def _lines(
    tree: ImplicitModel, plane: "pv.PolyData", levels: list[float], across: Float64Array, step: float
) -> "pv.PolyData":
    """Return the lines of some field levels, with their points moved onto the levels within the plane."""
    import pyvista as pv

    if not levels:
        return pv.PolyData()
    lines: Any = plane.contour(isosurfaces=levels, scalars="field")
    if lines.n_points == 0:
        return pv.PolyData()
    points = lines.points.astype(np.float64)
    targets = np.asarray(lines["field"], np.float64)
    targets = np.array(levels)[np.abs(targets[:, None] - np.array(levels)).argmin(axis=1)]
    lines.points = _onto_levels(tree, points, targets, across / np.linalg.norm(across), step).astype(
        np.float32
    )
    lines.point_data["field"] = targets.astype(np.float32)
    return cast("pv.PolyData", lines)


def _onto_levels(
    tree: ImplicitModel, points: Float64Array, targets: Float64Array, axis: Float64Array, step: float
) -> Float64Array:
    """Return points moved onto their levels by Newton's method; a point that gets no closer stays."""
    best, moved = points.copy(), points.copy()
    gaps = targets - tree(points)
    smallest = np.abs(gaps)
    for _ in range(NEWTON_STEPS):
        active = np.flatnonzero(np.abs(gaps) > LEVEL_TOLERANCE)
        if len(active) == 0:
            break
        slopes = tree.gradient(moved[active]).astype(np.float64)
        slopes -= (slopes @ axis)[:, None] * axis
        steepness = np.linalg.norm(slopes, axis=1)
        lengths = np.clip(gaps[active] / np.maximum(steepness, 1e-30), -0.5 * step, 0.5 * step)
        moved[active] += slopes * (lengths / np.maximum(steepness, 1e-30))[:, None]
        gaps[active] = targets[active] - tree(moved[active])
        better = active[np.abs(gaps[active]) < smallest[active]]
        best[better], smallest[better] = moved[better], np.abs(gaps[better])
    return best
