"""``implicit-decals report``: the figures of an experiment in one HTML file."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from decals.apps.output import check_output
from decals.experiments import report as written


def report(
    folder: str, /, *, output: Annotated[str, Parameter(name=["--output", "-o"])] = "report.html"
) -> None:
    """Write a report of an experiment.

    Parameters
    ----------
    folder
        Folder of the results.
    output
        The HTML file.
    """
    check_output(Path(output), (".html", ".htm"))
    written(folder, output)
    Console().print(f"wrote {output}", highlight=False)
