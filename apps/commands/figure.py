"""``implicit-decals figure``: a scene as lines in SVG or PDF."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from decals import Scene, save_figure
from decals.apps.commands.options import Inputs, Rules, given
from decals.apps.commands.progress_bars import preparing
from decals.apps.models.loading import load_models
from decals.apps.output import check_output, print_path
from decals.errors import InvalidInput
from decals.scenes.figure import SUFFIXES, WIDTHS

Width = Annotated[float | None, Parameter(show_default=False)]


def figure(
    scene: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=("--output", "-o"))],
    width: float = 360.0,
    height: float = 270.0,
    contact_width: Width = None,
    rim_width: Width = None,
    model_width: Width = None,
    picture: Annotated[bool, Parameter(negative=())] = False,
    step: float = 0.05,
    rules: Rules = Rules(),
    inputs: Inputs = Inputs(),
) -> None:
    """Write the contact lines and rims of a saved scene, and the edges of its models, without hidden lines.

    Parameters
    ----------
    scene
        A saved scene in JSON, or a model with --table.
    output
        The output file: svg, or pdf, which needs the extra `experiments`.
    width
        Width of the figure in points, of which 72 are an inch.
    height
        Height of the figure in points.
    contact_width
        Width of contact lines in points; 0 leaves them out. Default: 0.8.
    rim_width
        Width of rims in points, likewise. Default: 0.5.
    model_width
        Width of silhouettes, creases and boundaries in points, likewise. Default: 0.35.
    picture
        Draw the rendered picture behind the lines.
    step
        Greatest distance of points of a line, in visible radii.
    """
    check_output(output, SUFFIXES)
    widths = given(contact=contact_width, rim=rim_width, model=model_width)
    with preparing(inputs.define) as progress:
        loaded = load_models([scene], trust=inputs.trust, table=inputs.table)
        if not isinstance(loaded, Scene):
            raise InvalidInput(f"expected a saved scene in JSON, got the model {scene!r}; give --table too")
        save_figure(
            loaded,
            output,
            size=(width, height),
            widths=WIDTHS | widths,
            picture=picture,
            step=step,
            progress=progress,
            **rules.given(),
        )
    print_path(output)
