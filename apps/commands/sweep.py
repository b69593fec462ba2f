"""``implicit-decals sweep``: an experiment from a file, or a shipped one, with a table that fills."""

import time
from collections import Counter, deque
from collections.abc import Callable
from importlib import import_module
from textwrap import shorten
from typing import Annotated, Any

from cyclopts import Parameter
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from decals.apps import experiments as shipped
from decals.apps.models.loading import import_module_or_file
from decals.apps.output import print_names
from decals.errors import InvalidInput
from decals.experiments import Design, run
from decals.experiments.outcome import COLUMNS, Row

LATEST, WIDTH = 8, 28
"""Rows that the table shows, and most characters of a cell."""


def sweep(
    experiment: str | None = None,
    /,
    *,
    out: Annotated[str, Parameter(name=["--out", "-o"])] = "results",
    full: Annotated[bool, Parameter(negative=())] = False,
    workers: int | None = None,
    scheduler: str | None = None,
    limit: float | None = None,
    memory: float | None = None,
    retry: Annotated[bool, Parameter(negative=())] = False,
    list_: Annotated[bool, Parameter(name="--list", negative=())] = False,
) -> int:
    """Run all trials of an experiment that have no result yet.

    Parameters
    ----------
    experiment
        A Python file with a function `experiment` and a design `design`, or the name of a shipped experiment.
    out
        Folder of the results.
    full
        Use the larger design `full`.
    workers
        Local processes; 0 runs in this one. Default: one for each core.
    scheduler
        Address of a Dask scheduler.
    limit
        Seconds after which a trial is ended.
    memory
        Gigabytes of a local process after which its trial is ended.
    retry
        Run failed trials again.
    list_
        List the shipped experiments.
    """
    if list_:
        print_names({name: shipped.title(name) for name in shipped.SHIPPED})
        return 0
    if experiment is None:
        raise InvalidInput("expected a Python file or the name of a shipped experiment; --list shows these")
    function, design = experiment_of(experiment, "full" if full else "design")
    console = Console(stderr=True)
    options: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "limit": limit, "memory": memory}
    if console.is_interactive:
        table = _Table()
        options |= {"progress": table.advance, "on_row": table.add}
        with Live(table, console=console, refresh_per_second=4):
            results = run(function, design, out, retry=retry, **options)
    else:
        results = run(function, design, out, retry=retry, **options)
    Console().print(f"{results} in {results.folder}", highlight=False, soft_wrap=True)
    errors = Counter(str(row["error"]) for row in results.failed)
    for error, count in errors.most_common(LATEST):
        console.print(Text(f"{count} trial{'s' * (count > 1)}: {error}"), soft_wrap=True)
    return 1 if results.failed else 0


def experiment_of(experiment: str, chosen: str) -> tuple[Callable[..., Any], Design]:
    """Return the function of an experiment, and one of its designs."""
    if experiment in shipped.SHIPPED:
        module = import_module(f"{shipped.__name__}.{experiment}")
    else:
        module = import_module_or_file("sweep", experiment)
        _send_by_value(module)
    function, design = getattr(module, "experiment", None), getattr(module, chosen, None)
    if not callable(function) or not isinstance(design, Design):
        expected = f"a function `experiment` and a design `{chosen}`, such as Grid(count=[10])"
        raise InvalidInput(f"{experiment}: expected {expected}")
    return function, design


def _send_by_value(module: Any) -> None:
    """Let workers read functions of a file that they cannot import."""
    try:
        import cloudpickle
    except ImportError:
        return
    cloudpickle.register_pickle_by_value(module)


class _Table:
    """The latest rows, how many trials ended how, and the time left."""

    def __init__(self) -> None:
        self._latest: deque[Row] = deque(maxlen=LATEST)
        self._counts: Counter[str] = Counter()
        self._began = time.monotonic()
        self._left = ""

    def advance(self, _stage: str, done: float) -> None:
        """Estimate the time left from the share that is done."""
        self._left = ""
        if 0.0 < done < 1.0:
            seconds = (time.monotonic() - self._began) * (1.0 - done) / done
            left = f"{seconds / 60:.0f} min" if seconds > 90 else f"{seconds:.0f} s"
            self._left = f", {done:.0%}, {left} left"

    def add(self, row: Row) -> None:
        """Show a row."""
        self._latest.append(row)
        self._counts[row["status"]] += 1

    def __rich__(self) -> Group:
        """Return what the terminal shows."""
        hidden = set(COLUMNS) - {"status", "error", "seconds"}
        names = list(dict.fromkeys(name for row in self._latest for name in row if name not in hidden))
        table = Table(box=None)
        for name in names:
            table.add_column(Text(name))
        for row in self._latest:
            table.add_row(*(Text(_cell(row.get(name))) for name in names))
        counts = ", ".join(f"{count} {status}" for status, count in self._counts.items())
        return Group(table, f"{counts}{self._left}")


def _cell(value: Any) -> str:
    """Return the text of a value, shortened."""
    if value is None:
        return ""
    return shorten(f"{value:.4g}" if isinstance(value, float) else str(value), WIDTH, placeholder="…")
