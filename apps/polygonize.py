"""``implicit-decals polygonize``: an implicit model as a triangle mesh."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyvista as pv
from cyclopts import Parameter
from numpy.typing import NDArray

import blobtree
from decals.scene import TreeObject

from .errors import UsageError
from .models import load_model
from .options import OptionalWhole
from .output import MESH_SUFFIXES, check_output, replacing
from .progress_bars import progress_bars
from .warp_start import start_warp


def polygonize(
    model: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    resolution: OptionalWhole = None,
    cell_size: Annotated[float | None, Parameter(show_default=False)] = None,
) -> None:
    """Write an implicit model's surface as a triangle mesh.

    Parameters
    ----------
    model
        A BlobTree in JSON, or a sample (creature, spheres).
    output
        The mesh: ply (with colours), vtp (with colours and normals), obj or stl.
    resolution
        Cells along the longest side. Default: 64.
    cell_size
        Side of a cell in the model's units, in place of the resolution.
    """
    check_output(output, MESH_SUFFIXES)
    start_warp()
    loaded = load_model(model)
    if not isinstance(loaded, TreeObject):
        raise UsageError(f"expected a BlobTree in JSON or a sample (creature, spheres), {model!r} is none")
    with progress_bars() as progress:
        mesh = blobtree.polygonize(loaded.tree, resolution=resolution, cell_size=cell_size, progress=progress)
        if len(mesh.faces) == 0:
            raise UsageError(
                f"{model!r} shows no surface in cells of this size: its parts may be smaller, or cut each "
                "other away; take a higher --resolution"
            )
        write_mesh(output, mesh)


def write_mesh(path: Path, mesh: blobtree.Mesh) -> None:
    """Write a mesh as the kind of file that the extension names."""
    vertices: NDArray[Any] = mesh.vertices
    faces: NDArray[Any] = mesh.faces
    surface = pv.PolyData.from_regular_faces(vertices, faces)
    rgb = np.rint(np.clip(mesh.colors, 0.0, 1.0) * 255.0).astype(np.uint8)
    surface.point_data["RGB"] = rgb
    surface.point_data.active_normals = mesh.normals
    with replacing(path) as temporary:
        if path.suffix.lower() == ".ply":
            surface.save(temporary, texture=rgb)
        else:
            surface.save(temporary)
