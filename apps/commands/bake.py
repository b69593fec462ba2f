"""``implicit-decals bake``: a scene as a GLB file for other programs."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from decals import bake as bake_scene
from decals.apps.commands.options import CreaseAngle, Inputs, Rules, Surfaces, Texture
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_model
from decals.apps.output import check_output, print_path


def bake(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    texture: Texture = Texture(),
    vertex_colors: Annotated[bool, Parameter(negative=())] = False,
    rules: Rules = Rules(),
    surfaces: Surfaces = Surfaces(),
    crease_angle: CreaseAngle = None,
    inputs: Inputs = Inputs(),
) -> None:
    """Write a scene as a GLB file, with the decals in a texture or in vertex colours.

    Parameters
    ----------
    scene
        A saved scene. Models that render takes are written without decals.
    output
        The file: glb.
    vertex_colors
        Write colours at the vertices instead of a texture.
    """
    check_output(output, (".glb",))
    with preparing(inputs.define) as progress:
        loaded = load_model(scene, trust=inputs.trust, crease_angle=crease_angle, table=inputs.table)
        bake_scene(
            loaded,
            output,
            vertex_colors=vertex_colors,
            progress=progress,
            **texture.checked(),
            **vars(surfaces),
            **rules.given(),
        )
    print_path(output)
