"""Benchmark of the modeller's nodes: conformance, soundness, and the cost of kinds outside the core.

    python -m tests.bench.nodes --trees 2000                # all figures but the paired one
    python -m tests.bench.nodes --against ../before         # also pure sums, paired with another checkout
    python -m tests.bench.nodes --quick --json nodes.json

`nodes_conforming` of `nodes_total` classes pass `tests.conformance`; `soundness_failures` is a number of
random trees (`tests.soundness`). `mixed_over_sum` is the cost per crossing cell of a tree with a clean union,
solids in contact and a bend, over that of a pure sum. `sum_regression` is the time of a pure sum here over
that in the other checkout, by alternating processes. `first_use_s` is the time of the first mesh of a new
kind.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import warp as wp

from blobtree import CleanUnion, Contact, Node, Point, Sum, define_skeleton, polygonize
from blobtree.nodes.kinds import NODE_KINDS
from tests.bench.blobtree import blobs, median_time
from tests.conformance import problems_of
from tests.soundness import failures_of, random_tree

Figures = dict[str, float]

ROUNDS = 7
COUNT = 1_000
SUM_SCRIPT = """
import time
from blobtree import Sum
from tests.bench.blobtree import blobs, mesh_of
tree = Sum(tuple(blobs(1000)))
mesh_of(tree, 96)
start = time.process_time()
for _ in range(3):
    mesh_of(tree, 96)
print(time.process_time() - start)
"""


def conformance(samples: int) -> Figures:
    """Count the classes that conform; print what the others violate."""
    conforming = 0
    for tag, kind in NODE_KINDS.items():
        problems = problems_of(kind, seed=1, samples=samples)
        conforming += not problems
        for problem in problems:
            print(f"  {tag}: {problem[:200]}")
    return {"nodes_total": len(NODE_KINDS), "nodes_conforming": conforming}


def soundness(count: int) -> Figures:
    """Count the random trees that violate something; print what."""
    rng = np.random.default_rng(1)
    failing = 0
    for number in range(count):
        tree = random_tree(rng)
        failures = failures_of(tree, rng)
        failing += bool(failures)
        for failure in failures:
            print(f"  tree {number}: {failure}: {repr(tree)[:200]}")
    return {"soundness_trees": count, "soundness_failures": failing}


def mixed() -> Node:
    """Return a tree with a clean union, solids in contact and a bend."""
    parts = [Point((x, y, 0.0), radius=0.35) for x in (-0.5, 0.0, 0.5) for y in (-0.4, 0.0, 0.4)]
    pressed = Contact((Sum(tuple(parts[:4])), Sum(tuple(parts[4:]))), width=0.3, height=0.03)
    return CleanUnion(pressed, Sum(tuple(part.translate((0, 0, 0.5)) for part in parts))).bend(
        30.0, (-0.5, 0.5)
    )


def costs(resolution: int) -> Figures:
    """Compare times per vertex, of which each crossing cell has one."""
    trees = {"sum": Sum(tuple(blobs(COUNT))), "mixed": mixed()}
    per_cell = {}
    for name, tree in trees.items():
        seconds = median_time(lambda tree=tree: polygonize(tree, resolution=resolution), 3, time.process_time)  # type: ignore[misc]
        per_cell[name] = seconds / len(polygonize(tree, resolution=resolution).vertices)
    return {"mixed_over_sum": per_cell["mixed"] / per_cell["sum"]}


@wp.func
def fresh(q: wp.vec3, half: wp.float32) -> wp.vec3:
    """Return the closest point on a rod along x."""
    return wp.vec3(wp.clamp(q[0], -half, half), 0.0, 0.0)


def first_use() -> Figures:
    """Time the first mesh of a kind that no process has compiled: its name is new."""
    start = time.perf_counter()
    rod = define_skeleton(fresh, convex=True, name=f"fresh{time.time_ns()}", limits={"half": (0.0, None)})
    polygonize(rod(1.0, radius=0.2), resolution=32)
    return {"first_use_s": time.perf_counter() - start}


def regression(other: Path, rounds: int) -> Figures:
    """Compare pure sums in alternating processes here and in another checkout."""
    times: dict[Path, list[float]] = {Path.cwd(): [], other: []}
    for _ in range(rounds):
        for folder, seconds in times.items():
            run = [sys.executable, "-c", SUM_SCRIPT]
            seconds.append(float(subprocess.check_output(run, cwd=folder, text=True).split()[-1]))
    here, there = (statistics.median(seconds) for seconds in times.values())
    return {"sum_regression": here / there}


def main() -> None:
    """Parse the command line and measure."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.bench.nodes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--trees", type=int, default=200, help="number of random trees")
    parser.add_argument("--against", type=Path, help="another checkout, for sum_regression")
    parser.add_argument("--quick", action="store_true", help="few samples and trees")
    parser.add_argument("--json", type=Path, help="also write one flat object {figure: number}")
    options = parser.parse_args()
    figures = conformance(1 if options.quick else 8)
    figures |= soundness(10 if options.quick else options.trees)
    figures |= costs(48 if options.quick else 96)
    figures |= first_use()
    if options.against:
        figures |= regression(options.against.resolve(), 3 if options.quick else ROUNDS)
    for name, number in figures.items():
        print(f"  {name:20} {number:10.3f}")
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
