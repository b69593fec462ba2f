"""``implicit-decals polygonize``: the surface of an implicit model as a triangle mesh."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from blobtree.pyvista_views import write_polydata
from decals import TreeObject
from decals.apps.commands.options import Definitions, OptionalWhole
from decals.apps.commands.progress_bars import progress_bars
from decals.apps.models.loading import import_definitions, load_model
from decals.apps.output import MESH_SUFFIXES, check_output
from decals.errors import InvalidInput

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
    """Write the surface of an implicit model as a triangle mesh.

    Parameters
    ----------
    model
        A BlobTree in JSON, or a sample (creature, spheres).
    output
        The mesh file: ply (with colours), vtp (with colours and normals), obj or stl.
    resolution
        Cells along the longest side. Default: 64.
    cell_size
        Side of a cell in the model's units, instead of --resolution.
    chord_error
        Largest distance of triangles from the surface in the model's units, instead of a cell size.
    creases
        Put vertices on the edges and corners that unions, intersections and differences leave.
    split_normals
        As --creases, with separate vertices and normals on the sides of a crease, so that it looks sharp.
    define
        A Python file or module that defines the custom nodes of BlobTrees in JSON. Its code is run. Can be
        repeated.
    """
    check_output(output, MESH_SUFFIXES)
    import_definitions(define)
    loaded = load_model(model)
    if not isinstance(loaded, TreeObject):
        raise InvalidInput(f"expected a BlobTree in JSON or a sample (creature, spheres), got {model!r}")
    with progress_bars() as progress:
        surface = loaded.tree.to_pyvista(
            resolution=resolution,
            cell_size=cell_size,
            chord_error=chord_error,
            creases=creases,
            split_normals=split_normals,
            progress=progress,
        )
        if surface.n_points == 0:
            raise InvalidInput(
                f"{model!r} has no surface in cells of this size: its parts may be smaller than a cell, or "
                "the tree may be empty; increase --resolution"
            )
        write_polydata(output, surface)
