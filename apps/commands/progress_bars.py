"""Progress callbacks as bars on stderr, one per stage."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from blobtree import Progress as Report

FINDING = "Finding the surfaces"
"""Stage in which models become surfaces, and the first time kernels are compiled."""

_COLUMNS = (TextColumn("{task.description:<34}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))


@contextmanager
def progress_bars() -> Iterator[Report]:
    """Show the stages that the callback is told of, each with a bar and its time.

    A stage that follows another completes it, so nobody need report the last percent. Where the work fails
    or is interrupted the bars go, and what went wrong is all that is left to read.

    Examples
    --------
    >>> with progress_bars() as progress:
    ...     progress("Counting sheep", 0.5)
    """
    with Progress(*_COLUMNS, TimeElapsedColumn(), console=Console(stderr=True)) as bars:
        stages: dict[str, TaskID] = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in stages:
                for task in stages.values():
                    bars.update(task, completed=1.0)
                stages[stage] = bars.add_task(stage[:1].upper() + stage[1:], total=1.0)
            bars.update(stages[stage], completed=min(max(fraction, 0.0), 1.0))

        try:
            yield report
        except BaseException:
            bars.live.transient = True
            bars.console.quiet = not bars.console.is_interactive  # or it ends with an empty line in a file
            raise
        for task in stages.values():
            bars.update(task, completed=1.0)
