"""``implicit-decals report``: an experiment as a page, or one figure or table of it."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from decals.apps.output import check_output
from decals.experiments import report as written
from decals.experiments.report import WRITERS


def report(
    folder: str,
    /,
    *,
    output: Annotated[str, Parameter(name=["--output", "-o"])] = "report.html",
    measure: str | None = None,
    by: Annotated[str, Parameter(show_default=False)] = "",
) -> None:
    """Write a report of an experiment.

    Parameters
    ----------
    folder
        Folder of the results.
    output
        The file: html for all figures, svg, pdf or png for one figure, md for means, csv for all rows.
    measure
        The measure of the figure or of the means.
    by
        Parameters, separated by commas: axis and lines of the figure, or first columns of the means.
    """
    check_output(Path(output), tuple(WRITERS))
    written(folder, output, measure=measure, by=[name.strip() for name in by.split(",") if name.strip()])
    Console().print(f"wrote {output}", highlight=False)
