"""``implicit-decals export``: a scene as a file of another program, and a check of such files."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from blobtree import field_grid
from blobtree.sampling.field_grid import GRID_FORMATS
from decals import Scene, TreeObject, save_html
from decals import export as export_scene
from decals.apps.commands.options import CreaseAngle, Inputs, Rules, Shown, Surfaces, Texture, given
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_model
from decals.apps.output import check_output, print_path
from decals.baking.formats import FORMATS
from decals.errors import InvalidInput
from decals.pages.page import SUFFIXES as PAGES
from decals.surfaces import MeshCheck, check_mesh
from decals.surfaces.mesh_file import read_objects

MESHES, GRIDS = tuple(FORMATS), tuple(GRID_FORMATS)
"""Ends of the names of files with meshes, and of files with values on a grid."""


def _named(suffixes: Iterable[str]) -> str:
    return ", ".join(suffix.removeprefix(".") for suffix in suffixes)


OUTPUT = (
    f"The file. Meshes are {_named(MESHES)}; a page in the browser is html; "
    f"the field of a BlobTree is {_named(GRIDS)}."
)
COLORS = (
    "Where the colours are. Default: a texture in files that end in "
    f"{_named(end for end in MESHES if 'texture' in FORMATS[end].colors[:1])}, else vertices."
)
INSTANCES = (
    "Write the decals as copies of a square, for programs with decals of their own "
    f"({_named(end for end in MESHES if FORMATS[end].instances)})."
)
DISTANCE = (
    f"Write signed distances in place of the field, below 0 inside, and print their error ({_named(GRIDS)})."
)
LABELS = {
    "vertices": "vertices",
    "faces": "faces",
    "parts": "connected parts",
    "borders": "edges of one face",
    "flipped": "flipped edges",
    "inward": "closed parts that wind inward",
    "degenerate": "degenerate faces",
    "copies": "copied faces",
    "branching": "edges of more than two faces",
    "pinched": "pinched vertices",
    "area": "area",
    "volume": "volume",
}
"""Rows of the table of checks."""


def export(
    scene: str,
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=("--output", "-o"), show_default=False, help=OUTPUT)
    ] = None,
    check: Annotated[bool, Parameter(negative=())] = False,
    colors: Annotated[
        Literal["texture", "vertices", "none"] | None, Parameter(show_default=False, help=COLORS)
    ] = None,
    attributes: Annotated[
        list[Literal["owner", "uv", "field", "stretch"]] | None,
        Parameter(name=("--attribute", "--attributes"), negative=(), show_default=False),
    ] = None,
    instances: Annotated[bool, Parameter(negative=(), help=INSTANCES)] = False,
    distance: Annotated[bool, Parameter(negative=(), help=DISTANCE)] = False,
    unit: Annotated[
        Literal["micron", "millimeter", "centimeter", "inch", "foot", "meter"] | None,
        Parameter(show_default=False),
    ] = None,
    up: Annotated[Literal["y", "z"] | None, Parameter(show_default=False)] = None,
    texture: Texture = Texture(),
    rules: Rules = Rules(),
    shown: Shown = Shown(),
    surfaces: Surfaces = Surfaces(),
    crease_angle: CreaseAngle = None,
    inputs: Inputs = Inputs(),
) -> None:
    """Write a scene as a file of another program, the field of a model on a grid, or check a mesh file.

    Parameters
    ----------
    scene
        A saved scene. Models that render takes are written without decals. With --check alone, a mesh file
        that can be read.
    check
        Print whether the mesh of each object is closed and sound.
    attributes
        Value at the vertices besides the colours. Can be repeated.
    unit
        Unit of the scene's lengths, for formats that have one.
    up
        The axis of the scene that points upward, for formats that have one.
    """
    if output is None:
        if not check:
            raise InvalidInput("export: missing -o FILE; or --check, to check a mesh file")
        _print_checks([check_mesh(*arrays, name) for name, arrays in read_objects(scene)])
        return
    check_output(output, (*MESHES, *GRIDS, *PAGES))
    of_page, of_drawing = given(**vars(shown)), rules.given()
    of_file = given(colors=colors, unit=unit, up=up, attributes=attributes, instances=instances or None)
    flags = {"check": check or None, "creases": surfaces.creases or None}
    _refuse_others(output, GRIDS, distance=distance or None)
    _refuse_others(output, PAGES, **of_page)
    _refuse_others(output, MESHES, **of_file, **flags, **texture.changed())
    _refuse_others(output, (*MESHES, *PAGES), **of_drawing, crease_angle=crease_angle, table=inputs.table)
    baked = texture.checked()
    checks: Sequence[MeshCheck] = ()
    error: float | None = None
    with preparing(inputs.define) as progress:
        loaded = load_model(scene, trust=inputs.trust, crease_angle=crease_angle, table=inputs.table)
        if output.suffix.lower() in GRIDS:
            tree = _only_tree(loaded, scene)
            grid = field_grid(tree.tree, resolution=surfaces.resolution, distance=distance, progress=progress)
            x, y, z = (np.array(grid.origin) + tree.origin).tolist()
            replace(grid, origin=(x, y, z)).save(output)
            error = grid.error
        elif output.suffix.lower() in PAGES:
            cells = surfaces.resolution
            save_html(loaded, output, resolution=cells, progress=progress, **of_page, **of_drawing)
        else:
            checks = export_scene(
                loaded,
                output,
                progress=progress,
                **baked,
                **vars(surfaces),
                **of_file,
                **of_drawing,
            )
    print_path(output)
    if error is not None:
        Console().print(f"distances are exact to {error:.2g}", highlight=False)
    if check:
        _print_checks(checks)


def _refuse_others(output: Path, suffixes: Sequence[str], **options: Any) -> None:
    """Raise `InvalidInput` if an option is given that is for outputs with other suffixes."""
    for name, value in options.items():
        if value is not None and output.suffix.lower() not in suffixes:
            raise InvalidInput(
                f"--{name.replace('_', '-')}: expected an output that ends in {' or '.join(suffixes)}, "
                f"got {str(output)!r}; leave it out, or rename the output"
            )


def _only_tree(loaded: object, name: str) -> TreeObject:
    """Return a BlobTree, or that of a scene with one visible object."""
    items = [item.shown for item in loaded.objects] if isinstance(loaded, Scene) else [loaded]
    shown = [item for item in items if item is not None]
    if len(shown) != 1 or not isinstance(shown[0], TreeObject):
        kinds = ", ".join(type(item).__name__ for item in shown) or "nothing"
        raise InvalidInput(
            f"expected a BlobTree, or a scene with one visible object that is one, got {kinds} in {name!r}; "
            "save the tree in a file of its own"
        )
    return shown[0]


def _print_checks(checks: Sequence[MeshCheck]) -> None:
    """Print a table with a column for each mesh."""
    table = Table(box=None)
    for name in ("", *(check.name for check in checks)):
        table.add_column(name, justify="right" if name else "left")
    table.add_row("closed", *("yes" if check.closed else "no" for check in checks))
    table.add_row("sound", *("yes" if check.sound else "no" for check in checks))
    for name, label in LABELS.items():
        values = [getattr(check, name) for check in checks]
        table.add_row(
            label, *(f"{value:,}" if isinstance(value, int) else f"{value:.4g}" for value in values)
        )
    Console().print(table, highlight=False, markup=False)
