"""`run`: all trials of a design, in processes, with rows that a later run goes on from."""

import inspect
import json
import math
import os
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec

from blobtree.progress import Cancel, Progress, reporting
from blobtree.validation import describe
from decals.errors import InvalidInput
from decals.experiments.design import Design, Trial
from decals.experiments.fingerprint import fingerprint, trial_hash
from decals.experiments.outcome import COLUMNS, Row
from decals.experiments.results import Results
from decals.experiments.store import Store, rows_in
from decals.experiments.values import light
from decals.experiments.workers import Rows, Started, Work, cluster, connected, here, processes
from decals.scenes.recipe import plain
from decals.validation import allowed_number, count_number

CONVERTED = (bool, int, float, str)
"""Types of parameters to which values of a design are converted."""

MEMORY_SHARE = 0.9
"""Share of the machine's memory that all workers together may use."""


def run(
    function: Callable[..., Any],
    design: Design,
    out: str | os.PathLike[str] = "results",
    *,
    workers: int | None = None,
    scheduler: Any = None,
    limit: float | None = None,
    memory: float | None = None,
    retry: bool = False,
    on_row: Callable[[Row], object] | None = None,
    progress: Progress | None = None,
    cancel: Cancel | None = None,
) -> Results:
    """Call a function for each trial of a design, and keep the results in a folder.

    A run that was interrupted goes on where it ended: trials that have a row are left out. A change of the
    function, or of a function of yours that it calls, runs them again. An error of a trial is a row as well.

    Parameters
    ----------
    function : callable
        Takes the parameters of a trial by name. It returns a number, or a mapping or dataclass of measures:
        numbers, texts, and pictures, scenes, trees, decals, arrays and meshes, which become files.
    design : Design
        The trials.
    out : path
        Folder of the results.
    workers : int, optional
        Local processes, one core each; 0 runs all trials in this process. Default: one for each core.
    scheduler : str or dask.distributed.Client, optional
        Dask scheduler, such as ``"tcp://10.0.0.1:8786"``, or a client; its workers run the trials.
    limit : float, optional
        Seconds after which a trial is ended, and its row says so; in processes and on a cluster only.
    memory : float, optional
        Gigabytes of a local worker, after which its trial is ended. Default: an equal share of 90 % of the
        machine's memory.
    retry : bool, optional
        Run failed trials again.
    on_row : callable, optional
        Receives each new row.
    progress, cancel : callable, optional
        See `blobtree.progress`.

    Returns
    -------
    Results
        The results of the folder.

    Raises
    ------
    InvalidInput
        The design does not fit the function, the function cannot be pickled, the folder holds another
        experiment or is in use, or the cluster cannot be used.
    UnusableFile
        The folder cannot be written.

    See Also
    --------
    Results, Grid

    Examples
    --------
    >>> def area(radius: float) -> float:
    ...     return 3.14159 * radius**2
    >>> results = run(area, Grid(radius=[1, 2]), "circles", workers=0)
    >>> [row["result"] for row in results.rows]
    [3.14159, 12.56636]
    """
    folder = Path(out).resolve()
    digest = fingerprint(function)
    trials = {trial_hash(trial): trial for trial in fitted(function, design)}
    about = {"name": getattr(function, "__qualname__", describe(function)), "function": digest}
    about["parameters"] = sorted({name for trial in trials.values() for name in trial})
    count = (
        os.cpu_count() or 1 if workers is None else count_number("workers", workers, 0, None, InvalidInput)
    )
    if scheduler is not None and workers is not None:
        raise InvalidInput("workers: expected none beside a scheduler, which has workers; drop one")
    if limit is not None:
        if count == 0:
            raise InvalidInput("limit: expected processes that can be ended, got workers=0; drop one")
        allowed_number("limit", limit, "seconds above 0", lambda value: value > 0, InvalidInput)
    megabytes = _megabytes(memory, max(1, count))
    with Store(folder, about) as store, reporting(progress, cancel) as report:
        known = {row["trial"]: row for row in rows_in(folder) if row.get("function") == digest}
        todo = [key for key in trials if key not in known or (retry and known[key]["status"] != "done")]
        rows = [_first_columns(key, digest, trials[key]) for key in todo]
        work = Work(function, folder, limit, megabytes)
        chosen = [trials[key] for key in todo]
        started = Started(lambda number: store.begin(rows[number]), store.interrupted(rows))
        with _executor(work, chosen, count, scheduler, started) as ended:
            report("running trials", 0.0)
            for done, (number, row) in enumerate(ended, 1):
                store.add(whole := rows[number] | row)
                if on_row is not None:
                    on_row(whole)
                report(f"running trials: {done} of {len(todo)}", done / len(todo))
    return Results(folder)


@contextmanager
def _executor(
    work: Work, trials: list[Trial], workers: int, scheduler: Any, started: Started
) -> Iterator[Rows]:
    """Yield the rows of trials, by the executor that the caller chose."""
    with ExitStack() as stack:
        if scheduler is not None and trials:
            client = stack.enter_context(connected(scheduler))
            rows = cluster(work, [light(trial, work.folder) for trial in trials], client)
        elif workers:
            rows = processes(work, [light(trial, work.folder) for trial in trials], workers)
        else:
            rows = here(work, trials, started)
        yield stack.enter_context(closing(rows))


def _first_columns(key: str, digest: str, trial: Trial) -> Row:
    """Return the columns of a row that are known before its trial runs."""
    values = {
        name: value if isinstance(value, float) else plain(value)  # also inf and nan
        for name, value in trial.items()
    }
    texts = {name: json.dumps(value) for name, value in values.items() if isinstance(value, Mapping)}
    return {"trial": key, "function": digest, **values, **texts}


def fitted(function: Callable[..., Any], design: Design) -> Iterator[Trial]:
    """Yield the trials of a design with values of the types that the function declares."""
    if not callable(function):
        raise InvalidInput(f"function: expected a function of the parameters, got {describe(function)}")
    if not isinstance(design, Design):
        raise InvalidInput(f"design: expected a design, such as Grid(count=[10, 20]), got {describe(design)}")
    signature = inspect.signature(function)
    types = _declared_types(function)
    for trial in design:
        if reserved := sorted(trial.keys() & set(COLUMNS)):
            raise InvalidInput(f"parameter {reserved[0]!r}: the name of a column of every row; rename it")
        try:
            signature.bind(**trial)
        except TypeError as error:
            raise InvalidInput(
                f"the design gives {', '.join(trial) or 'no parameters'}, but the function takes {signature} "
                f"({error})"
            ) from None
        yield {name: _converted(name, value, types.get(name)) for name, value in trial.items()}


def _declared_types(function: Callable[..., Any]) -> dict[str, Any]:
    try:
        return typing.get_type_hints(function)
    except Exception:  # of names that the user's annotations do not find
        return {}


def _converted(name: str, value: Any, kind: Any) -> Any:
    """Return a value as the type that a function declares: 1e3 is a count, 1 is a length."""
    if typing.get_origin(kind) is typing.Literal and value not in (choices := typing.get_args(kind)):
        raise InvalidInput(
            f"parameter {name!r}: expected one of {', '.join(map(repr, choices))}, got {value!r}"
        )
    if kind not in CONVERTED or isinstance(value, kind):
        return value
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        raise InvalidInput(f"parameter {name!r}: expected {kind.__name__}, got {value!r} ({error})") from None


def _megabytes(gigabytes: float | None, workers: int) -> float:
    """Return the memory of one worker."""
    if gigabytes is not None:
        return 1024.0 * allowed_number(
            "memory", gigabytes, "gigabytes above 0", lambda value: value > 0, InvalidInput
        )
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
    except (AttributeError, ValueError, OSError):
        return math.inf
    return MEMORY_SHARE * total / workers
