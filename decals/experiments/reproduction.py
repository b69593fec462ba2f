"""Results of an experiment made again in another folder, and what differs."""

import json
import os
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

from blobtree.progress import Progress
from decals.errors import InvalidInput
from decals.experiments.design import Design, Trial
from decals.experiments.experiment import fitted, run
from decals.experiments.fingerprint import fingerprint, trial_hash
from decals.experiments.outcome import Row
from decals.experiments.results import Results
from decals.model import Decals
from decals.scenes.provenance import differences
from decals.scenes.reproduction import Reproduction

MOST_LINES = 20
"""Most lines about rows that differ."""


def reproduce_results(
    folder: str | os.PathLike[str],
    function: Callable[..., Any] | None = None,
    *,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Run the trials of an experiment again, and compare what they return.

    Times, peak memory and circumstances may differ. Files that trials made are compared by their content.

    Parameters
    ----------
    folder : path
        Folder of the results.
    function : callable, optional
        The function of the experiment, which results name by a digest alone.
    workers : int, optional
        As for `run`.
    progress : callable, optional
        Called with a stage and the fraction done.

    Returns
    -------
    Reproduction
        What is missing, or how the rows differ.

    Raises
    ------
    InvalidInput
        The folder holds no experiment, or one of a newer version.

    Examples
    --------
    >>> def area(radius: float) -> float:
    ...     return 3.14159 * radius**2
    >>> results = run(area, Grid(radius=[1, 2]), "circles", workers=0)
    >>> reproduce_results("circles", area, workers=0).equal
    True
    """
    before = Results(folder)
    if function is None:
        return Reproduction((f"the function {before.name!r}: a folder of results has its digest alone",))
    if fingerprint(function) != before.function:
        return Reproduction((f"the function {before.name!r} as it was: it has changed since",))
    rows = [row for row in before.rows if row.get("function") == before.function]
    trials = [_trial(function, row, before.parameters) for row in rows]
    known = [trial for trial in trials if trial is not None]
    if lost := len(trials) - len(known):
        return Reproduction((f"parameters of {lost:,} rows, which are no plain values",))
    with tempfile.TemporaryDirectory() as other:
        after = run(function, Design(known), other, workers=workers, progress=progress)
        made = {row["trial"]: row for row in after.rows}
    names = ["status", *before.measures]
    lines = [line for row in rows for line in _changes(row, made[row["trial"]], names, before)]
    if len(lines) > MOST_LINES:
        lines[MOST_LINES:] = [f"and {len(lines) - MOST_LINES:,} more"]
    circumstances = dict.fromkeys(
        line for row in rows for line in differences(*map(_provenance, (row, made[row["trial"]])))
    )
    return Reproduction((), Decals.empty(), tuple(lines), tuple(circumstances))


def _trial(function: Callable[..., Any], row: Row, names: list[str]) -> Trial | None:
    """Return the parameters of a row; None if they are not those that its trial had."""
    every = {name: row.get(name) for name in names}
    given = {name: value for name, value in every.items() if value is not None}
    for values in (every, given):
        try:
            (trial,) = fitted(function, Design([values]))
        except InvalidInput:  # parameters that the trial did not have
            continue
        if trial_hash(trial) == row["trial"]:
            return trial
    return None


def _changes(before: Row, after: Row, names: list[str], results: Results) -> Iterator[str]:
    """Yield a line for each measure that differs."""
    place = ", ".join(f"{name} = {before.get(name)}" for name in results.parameters)
    for name in names:
        old, new = before.get(name), after.get(name)
        if json.dumps(old) != json.dumps(new):  # NaN is equal to NaN
            yield f"{place}: {name} is {old} in the folder, {new} made again"


def _provenance(row: Row) -> dict[str, Any]:
    """Return the provenance of a row; nothing for a damaged one."""
    try:
        record = json.loads(row.get("provenance") or "{}")
    except (TypeError, ValueError):
        record = None
    return record if isinstance(record, dict) else {}
