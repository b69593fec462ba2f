"""Progress of commands on stderr: a bar for each stage in a terminal, else lines."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from blobtree import Progress as Report
from blobtree.progress import reporting
from decals.apps.models.loading import import_definitions

PREPARING = "preparing the surfaces"
"""Stage in which surfaces are built."""

_COLUMNS = (TextColumn("{task.description:<34}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))


@contextmanager
def progress_bars() -> Iterator[Report]:
    """Show the reports of the callback, and of all work in the ``with`` block.

    In a terminal, each stage has a bar with the elapsed time, and a new stage completes the bars of previous
    ones. After an error or an interrupt the bars disappear, so only the message remains. Elsewhere, work
    that takes long writes lines; see `blobtree.progress`.

    Examples
    --------
    >>> with progress_bars() as progress:
    ...     progress("drawing", 0.5)
    """
    console = Console(stderr=True)
    if not console.is_interactive:
        with reporting() as report:
            yield report
        return
    with Progress(*_COLUMNS, TimeElapsedColumn(), console=console) as bars:
        stages = _Stages(bars)
        try:
            with reporting(stages.show) as report:
                yield report
        except BaseException:
            bars.live.transient = True
            raise
        stages.complete()


@contextmanager
def preparing(define: list[str] | None) -> Iterator[Report]:
    """Import the definitions of custom nodes, then show progress that begins with the preparation."""
    import_definitions(define)
    with progress_bars() as progress:
        progress(PREPARING, 0.0)
        yield progress


class _Stages:
    """One bar for each stage."""

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def show(self, stage: str, fraction: float) -> None:
        """Show a report; what follows a colon in the name of a stage may change."""
        name = stage.partition(":")[0]
        if name not in self._tasks:
            self.complete()
            self._tasks[name] = self._bars.add_task("", total=1.0)
        description = stage[:1].upper() + stage[1:]
        self._bars.update(self._tasks[name], completed=min(max(fraction, 0.0), 1.0), description=description)

    def complete(self) -> None:
        """Complete all bars."""
        for task in self._tasks.values():
            self._bars.update(task, completed=1.0)
