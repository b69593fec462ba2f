"""``implicit-decals bake``: a scene as a GLB file for other programs."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from decals import bake as bake_scene
from decals.apps.commands.options import (
    MAX_SAMPLES,
    ContactName,
    CreaseAngle,
    Definitions,
    LayoutName,
    MappingName,
    OptionalWhole,
    Stiffness,
    TableFile,
    Trust,
    Whole,
    check_count,
    given,
)
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_model
from decals.apps.output import check_output, print_path


def bake(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    size: Whole = 2048,
    samples: Whole = 2,
    layout: LayoutName = "auto",
    tiles: Whole = 1,
    vertex_colors: Annotated[bool, Parameter(negative=())] = False,
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
    """Write a scene as a GLB file, with the decals in a texture or in vertex colours.

    Parameters
    ----------
    scene
        A saved scene. Models that render takes are written without decals.
    output
        The file: glb.
    size
        Width and height of the texture in texels, from 16 to 8192.
    samples
        Samples per texel along each axis: 1 is fast, 2 smooth, 4 fine.
    layout
        How surfaces lie on the texture: box, xatlas, own (texture coordinates of the meshes), or auto, the
        one with the shortest seams.
    tiles
        Textures of that size over which the surfaces are spread, as UDIM tiles (glb, gltf, obj).
    vertex_colors
        Write colours at the vertices instead of a texture.
    contact
        Contact mode, as for render.
    stiffness
        Stiffness of elastic contact, as for render.
    mapping
        Image mapping, as for render.
    resolution
        Cells along the longest side of each implicit object. Default: 64.
    creases
        Keep the edges that unions, intersections and differences leave.
    """
    check_output(output, (".glb",))
    check_count("--samples", samples, 1, MAX_SAMPLES)
    with preparing(define) as progress:
        loaded = load_model(scene, trust=trust, crease_angle=crease_angle, table=table)
        bake_scene(
            loaded,
            output,
            size=size,
            samples=samples,
            layout=layout,
            tiles=tiles,
            vertex_colors=vertex_colors,
            resolution=resolution,
            creases=creases,
            progress=progress,
            **given(contact=contact, stiffness=stiffness, mapping=mapping),
        )
    print_path(output)
