"""Designs of experiments: lists of trials, each of which gives a function its parameters.

Designs are multiplied (all pairs), added (one after the other), zipped (one by one) and filtered.
`Sobol` and `LatinHypercube` fill a box evenly with few trials.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, overload

import numpy as np

from blobtree.validation import describe
from decals.errors import InvalidInput
from decals.validation import count_number, whole_number

Trial = dict[str, Any]
"""Parameters of one call, by name."""

Range = tuple[float, float] | tuple[float, float, str]
"""Lowest and highest value of a parameter; with the third value ``"log"`` their logarithms are filled."""


class Design(Sequence[Trial]):
    """A list of trials; `Grid`, `Seeds`, `Sobol` and `LatinHypercube` make one.

    Parameters
    ----------
    trials : iterable of mapping
        Parameters by name, for each call.

    Raises
    ------
    InvalidInput
        A trial is not a mapping of names to values.

    Examples
    --------
    >>> design = Grid(count=[100, 1000]) * Seeds(3)
    >>> len(design), design[0]
    (6, {'count': 100, 'seed': 0})
    """

    def __init__(self, trials: Iterable[Mapping[str, Any]]) -> None:
        self._trials = tuple(trials)
        for trial in self._trials:
            if not isinstance(trial, Mapping) or not all(isinstance(name, str) for name in trial):
                raise InvalidInput(
                    f"a trial of a design: expected a dict of parameters, got {describe(trial)}"
                )

    def __len__(self) -> int:
        return len(self._trials)

    @overload
    def __getitem__(self, which: int) -> Trial: ...
    @overload
    def __getitem__(self, which: slice) -> "Design": ...
    def __getitem__(self, which: int | slice) -> "Trial | Design":
        return Design(self._trials[which]) if isinstance(which, slice) else dict(self._trials[which])

    def __iter__(self) -> Iterator[Trial]:
        return map(dict, self._trials)

    def __mul__(self, other: "Design") -> "Design":
        """Return all pairs of trials, the last design's fastest."""
        return Design(_joined(first, second) for first, second in product(self, _design(other)))

    def __add__(self, other: "Design") -> "Design":
        """Return the trials of this design, then those of the other."""
        return Design([*self, *_design(other)])

    def __repr__(self) -> str:
        names = dict.fromkeys(name for trial in self._trials for name in trial)
        return f"{type(self).__name__}({len(self)} trials of {', '.join(names) or 'no parameters'})"

    def zip(self, other: "Design") -> "Design":
        """Return pairs of trials at the same place.

        Raises
        ------
        InvalidInput
            The designs differ in length, or share a parameter.

        Examples
        --------
        >>> list(Grid(radius=[0.1, 0.2]).zip(Grid(count=[400, 100])))
        [{'radius': 0.1, 'count': 400}, {'radius': 0.2, 'count': 100}]
        """
        if len(self) != len(_design(other)):
            raise InvalidInput(f"zip: expected a design of {len(self)} trials, got one of {len(other)}")
        return Design(map(_joined, self, other))

    def where(self, condition: Callable[..., object]) -> "Design":
        """Return the trials for which a function of their parameters is true.

        Parameters
        ----------
        condition : callable
            Takes all parameters of a trial by name.

        Examples
        --------
        >>> len(Grid(a=[1, 2, 3], b=[1, 2, 3]).where(lambda a, b: a < b))
        3
        """
        if not callable(condition):
            raise InvalidInput(f"where: expected a function of the parameters, got {describe(condition)}")
        try:
            return Design(trial for trial in self if condition(**trial))
        except TypeError as error:
            raise InvalidInput(f"where: the function does not take these parameters ({error})") from error


class Grid(Design):
    """All combinations of lists of values; the last list varies fastest.

    Parameters
    ----------
    **values : sequence
        Values of each parameter.

    Raises
    ------
    InvalidInput
        A parameter has no list of values.

    Examples
    --------
    >>> list(Grid(count=[10, 20], contact=["product", "elastic"]))[1]
    {'count': 10, 'contact': 'elastic'}
    """

    def __init__(self, /, **values: Iterable[Any]) -> None:
        for name, choices in values.items():
            if isinstance(choices, str | bytes | Mapping) or not isinstance(choices, Iterable):
                raise InvalidInput(
                    f"{name}: expected a list of values, got {describe(choices)}; write {name}=[{choices!r}]"
                )
        listed = [[_python(choice) for choice in choices] for choices in values.values()]
        super().__init__(dict(zip(values, chosen, strict=True)) for chosen in product(*listed))


class Seeds(Grid):
    """The seeds from `first` on, as a parameter called ``seed``.

    Parameters
    ----------
    count : int
        Number of seeds.
    first : int
        The first seed.

    Examples
    --------
    >>> list(Seeds(2, first=7))
    [{'seed': 7}, {'seed': 8}]
    """

    def __init__(self, count: int, first: int = 0) -> None:
        count, first = (
            count_number(*value, 0, None, InvalidInput) for value in (("count", count), ("first", first))
        )
        super().__init__(seed=range(first, first + count))


class Sobol(Design):
    """Trials at the points of a scrambled Sobol sequence in a box of parameters; `scipy.stats.qmc.Sobol`.

    Parameters
    ----------
    count : int
        Number of trials; powers of two are the most even.
    seed : int
        Seed of the scrambling.
    **ranges : (low, high) or (low, high, "log")
        Range of each parameter. Two whole numbers give whole numbers, both ends included.

    Raises
    ------
    InvalidInput
        A range is empty or not finite.

    Examples
    --------
    >>> design = Sobol(8, radius=(0.01, 1.0, "log"), count=(10, 99))
    >>> len(design), sorted(design[0])
    (8, ['count', 'radius'])
    """

    def __init__(self, count: int, /, seed: int = 0, **ranges: Range) -> None:
        super().__init__(_filled("Sobol", count, seed, ranges))


class LatinHypercube(Design):
    """Trials at the points of a Latin hypercube in a box of parameters; `scipy.stats.qmc.LatinHypercube`.

    Each parameter has one value in each of `count` equal parts of its range. The arguments are those of
    `Sobol`.

    Examples
    --------
    >>> sorted(int(trial["x"]) for trial in LatinHypercube(4, x=(0.0, 4.0)))
    [0, 1, 2, 3]
    """

    def __init__(self, count: int, /, seed: int = 0, **ranges: Range) -> None:
        super().__init__(_filled("LatinHypercube", count, seed, ranges))


def _filled(engine: str, count: int, seed: int, ranges: Mapping[str, Range]) -> Iterator[Trial]:
    """Yield trials at the points of a sequence of SciPy in a box."""
    from scipy.stats import qmc

    count = count_number("count", count, 1, None, InvalidInput)
    whole_number("seed", seed, 0, None, InvalidInput)
    scales = {name: _scale(name, limits) for name, limits in ranges.items()}
    if not scales:
        raise InvalidInput(f"{engine}: expected a range of at least one parameter, such as radius=(0.1, 0.5)")
    drawn = (
        1 << (count - 1).bit_length() if engine == "Sobol" else count
    )  # the sequence is even at such counts
    for row in getattr(qmc, engine)(len(scales), rng=seed).random(drawn)[:count]:
        yield {name: scale(float(share)) for (name, scale), share in zip(scales.items(), row, strict=True)}


def _scale(name: str, limits: Any) -> Callable[[float], float]:
    """Return the function from a share of a range, 0 to 1, to its value."""
    expected = f'{name}: expected (low, high) or (low, high, "log")'
    if not isinstance(limits, tuple | list) or len(limits) not in (2, 3):
        raise InvalidInput(f"{expected}, got {describe(limits)}")
    low, high = (_python(limit) for limit in limits[:2])
    logarithmic = len(limits) == 3
    numbers = all(isinstance(limit, int | float) and math.isfinite(limit) for limit in (low, high))
    if not numbers or low > high or (logarithmic and (limits[2] != "log" or low <= 0)):
        raise InvalidInput(
            f"{expected}, with finite numbers in rising order, above 0 for log, got {limits!r}"
        )
    whole = isinstance(low, int) and isinstance(high, int)
    end = high + 1 if whole else high

    def value(share: float) -> Any:
        inside = low * (end / low) ** share if logarithmic else low + share * (end - low)
        return min(max(math.floor(inside) if whole else inside, low), high)

    return value


def _joined(first: Trial, second: Trial) -> Trial:
    """Return the parameters of both trials, which share none."""
    if shared := sorted(first.keys() & second.keys()):
        raise InvalidInput(
            f"both designs have the parameter {', '.join(shared)}; rename one, or add the designs"
        )
    return first | second


def _design(value: object) -> Design:
    if not isinstance(value, Design):
        raise InvalidInput(f"expected a design, such as Grid(count=[10, 20]), got {describe(value)}")
    return value


def _python(value: Any) -> Any:
    """Return Python's own number for one of NumPy."""
    return value.item() if isinstance(value, np.generic) else value
