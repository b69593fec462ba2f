"""``implicit-decals polygonize``: the surface of an implicit model as a triangle mesh."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from blobtree.meshing.polygonize import MAX_TRIANGLES
from blobtree.pyvista_views import MESH_SUFFIXES, write_polydata
from decals import MeshObject, Scene
from decals.apps.commands.options import Definitions, OptionalWhole, Trust
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_model
from decals.apps.output import check_output, print_path
from decals.errors import InvalidInput, InvalidMesh, InvalidScene
from decals.scenes.meshes import as_polydata

OptionalLength = Annotated[float | None, Parameter(show_default=False)]


def polygonize(
    model: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    resolution: Annotated[OptionalWhole, Parameter(name=("--resolution", "--cells"))] = None,
    cell_size: OptionalLength = None,
    chord_error: OptionalLength = None,
    max_triangles: int = MAX_TRIANGLES,
    adaptive: bool = True,
    creases: bool = False,
    split_normals: bool = False,
    define: Definitions = None,
    trust: Trust = False,
) -> None:
    """Write the surface of an implicit model as a triangle mesh.

    Parameters
    ----------
    model
        A BlobTree in JSON, a sample (creature, spheres), or a saved scene, of which all objects are written.
    output
        The mesh file: ply (with colours), vtp (with colours and normals), obj or stl.
    resolution
        Cells along the longest side. Default: 64, and smaller cells where parts are thin.
    cell_size
        Side of a cell in the model's units, instead of --resolution.
    chord_error
        Largest distance of triangles from the surface in the model's units, instead of a cell size.
    max_triangles
        Triangles that a mesh by --chord-error may have in each object; more are refused before they are
        computed.
    adaptive
        Cells of several sizes for --chord-error; --no-adaptive takes cells of one size.
    creases
        Put vertices on the edges and corners that unions, intersections and differences leave.
    split_normals
        As --creases, with separate vertices and normals on the sides of a crease, so that it looks sharp.
    """
    check_output(output, MESH_SUFFIXES)
    with preparing(define) as progress:
        loaded = load_model(model, trust=trust)
        if isinstance(loaded, MeshObject):
            raise InvalidInput(
                f"expected a BlobTree or a scene in JSON, or a sample (creature, spheres), got {model!r}"
            )
        objects = loaded.objects if isinstance(loaded, Scene) else [loaded]
        try:
            surface = as_polydata(
                objects,
                resolution=resolution,
                cell_size=cell_size,
                chord_error=chord_error,
                max_triangles=max_triangles,
                adaptive=adaptive,
                creases=creases,
                split_normals=split_normals,
                progress=progress,
            )
        except (InvalidMesh, InvalidScene) as error:
            raise InvalidInput(f"{model!r}: {error}") from error
        write_polydata(output, surface)
    print_path(output)
