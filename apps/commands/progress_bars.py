"""Progress bars on stderr, one per stage."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from blobtree import Progress as Report
from blobtree.kernels import compilation_displayed

PREPARING = "Preparing the surfaces"
"""Stage in which surfaces are built."""

_COLUMNS = (TextColumn("{task.description:<34}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))


@contextmanager
def progress_bars() -> Iterator[Report]:
    """Show a bar with the elapsed time for each stage that the callback reports.

    A new stage completes the bar of the previous one. Another bar appears if kernels must be compiled. After
    an error or an interrupt the bars disappear, so only the message remains.

    Examples
    --------
    >>> with progress_bars() as progress:
    ...     progress("Drawing", 0.5)
    """
    with Progress(*_COLUMNS, TimeElapsedColumn(), console=Console(stderr=True)) as bars:
        stages: dict[str, TaskID] = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in stages:
                for task in stages.values():
                    bars.update(task, completed=1.0)
                stages[stage] = bars.add_task(stage[:1].upper() + stage[1:], total=1.0)
            bars.update(stages[stage], completed=min(max(fraction, 0.0), 1.0))

        compiling: list[TaskID] = []

        def report_compilation(done: int, total: int) -> None:
            if not compiling:
                compiling.append(bars.add_task(""))
            description = f"Compiling kernels for this machine (once): {done} of {total}"
            bars.update(compiling[0], description=description, completed=done, total=total)

        try:
            with compilation_displayed(report_compilation):
                yield report
        except BaseException:
            bars.live.transient = True
            bars.console.quiet = not bars.console.is_interactive  # avoid an empty line in a redirected stderr
            raise
        for task in stages.values():
            bars.update(task, completed=1.0)
