"""``implicit-decals displace``: the surface of a scene, moved by the heights of its decals, as a mesh."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from blobtree.pyvista_views import MESH_SUFFIXES
from decals import Scene
from decals import displace as displace_scene
from decals.apps.commands.options import CreaseAngle, Inputs, Rules, Surfaces
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
    rules: Rules = Rules(),
    surfaces: Surfaces = Surfaces(),
    crease_angle: CreaseAngle = None,
    inputs: Inputs = Inputs(),
) -> None:
    """Write the surface of a scene, moved by the heights of its decals, as a triangle mesh.

    Parameters
    ----------
    scene
        A saved scene, of which some decals have materials with relief.
    output
        The mesh file: glb or ply (with colours), vtp (with colours and normals), obj or stl.
    edge_length
        Greatest length of an edge below a decal with relief, in the model's units; triangles with longer ones
        are divided. Default: a sixteenth of the decal's radius.
    """
    check_output(output, (".glb", *MESH_SUFFIXES))
    with preparing(inputs.define) as progress:
        loaded = load_model(scene, trust=inputs.trust, crease_angle=crease_angle, table=inputs.table)
        if not isinstance(loaded, Scene):
            raise InvalidInput(f"expected a saved scene with decals, got {scene!r}; scatter writes one")
        displaced = displace_scene(
            loaded,
            edge_length=edge_length,
            progress=progress,
            **vars(surfaces),
            **rules.given(),
        )
        displaced.save(output)
    print_path(output)
