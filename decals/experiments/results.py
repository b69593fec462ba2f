"""`Results`: the rows of an experiment's folder, as lists and as frames of pandas or polars."""

import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from blobtree.validation import describe
from decals.errors import InvalidInput
from decals.experiments.outcome import COLUMNS, Row
from decals.experiments.store import described, rows_in
from decals.validation import optional_package


class Results:
    """The latest row of each trial in the folder of an experiment; it can be read while a run goes on.

    Parameters
    ----------
    folder : path
        Folder of the results.

    Attributes
    ----------
    name : str
        Name of the function.
    function : str
        Digest of the function.
    parameters : list of str
        Names of the parameters.

    Raises
    ------
    InvalidInput
        The folder holds no experiment, or one of a newer version.

    Examples
    --------
    >>> results = run(lambda x: {"square": x * x}, Grid(x=[1, 2, 3]), "squares", workers=0)
    >>> results.measures, [row["square"] for row in results.rows]
    (['square'], [1, 4, 9])
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder).resolve()
        about = described(self.folder)
        self.name, self.function, self.parameters = about["name"], about["function"], about["parameters"]

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        failed = sum(row["status"] != "done" for row in self.rows)
        return f"Results({self.name}: {len(self)} rows, {failed} failed)"

    @cached_property
    def rows(self) -> list[Row]:
        """Rows as dicts, sorted by their parameters; of a changed function those that it has given so far."""
        latest: dict[str, Row] = {}
        for row in rows_in(self.folder):
            known = latest.get(row["trial"])
            if known is None or self._is_current(row) or not self._is_current(known):
                latest[row["trial"]] = row
        return sorted(latest.values(), key=lambda row: [_rank(row.get(name)) for name in self.parameters])

    def _is_current(self, row: Row) -> bool:
        return bool(row.get("function") == self.function)

    @cached_property
    def measures(self) -> list[str]:
        """Names of what the function returned."""
        names = dict.fromkeys(name for row in self.rows for name in row)
        return [name for name in names if name not in (*self.parameters, *COLUMNS)]

    @property
    def numbers(self) -> list[str]:
        """Names of the measures that are numbers."""
        return [
            name for name in self.measures if any(isinstance(row.get(name), int | float) for row in self.rows)
        ]

    @property
    def failed(self) -> list[Row]:
        """Rows of trials that ended with an error."""
        return [row for row in self.rows if row["status"] != "done"]

    def to_pandas(self) -> Any:
        """Return the rows as a `pandas.DataFrame`.

        Raises
        ------
        MissingPackage
            Pandas is not installed.
        """
        pandas = optional_package("pandas", "experiments")
        return pandas.DataFrame(self.rows, columns=self._columns)

    def to_polars(self) -> Any:
        """Return the rows as a `polars.DataFrame`.

        Raises
        ------
        MissingPackage
            Polars is not installed.
        """
        polars = optional_package("polars", "experiments")
        columns = {name: [row.get(name) for row in self.rows] for name in self._columns}
        return polars.DataFrame(
            {name: polars.Series(name, values, strict=False) for name, values in columns.items()}
        )

    @property
    def _columns(self) -> list[str]:
        return [*self.parameters, *self.measures, *COLUMNS]

    def interval(
        self, measure: str, by: Sequence[str] = (), *, confidence: float = 0.95, seed: int = 0
    ) -> list[dict[str, Any]]:
        """Return the mean of a measure for each value of some parameters, with bootstrap intervals.

        Rows without a finite number are left out and counted.

        Parameters
        ----------
        measure : str
            Name of the measure.
        by : sequence of str
            Names of the parameters; the others are averaged over.
        confidence : float
            Share of the bootstrap means inside the interval (percentile method; Efron and Tibshirani 1993,
            chapter 13).
        seed : int
            Seed of the bootstrap.

        Returns
        -------
        list of dict
            The parameters in rising order, ``mean``, ``low``, ``high``, ``trials`` and ``left_out``.

        Raises
        ------
        InvalidInput
            There is no such measure or parameter.

        Examples
        --------
        >>> results = run(lambda x, seed: x + seed, Grid(x=[1, 5]) * Seeds(9), "sums", workers=0)
        >>> [(group["x"], group["mean"]) for group in results.interval("result", by=["x"])]
        [(1, 5.0), (5, 9.0)]
        """
        by = [by] if isinstance(by, str) else list(by)
        for name in (measure, *by):
            if name not in self._columns:
                raise InvalidInput(f"expected one of {', '.join(self._columns)}, got {describe(name)}")
        groups: dict[tuple[Any, ...], list[Any]] = {}
        for row in self.rows:
            groups.setdefault(tuple(_hashable(row.get(name)) for name in by), []).append(row.get(measure))
        if clash := sorted(set(by) & set(SUMMARY)):
            raise InvalidInput(f"parameter {clash[0]!r}: the name of a column of the summary; rename it")
        return [
            dict(zip(by, key, strict=True)) | _summary(groups[key], confidence, seed)
            for key in sorted(groups, key=lambda key: [_rank(value) for value in key])
        ]


LARGEST = float(np.finfo(np.float64).max)

SUMMARY = ("mean", "low", "high", "trials", "left_out")
"""Columns of a summary beside parameters."""

RESAMPLES = 2000
"""Bootstrap samples of an interval."""


def _summary(values: list[Any], confidence: float, seed: int) -> dict[str, Any]:
    """Return the mean of the finite numbers among some values, and its bootstrap interval."""
    finite = [value for value in values if isinstance(value, int | float) and abs(value) <= LARGEST]
    numbers = np.array(finite, np.float64)
    left_out = len(values) - len(numbers)
    if not len(numbers):
        return dict(zip(SUMMARY, (np.nan, np.nan, np.nan, 0, left_out), strict=True))
    drawn = np.random.default_rng(seed).integers(len(numbers), size=(RESAMPLES, len(numbers)))
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(numbers[drawn].mean(axis=1), [tail, 100.0 - tail])
    found = (float(numbers.mean()), float(low), float(high), len(numbers), left_out)
    return dict(zip(SUMMARY, found, strict=True))


def _rank(value: Any) -> tuple[str, Any]:
    """Return a key that sorts values of several types."""
    if isinstance(value, bool | int | float) and value == value:
        return "", value
    return type(value).__name__, str(value)


def _hashable(value: Any) -> Any:
    if isinstance(value, list | dict):
        return str(value)
    return value if value == value else np.nan  # one NaN, which groups find again
