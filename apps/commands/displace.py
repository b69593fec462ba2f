"""``implicit-decals displace``: the surface of a scene, moved by the heights of its decals, as a mesh."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from blobtree.pyvista_views import MESH_SUFFIXES
from decals import Scene
from decals import displace as displace_scene
from decals.apps.commands.options import (
    ContactName,
    CreaseAngle,
    Definitions,
    MappingName,
    OptionalWhole,
    Stiffness,
    TableFile,
    Trust,
    given,
)
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_model
from decals.apps.output import check_output, print_path
from decals.errors import InvalidInput


def displace(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    edge_length: Annotated[float | None, Parameter(show_default=False)] = None,
    contact: ContactName = None,
    stiffness: Stiffness = None,
    mapping: MappingName = None,
    resolution: Annotated[OptionalWhole, Parameter(name=("--resolution", "--cells"))] = None,
    creases: Annotated[bool, Parameter(negative=())] = False,
    crease_angle: CreaseAngle = None,
    table: TableFile = None,
    define: Definitions = None,
    trust: Trust = False,
) -> None:
    """Write the surface of a scene, moved by the heights of its decals, as a triangle mesh.

    Parameters
    ----------
    scene
        A saved scene, of which some decals have materials with relief.
    output
        The mesh file: glb or ply (with colours), vtp (with colours and normals), obj or stl.
    edge_length
        Greatest length of an edge below a decal with relief, in the model's units. Default: a sixteenth of
        the decal's radius.
    contact
        Contact mode, as for render.
    stiffness
        Stiffness of elastic contact, as for render.
    mapping
        Image mapping, as for render.
    resolution
        Cells along the longest side of each implicit object, before triangles are divided. Default: 64.
    creases
        Keep the edges that unions, intersections and differences leave.
    """
    check_output(output, (".glb", *MESH_SUFFIXES))
    with preparing(define) as progress:
        loaded = load_model(scene, trust=trust, crease_angle=crease_angle, table=table)
        if not isinstance(loaded, Scene):
            raise InvalidInput(f"expected a saved scene with decals, got {scene!r}; scatter writes one")
        displaced = displace_scene(
            loaded,
            edge_length=edge_length,
            resolution=resolution,
            creases=creases,
            progress=progress,
            **given(contact=contact, stiffness=stiffness, mapping=mapping),
        )
        displaced.save(output)
    print_path(output)
