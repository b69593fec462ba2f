"""Checks of users' skeletons: samples of points that may contradict a definition."""

from itertools import product
from typing import Any

import numpy as np

from blobtree._typing import Float64Array
from blobtree.declare.checks import SEED, TRIALS, Packed, Trial, trial_value
from blobtree.declare.formula import shown
from blobtree.declare.parameters import Parameter
from blobtree.declare.skeleton import FARTHEST, SkeletonFormulas

POINTS = 80
"""Query points per set, besides the vectors among the parameters and the points between them."""

TOLERANCE = 1e-6
"""Relative error of a distance that is accepted: float32 is no better."""

SINGLE_TOLERANCE = 1e-5
"""The same in single precision."""

FAR_SHARE = 0.1
"""Distance of a closest point, relative to that of its far query, at which a skeleton counts as unbounded."""


def check_skeleton(formulas: SkeletonFormulas, parameters: tuple[Parameter, ...], packed: Packed) -> None:
    """Raise `InvalidDefinition` unless a function seems to return the closest point of a set.

    Let c be the point returned for q. Then c is returned for c itself, and no point returned for another
    query is nearer to q. Both hold for every set and, over all queries, for no other function. Where the
    influence varies, distances are in influences.
    """
    rng, source = np.random.default_rng(SEED), formulas.source
    for number in range(TRIALS):
        values = {parameter.name: trial_value(parameter, rng, number) for parameter in parameters}
        trial = Trial(source, packed(values), formulas.size)
        queries = _queries(rng, trial.values)
        found = np.array([trial.at(q) for q in queries])
        closest_points, influences = found[:, :3], found[:, 3] if formulas.size == 4 else np.ones(len(found))
        _try_single_precision(trial, queries, found)
        repeated = np.array([trial.at(c)[:3] for c in closest_points])
        scale = 1.0 + max(np.abs(queries).max(), np.abs(closest_points).max())
        moved = np.linalg.norm(repeated - closest_points, axis=1)
        hint = f"{trial.with_values}{_hint(parameters)}"
        if influences.min() <= 0.0:
            raise source.refusal(f"expected influences above 0, got {influences.min():.6g}{hint}")
        if moved.max() > TOLERANCE * scale:
            worst = int(moved.argmax())
            raise source.refusal(
                f"{shown(closest_points[worst])} is returned as a point of the skeleton, but for that very "
                f"point it returns {shown(repeated[worst])}; return the closest point of a fixed set{hint}"
            )
        if formulas.convex:
            _try_convexity(trial, closest_points)
        distances = np.linalg.norm(queries[:, None] - closest_points[None], axis=2) / influences
        excess = (np.diagonal(distances)[:, None] - distances) * influences[:, None]
        if excess.max() > TOLERANCE * scale:
            i, j = np.unravel_index(int(excess.argmax()), excess.shape)
            raise source.refusal(
                f"for q = {shown(queries[i])} it returns {shown(closest_points[i])}, though "
                f"{shown(closest_points[j])}, which it returns for {shown(queries[j])}, is nearer; "
                f"return the closest point{hint}"
            )
        _try_bounds(trial)


def _try_single_precision(trial: Trial, queries: Float64Array, closest_points: Float64Array) -> None:
    """Check that distances survive float32, in which devices compute."""
    for q, c in zip(queries, closest_points, strict=True):
        other = trial.at(q, np.float32)
        one, two = np.linalg.norm(q - c[:3]), np.linalg.norm(q - other[:3])
        if abs(one - two) > SINGLE_TOLERANCE * (1.0 + np.abs(q).max() + np.abs(c).max()):
            raise trial.source.refusal(
                f"for {trial.where((q,))} it returns {shown(other)} in single precision, {shown(c)} in "
                "double; avoid differences of large numbers and divisions by small ones"
            )


def _try_convexity(trial: Trial, closest_points: Float64Array) -> None:
    """Check that the middle between two points of a convex skeleton belongs to it."""
    for one, other in zip(closest_points, np.roll(closest_points, 1, axis=0), strict=True):
        middle = 0.5 * (one + other)
        apart = float(np.linalg.norm(trial.at(middle)[:3] - middle))
        if apart > TOLERANCE * (1.0 + np.abs(closest_points).max()):
            raise trial.source.refusal(
                f"convex: {shown(one)} and {shown(other)} belong to the skeleton, but the middle between "
                f"them is {apart:.6g} away from it{trial.with_values}"
            )


def _try_bounds(trial: Trial) -> None:
    """Check that the closest points to far queries are not far away too."""
    distance = FARTHEST * max([1.0, *(float(np.abs(value).max()) for value in trial.values.values())])
    for signs in product((-1.0, 0.0, 1.0), repeat=3):
        if any(signs):
            q = distance * np.array(signs) / np.linalg.norm(signs)
            c = trial.at(q)[:3]
            if np.linalg.norm(c) > FAR_SHARE * distance:
                raise trial.source.refusal(
                    f"for q = {shown(q)} it returns {shown(c)}, so its skeleton seems to be unbounded; "
                    f"end the skeleton at a finite distance{trial.with_values}"
                )


def _hint(parameters: tuple[Parameter, ...]) -> str:
    if not parameters:
        return ""
    return f"; if such values are not meant, pass limits={{{parameters[-1].name!r}: (smallest, largest)}}"


def _queries(rng: np.random.Generator, values: dict[str, Any]) -> Float64Array:
    """Return query points all around, on the axes, and at and between the vectors among the parameters."""
    vectors = [np.zeros(3), *(np.asarray(value) for value in values.values() if np.shape(value) == (3,))]
    between = [a + share * (b - a) for a, b in product(vectors, repeat=2) for share in (0.0, 0.5, 2.0)]
    beside = [a + step * axis for a in vectors for axis in np.eye(3) for step in (-1.0, 0.5)]
    spread = rng.uniform(-3.0, 3.0, (POINTS, 3)) * rng.choice([0.3, 1.0, 10.0], (POINTS, 1))
    return np.vstack([spread, *beside, *between[: POINTS // 2]])
