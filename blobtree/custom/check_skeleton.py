"""Checks of a custom skeleton: samples in double precision that may contradict the definition.

They cannot prove a claim, but a wrong function seldom passes.
"""

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blobtree.custom.definition import trial_value
from blobtree.custom.source import CustomSource
from blobtree.nodes.parameters import Parameter
from blobtree.transpile.python import vector

Floats = NDArray[np.float64]

SEED = 20
TRIALS = 14
"""Number of sets of parameters."""

POINTS = 80
"""Query points per set, besides the vectors among the parameters and the points between them."""

TOLERANCE = 1e-6
"""Relative error of a distance that is accepted: float32 is no better."""


SINGLE_TOLERANCE = 1e-5
"""The same in single precision."""


def check_skeleton(source: CustomSource, parameters: tuple[Parameter, ...], *, convex: bool) -> None:
    """Raise `InvalidDefinition` unless a function seems to return the closest point of a set.

    Let c be the point returned for q. Then c is returned for c itself, and no point returned for another
    query is nearer to q. Both hold for every set and, over all queries, for no other function.
    """
    rng = np.random.default_rng(SEED)
    closest, in_single = source.reference(), source.reference(np.float32)
    for trial in range(TRIALS):
        values = {parameter.name: trial_value(parameter, rng, trial) for parameter in parameters}
        arguments = [vector(*value) if isinstance(value, tuple) else value for value in values.values()]
        queries = _queries(rng, arguments)
        closest_points = np.array([_point(source, closest, q, arguments, values) for q in queries])
        _try_single_precision(source, in_single, queries, closest_points, values)
        repeated = np.array([_point(source, closest, vector(*c), arguments, values) for c in closest_points])
        scale = 1.0 + max(np.abs(queries).max(), np.abs(closest_points).max())
        moved = np.linalg.norm(repeated - closest_points, axis=1)
        hint = f", with {values}{_hint(parameters)}"
        if moved.max() > TOLERANCE * scale:
            worst = int(moved.argmax())
            raise source.refusal(
                f"{_format(closest_points[worst])} is returned as a point of the skeleton, but for that very "
                f"point it returns {_format(repeated[worst])}; return the closest point of a fixed set{hint}"
            )
        if convex:
            _try_convexity(source, closest, closest_points, arguments, values)
        distances = np.linalg.norm(queries[:, None] - closest_points[None], axis=2)
        excess = np.diagonal(distances)[:, None] - distances
        if excess.max() > TOLERANCE * scale:
            i, j = np.unravel_index(int(excess.argmax()), excess.shape)
            raise source.refusal(
                f"for q = {_format(queries[i])} it returns {_format(closest_points[i])}, though "
                f"{_format(closest_points[j])}, which it returns for {_format(queries[j])}, is nearer; "
                f"return the closest point{hint}"
            )


def _try_single_precision(
    source: CustomSource,
    closest: Callable[..., Any],
    queries: Floats,
    closest_points: Floats,
    values: dict[str, Any],
) -> None:
    """Check that distances survive float32, in which devices compute."""
    for q, c in zip(queries, closest_points, strict=True):
        arguments = [_in_single(value) for value in (tuple(q), *values.values())]
        where = f"q = {_format(q)} and {values}, in single precision,"
        other = result_of(source, closest, arguments, where, 3)
        one, two = np.linalg.norm(q - c), np.linalg.norm(q - other)
        if abs(one - two) > SINGLE_TOLERANCE * (1.0 + np.abs(q).max() + np.abs(c).max()):
            raise source.refusal(
                f"for {where} it returns {_format(other)}, in double precision {_format(c)}; "
                "avoid differences of large numbers and divisions by small ones"
            )


def _try_convexity(
    source: CustomSource,
    closest: Callable[..., Any],
    closest_points: Floats,
    arguments: list[Any],
    values: dict[str, Any],
) -> None:
    """Check that the middle between two points of a convex skeleton belongs to it."""
    for one, other in zip(closest_points, np.roll(closest_points, 1, axis=0), strict=True):
        middle = 0.5 * (one + other)
        apart = float(np.linalg.norm(_point(source, closest, middle, arguments, values) - middle))
        if apart > TOLERANCE * (1.0 + np.abs(closest_points).max()):
            raise source.refusal(
                f"convex: {_format(one)} and {_format(other)} belong to the skeleton, but the middle between "
                f"them is {apart:.6g} away from it, with {values}"
            )


def _in_single(value: Any) -> Any:
    if isinstance(value, tuple):
        return vector(*value, precision=np.float32)
    return np.float32(value) if isinstance(value, float) else value


def _hint(parameters: tuple[Parameter, ...]) -> str:
    if not parameters:
        return ""
    return f"; if such values are not meant, pass limits={{{parameters[-1].name!r}: (smallest, largest)}}"


def _queries(rng: np.random.Generator, arguments: list[Any]) -> Floats:
    """Return query points all around, on the axes, and at and between the vectors among the parameters."""
    vectors = [np.zeros(3), *(np.asarray(value) for value in arguments if np.shape(value) == (3,))]
    between = [a + share * (b - a) for a, b in product(vectors, repeat=2) for share in (0.0, 0.5, 2.0)]
    beside = [a + step * axis for a in vectors for axis in np.eye(3) for step in (-1.0, 0.5)]
    spread = rng.uniform(-3.0, 3.0, (POINTS, 3)) * rng.choice([0.3, 1.0, 10.0], (POINTS, 1))
    return np.vstack([spread, *beside, *between[: POINTS // 2]])


def _point(
    source: CustomSource, closest: Callable[..., Any], q: Any, arguments: list[Any], values: dict[str, Any]
) -> Floats:
    where = f"q = {_format(q)} and {values}"
    return result_of(source, closest, [vector(*q), *arguments], where, 3)


def result_of(
    source: CustomSource, function: Callable[..., Any], arguments: list[Any], where: str, size: int
) -> Floats:
    """Return the result of a function as `size` numbers; raise `InvalidDefinition` otherwise."""
    try:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*arguments), np.float64)
    except ArithmeticError as error:
        raise source.refusal(f"for {where}: {error}; every point q needs a closest point") from error
    except Exception as error:  # the function is the user's own
        raise source.refusal(f"for {where} it fails: {type(error).__name__}: {error}") from error
    if result.shape != (size,) or not np.isfinite(result).all():
        raise source.refusal(f"for {where} it returns {_format(result)}; expected {size} finite numbers")
    return result


def _format(numbers: Any) -> str:
    flat = np.ravel(np.asarray(numbers, np.float64)).tolist()
    return "(" + ", ".join(f"{number:.6g}" for number in flat) + ")"
