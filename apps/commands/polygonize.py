"""``implicit-decals polygonize``: an implicit model as a triangle mesh."""

from pathlib import Path
from typing import Annotated

import pyvista as pv
from cyclopts import Parameter

from decals.scenes.scene import TreeObject

from ..errors import UsageError
from ..machine.warp_start import start_warp
from ..models.definitions import import_definitions
from ..models.loading import load_model
from ..output import MESH_SUFFIXES, check_output, replacing
from .options import Definitions, OptionalWhole
from .progress_bars import progress_bars

OptionalLength = Annotated[float | None, Parameter(show_default=False)]


def polygonize(
    model: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    resolution: Annotated[OptionalWhole, Parameter(name=("--resolution", "--cells"))] = None,
    cell_size: OptionalLength = None,
    chord_error: OptionalLength = None,
    creases: bool = False,
    split_normals: bool = False,
    define: Definitions = None,
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
    chord_error
        How far triangles may lie from the surface in the model's units, in place of either.
    creases
        Vertices lie on the edges and corners that unions, intersections and differences leave.
    split_normals
        The same, and each side of a crease has vertices and normals of its own, so that it looks sharp.
    define
        A Python file or module that defines own kinds of nodes, for BlobTrees in JSON that use them. May be
        given several times.
    """
    check_output(output, MESH_SUFFIXES)
    start_warp()
    import_definitions(define)
    loaded = load_model(model)
    if not isinstance(loaded, TreeObject):
        raise UsageError(f"expected a BlobTree in JSON or a sample (creature, spheres), {model!r} is none")
    with progress_bars() as progress:
        surface = loaded.tree.mesh(
            resolution=resolution,
            cell_size=cell_size,
            chord_error=chord_error,
            creases=creases,
            split_normals=split_normals,
            progress=progress,
        )
        if surface.n_points == 0:
            raise UsageError(
                f"{model!r} shows no surface in cells of this size: its parts may be smaller, or cut each "
                "other away; take a higher --resolution"
            )
        write_mesh(output, surface)


def write_mesh(path: Path, surface: pv.PolyData) -> None:
    """Write a mesh as the kind of file that the extension names, whole or not at all."""
    with replacing(path) as temporary:
        if path.suffix.lower() == ".ply":
            surface.save(temporary, texture=surface.point_data["RGB"])
        else:
            surface.save(temporary)
