"""Trials of a definition: many samples in double precision, before anything is compiled.

They cannot prove what a definition claims, but a function that is wrong seldom passes.
"""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.own.parameters import Parameter
from blobtree.own.source import OwnSource
from blobtree.typed.reference import vector

Floats = NDArray[np.float64]

SEED = 20
TRIALS = 14
"""Sets of parameters."""

PLACES = 80
"""Places asked about per set, besides the parameters themselves and what lies between them."""

TOLERANCE = 1e-6
"""Relative error of a distance that a trial passes over: what float32 makes of it is no better."""


SINGLE_TOLERANCE = 1e-5
"""The same in single precision."""


def try_skeleton(source: OwnSource, parameters: tuple[Parameter, ...], *, convex: bool) -> None:
    """Try whether a function returns the closest point of some set.

    With c the closest point of q it must do so: c is closest to itself, and no closest point of another place
    is nearer to q. Both hold for every set and, taken over all places, for nothing else.
    """
    rng = np.random.default_rng(SEED)
    closest, in_single = source.reference(), source.reference(np.float32)
    for trial in range(TRIALS):
        values = {parameter.name: parameter.drawn(rng, trial) for parameter in parameters}
        arguments = [vector(*value) if isinstance(value, tuple) else value for value in values.values()]
        places = _places(rng, arguments)
        found = np.array([_point(source, closest, q, arguments, values) for q in places])
        _try_single_precision(source, in_single, places, found, values)
        again = np.array([_point(source, closest, vector(*c), arguments, values) for c in found])
        scale = 1.0 + max(np.abs(places).max(), np.abs(found).max())
        moved = np.linalg.norm(again - found, axis=1)
        hint = f", with {values}{_hint(parameters)}"
        if moved.max() > TOLERANCE * scale:
            worst = int(moved.argmax())
            raise source.refusal(
                f"{_shown(found[worst])} is returned as a point of the skeleton, but asked about that very "
                f"place it returns {_shown(again[worst])}; return the closest point of a fixed set{hint}"
            )
        if convex:
            _try_convexity(source, closest, found, arguments, values)
        distances = np.linalg.norm(places[:, None] - found[None], axis=2)
        excess = np.diagonal(distances)[:, None] - distances
        if excess.max() > TOLERANCE * scale:
            i, j = np.unravel_index(int(excess.argmax()), excess.shape)
            raise source.refusal(
                f"for q = {_shown(places[i])} it returns {_shown(found[i])}, though {_shown(found[j])}, "
                f"which it returns for {_shown(places[j])}, is nearer; return the closest point{hint}"
            )


def _try_single_precision(
    source: OwnSource,
    closest: Callable[..., Any],
    places: Floats,
    found: Floats,
    values: dict[str, Any],
) -> None:
    """Distances must survive float32, which is what devices compute in."""
    for q, c in zip(places, found, strict=True):
        arguments = [_in_single(value) for value in (tuple(q), *values.values())]
        where = f"q = {_shown(q)} and {values}, in single precision,"
        other = result_of(source, closest, arguments, where, 3)
        one, two = np.linalg.norm(q - c), np.linalg.norm(q - other)
        if abs(one - two) > SINGLE_TOLERANCE * (1.0 + np.abs(q).max() + np.abs(c).max()):
            raise source.refusal(
                f"for {where} it returns {_shown(other)}, in double precision {_shown(c)}; "
                "avoid differences of large numbers and divisions by small ones"
            )


def _try_convexity(
    source: OwnSource,
    closest: Callable[..., Any],
    found: Floats,
    arguments: list[Any],
    values: dict[str, Any],
) -> None:
    """The middle between two points of a convex skeleton belongs to it."""
    for one, other in zip(found, np.roll(found, 1, axis=0), strict=True):
        middle = 0.5 * (one + other)
        apart = float(np.linalg.norm(_point(source, closest, middle, arguments, values) - middle))
        if apart > TOLERANCE * (1.0 + np.abs(found).max()):
            raise source.refusal(
                f"convex: {_shown(one)} and {_shown(other)} belong to the skeleton, but the middle between "
                f"them is {apart:.6g} away from it, with {values}"
            )


def _in_single(value: Any) -> Any:
    if isinstance(value, tuple):
        return vector(*value, precision=np.float32)
    return np.float32(value) if isinstance(value, float) else value


def _hint(parameters: tuple[Parameter, ...]) -> str:
    if not parameters:
        return ""
    return f"; if that is no use of it, say limits={{{parameters[-1].name!r}: (smallest, largest)}}"


def _places(rng: np.random.Generator, arguments: list[Any]) -> Floats:
    """Places all around, on the axes, and at and between the vectors among the parameters."""
    vectors = [np.zeros(3), *(np.asarray(value) for value in arguments if np.shape(value) == (3,))]
    between = [a + share * (b - a) for a, b in product(vectors, repeat=2) for share in (0.0, 0.5, 2.0)]
    beside = [a + step * axis for a in vectors for axis in np.eye(3) for step in (-1.0, 0.5)]
    spread = rng.uniform(-3.0, 3.0, (PLACES, 3)) * rng.choice([0.3, 1.0, 10.0], (PLACES, 1))
    return np.vstack([spread, *beside, *between[: PLACES // 2]])


def _point(
    source: OwnSource, closest: Callable[..., Any], q: Any, arguments: list[Any], values: dict[str, Any]
) -> Floats:
    where = f"q = {_shown(q)} and {values}"
    return result_of(source, closest, [vector(*q), *arguments], where, 3)


def result_of(
    source: OwnSource, function: Callable[..., Any], arguments: list[Any], where: str, size: int
) -> Floats:
    """What the function returns, as numbers."""
    try:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*arguments), np.float64)
    except ArithmeticError as error:
        raise source.refusal(f"for {where}: {error}; every place needs an answer") from error
    except Exception as error:  # the function is the user's own
        raise source.refusal(f"for {where} it fails: {type(error).__name__}: {error}") from error
    if result.shape != (size,) or not np.isfinite(result).all():
        raise source.refusal(f"for {where} it returns {_shown(result)}; expected {size} finite numbers")
    return result


def _shown(numbers: Any) -> str:
    flat = np.ravel(np.asarray(numbers, np.float64)).tolist()
    return "(" + ", ".join(f"{number:.6g}" for number in flat) + ")"
