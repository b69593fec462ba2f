"""Benchmark of fits: random trees of 20 primitives, recovered from exact samples and a perturbed start.

    python -m tests.bench.fitting                # 100 trees, 10,000 samples each
    python -m tests.bench.fitting --trees 5      # fewer
    python -m tests.bench.fitting --processes 8  # several trees at a time

A tree is recovered if every parameter comes back within 1e-3 of a model unit (directions as unit vectors).
The trees are about four units wide. Samples are points of the support with their field values. Trees with
parameters that the samples do not determine, such as those of primitives that a union hides, are not counted.
"""

import multiprocessing
import time
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from blobtree import (
    Box,
    Disc,
    Node,
    NumericParameter,
    Point,
    Ricci,
    Segment,
    Sum,
    Torus,
    Union,
    fit,
    numeric_parameters,
    numeric_values,
    with_numeric_values,
)
from blobtree.declare.parameters import Quantity
from tests.bench.command_line import bench_parser, show, write

PRIMITIVES = 20
SAMPLES = 10_000
TREES = 100
RECOVERED = 1e-3
LARGEST_ERROR = 3.0
"""Largest standard error of a parameter that samples determine, per unit of error of the field."""

TRIED_PER_TREE = 10
"""Most random trees per tree that samples determine; about half of them do."""

GROUP = 4

Numbers = NDArray[np.float64]


def random_primitive(rng: np.random.Generator, middle: Numbers) -> Node:
    """Return a primitive of a random kind near a point."""
    center, axis = middle + rng.uniform(-0.7, 0.7, 3), rng.normal(size=3)
    radius = float(rng.uniform(0.25, 0.5))
    kind = rng.integers(0, 5)
    if kind == 0:
        return Point(tuple(center), radius=radius)
    if kind == 1:
        return Segment(tuple(center), tuple(center + axis), radius=radius)
    if kind == 2:
        return Torus(tuple(center), tuple(axis), float(rng.uniform(0.6, 1.0)), radius=radius)
    if kind == 3:
        return Disc(tuple(center), tuple(axis), float(rng.uniform(0.6, 1.0)), radius=radius)
    return Box(tuple(center), tuple(rng.uniform(0.5, 1.2, 3)), radius=radius)


def random_model(rng: np.random.Generator, primitives: int = PRIMITIVES) -> Node:
    """Return a sum of groups of primitives, each a sum, a Ricci blend or a union.

    The primitives of a group are near each other: where they do not overlap, no sample shows how they blend.
    """
    groups: list[Node] = []
    for first in range(0, primitives, GROUP):
        middle = rng.uniform(-1.5, 1.5, 3)
        operands = tuple(random_primitive(rng, middle) for _ in range(first, min(first + GROUP, primitives)))
        kind = rng.integers(0, 3)
        if kind == 0:
            groups.append(Sum(operands))
        elif kind == 1:
            groups.append(Ricci(operands, exponent=float(rng.uniform(1.5, 4.0))))
        else:
            groups.append(Union(operands))
    return Sum(tuple(groups))


def perturbed(tree: Node, rng: np.random.Generator, amount: float = 1.0) -> Node:
    """Return a tree whose points are off by up to 0.1, directions by 0.1 rad and sizes by 15 % or so."""
    parameters = numeric_parameters(tree)
    values = numeric_values(tree, parameters)
    for column, parameter in enumerate(parameters):
        shift = amount * rng.uniform(-0.1, 0.1)
        absolute = parameter.declaration.quantity in (Quantity.POINT, Quantity.DIRECTION)
        values[column] = values[column] + shift if absolute else values[column] * (1.0 + 1.5 * shift)
    return with_numeric_values(tree, parameters, values)


def samples_in(tree: Node, rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Return points at which the field is not 0."""
    lower, upper = tree.support
    found = np.zeros((0, 3), np.float32)
    while len(found) < count:
        points = rng.uniform(lower, upper, (count, 3)).astype(np.float32)
        found = np.concatenate([found, points[tree(points) > 0.0]])
    return found[:count]


def normalized(tree: Node, parameters: list[NumericParameter]) -> Numbers:
    """Return the values of parameters, directions as unit vectors."""
    values = numeric_values(tree, parameters)
    for column, parameter in enumerate(parameters):
        if parameter.declaration.quantity is Quantity.DIRECTION and parameter.index == (0,):
            values[column : column + 3] /= np.linalg.norm(values[column : column + 3])
    return values


def recovery_error(found: Node, model: Node) -> float:
    """Return the largest difference of a parameter."""
    parameters = numeric_parameters(model)
    return float(np.abs(normalized(found, parameters) - normalized(model, parameters)).max())


def is_determined(tree: Node, points: NDArray[np.float32]) -> bool:
    """Return True if samples at these points determine every parameter, directions up to their length."""
    gradient = tree.parameter_gradient(points)
    jacobian = gradient.values.astype(np.float64)
    values = numeric_values(tree, gradient.parameters)
    keeping = [
        np.where(np.abs(np.arange(len(values)) - column - 1) <= 1, values, 0.0)
        for column, parameter in enumerate(gradient.parameters)
        if parameter.declaration.quantity is Quantity.DIRECTION and parameter.index == (0,)
    ]
    rows = np.concatenate([jacobian, np.reshape(keeping, (-1, len(values)))])
    variances = np.diag(np.linalg.pinv(rows.T @ rows, hermitian=True))
    return bool(np.linalg.matrix_rank(rows.T @ rows) == len(values) and variances.max() <= LARGEST_ERROR**2)


class Recovery(NamedTuple):
    """A fit of a random tree."""

    number: int
    start_error: float
    error: float
    evaluations: int
    seconds: float

    def __str__(self) -> str:
        return (
            f"tree {self.number}: error {self.error:.1e} from {self.start_error:.2f}, "
            f"{self.evaluations} evaluations, {self.seconds:.1f} s"
        )


def recovery(number: int, *, samples: int, seed: int) -> Recovery | None:
    """Fit the random tree of a number; return None if the samples do not determine it."""
    rng = np.random.default_rng([seed, number])
    model = random_model(rng)
    points = samples_in(model, rng, samples)
    if not is_determined(model, points):
        return None
    start = perturbed(model, rng)
    began = time.perf_counter()
    found = fit(start, points, model(points))
    seconds = time.perf_counter() - began
    error, start_error = (recovery_error(tree, model) for tree in (found.tree, start))
    return Recovery(number, start_error, error, found.evaluations, seconds)


def figures(trees: int, samples: int, seed: int = 0, processes: int = 1) -> dict[str, float]:
    """Return the recovered part of random trees in percent, and the median seconds of a fit."""
    found: list[Recovery] = []
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        numbers = range(TRIED_PER_TREE * trees)
        for fitted in pool.imap(partial(recovery, samples=samples, seed=seed), numbers):
            if fitted is not None:
                found.append(fitted)
                print(fitted, flush=True)
            if len(found) == trees:
                break
    return {
        "fit_recovered": 100.0 * float(np.mean([one.error <= RECOVERED for one in found])),
        "fit_trees": float(trees),
        "fit_undetermined": float(found[-1].number + 1 - trees),
        "fit_seconds": float(np.median([one.seconds for one in found])),
    }


def main() -> None:
    parser = bench_parser("fitting", __doc__)
    parser.add_argument("--trees", type=int, default=TREES, help="number of random trees")
    parser.add_argument("--samples", type=int, default=SAMPLES, help="samples of each tree")
    parser.add_argument("--processes", type=int, default=1, help="trees at a time")
    parser.add_argument("--quick", action="store_true", help="two trees of 3,000 samples")
    arguments = parser.parse_args()
    trees, samples = (2, 3000) if arguments.quick else (arguments.trees, arguments.samples)
    result = figures(trees, samples, processes=arguments.processes)
    show(result)
    write(arguments.json, result)


if __name__ == "__main__":
    main()
