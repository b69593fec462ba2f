"""Derivatives of fields by parameters against differences in float64."""

import numpy as np
from numpy.typing import NDArray

from blobtree import Node, NumericParameter, Polygon, Segment, numeric_parameters, numeric_values
from blobtree import with_numeric_values as changed
from blobtree.errors import InvalidNode
from blobtree.nodes.numeric_parameters import node_along
from tests.blobtree.trees import points_around
from tests.oracles import blobtree as oracle

Numbers = NDArray[np.float64]

POINTS = 20
AWAY = 1e-2
"""Field values between a point and the nearest kink of the field, where derivatives are compared."""

STEP = 1e-5
EXACT = 1e-4
"""Largest error of a derivative, over the largest one by the parameter, absolute below 1."""

SMOOTH = 1e-5
"""Largest disagreement, measured so, of differences with two steps; beyond it the parameter has a kink."""


def difference(tree: Node, parameter: NumericParameter, points: Numbers, step: float = STEP) -> Numbers:
    """Return the derivative (n,) by a parameter as a difference in float64."""
    (value,) = numeric_values(tree, [parameter])
    ends = [oracle.value(changed(tree, [parameter], [value + d]), points) for d in (step, -step)]
    result: Numbers = (ends[0] - ends[1]) / (2.0 * step)
    return result


def wrong_derivatives(tree: Node, rng: np.random.Generator, columns: int = 10) -> tuple[int, list[str]]:
    """Compare some parameters at some points; return the number of comparisons, and what differs.

    A point counts if the field is smooth there: its value is more than AWAY from where an operator, or the
    closest place of a skeleton, changes. It counts for a parameter only if differences over STEP and over
    3 · STEP agree, because a parameter can have kinks of its own. A segment without length has no derivative
    by its ends. Corners of polygons are left out: a corner that leaves the plane makes the field depend on
    the triangles that fill the polygon.
    """
    points = points_around(rng, tree, POINTS)
    exact = points.astype(np.float64)
    away = oracle.signed(tree, exact).margin > AWAY
    parameters = numeric_parameters(tree)
    chosen = [parameters[i] for i in rng.permutation(len(parameters))[:columns]]
    seen = tree.parameter_gradient(points, chosen)
    assert seen.values.shape == (POINTS, len(chosen))
    compared = 0
    found: list[str] = []
    for parameter, column in zip(chosen, seen.values.T, strict=True):
        node = node_along(tree, parameter.path)
        degenerate = isinstance(node, Segment) and node.start == node.end
        if degenerate or (isinstance(node, Polygon) and parameter.name == "points"):
            continue
        try:
            expected, wider = (difference(tree, parameter, exact, step) for step in (STEP, 3.0 * STEP))
        except InvalidNode:  # at the end of its range
            continue
        size = max(1.0, float(np.abs(expected).max()))
        smooth = away & (np.abs(expected - wider) <= SMOOTH * size)
        compared += int(smooth.sum())
        error = float(np.abs(column - expected)[smooth].max(initial=0.0)) / size
        if error > EXACT:
            found.append(f"{parameter}: derivative differs from float64 by {error:.3g}: {tree!r:.300}")
    return compared, found
