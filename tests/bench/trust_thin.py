"""Thin parts of trees: parts without mesh or without their share of decals, and what they cost.

    python -m tests.bench.trust_thin [--trees 200] [--first 0] [--workers 16] [--limit 120] [--out FOLDER]

Costs are means of the processor times of mesh and scattering together, over those with cells of one size, in
which thin parts are lost. Parts whose cells do not fit into memory are counted apart: the log names them.

Each tree is that of `tests.thin_trees.random_tree` with its number. It is measured in a process that is ended
at a limit of time; then all its parts count as lost. A tree is printed once it has ended, and its row is
written to the folder. With the same folder a campaign goes on, so take a new one after a change of the code.
"""

import logging
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from operator import add, sub
from pathlib import Path
from typing import Any

import numpy as np

from blobtree import Mesh, Node, Point, Segment, polygonize
from blobtree._typing import Float64Array
from decals import scatter
from decals.errors import InvalidMesh
from decals.experiments import Grid, run
from decals.surfaces import ImplicitSurface
from tests.bench.command_line import bench_parser, show, write
from tests.thin_trees import ThinTree, decals_of_parts, has_share, is_closed, random_tree

TARGETS = {
    "thin_parts_lost": "0",
    "thin_parts_over_memory": "0",
    "thin_trees_failed": "0",
    "thin_cost": "≤ 3",
    "ridge_cost": "≤ 3",
    "plain_cost": "≤ 1.05",
    "plain_cut_cost": "≤ 1.05",
}

LEAST_RADIUS = 5e-5
"""Radius of the thinnest part that counts, over the longest side of the tree's box: half a ten-thousandth."""

LEAST_AREA = 0.85
"""Area of a part's triangles over that of its surface, below which the part counts as lost."""

LEAST_DECALS = 20.0
"""Share of decals from which on a part's number of them counts."""

RESOLUTION = 64
"""Cells of one size, with which costs are compared."""

TREES, COUNT = 200, 800
"""Trees, and decals on each."""

LIMIT = 120.0
"""Seconds after which a tree is ended."""


class Messages(logging.Handler):
    """The warnings about thin parts and gaps."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the text."""
        self.texts.append(record.getMessage())

    @contextmanager
    def received(self) -> Iterator[None]:
        """Within a ``with`` block, receive warnings."""
        logger = logging.getLogger("blobtree.meshing.parts")
        logger.addHandler(self)
        try:
            yield
        finally:
            logger.removeHandler(self)


def measure(*, quick: bool) -> dict[str, float]:
    """Measure random trees with thin parts, and trees without."""
    trees, count, repeats = (5, 400, 2) if quick else (TREES, COUNT, 5)
    figures = campaign(range(trees), count)
    figures["ridge_cost"] = _plain_cost([_bumpy_tree(32, sub, 0.9)], count, repeats)
    figures["plain_cost"] = _plain_cost(
        [_bumpy_tree(bumps, add, np.inf) for bumps in (1, 8, 32)], count, repeats
    )
    cut = [_bumpy_tree(bumps, sub, 0.9) for bumps in (1, 8)] + [_dented_ball(dents) for dents in (16, 32)]
    figures["plain_cut_cost"] = _plain_cost(cut, count, repeats)
    return figures


def campaign(
    numbers: Sequence[int],
    count: int,
    *,
    workers: int | None = None,
    limit: float = LIMIT,
    folder: Path | None = None,
    report: Callable[[str], object] = lambda _: None,
) -> dict[str, float]:
    """Return the figures of trees in processes, and report each tree when it has ended."""
    _load_kernels()  # compiled once, before all processes need them
    with tempfile.TemporaryDirectory() as name:
        results = run(
            tree_row,
            Grid(number=numbers, count=[count]),
            folder or Path(name),
            workers=workers,
            limit=limit,
            on_row=lambda row: report(_line(row)),
            progress=lambda _stage, _fraction: None,
        )
        rows = [row for row in results.rows if row["number"] in numbers and row["count"] == count]
    done = [row for row in rows if row["status"] == "done"]
    failed = [random_tree(row["number"]) for row in rows if row["status"] != "done"]
    figures: dict[str, float] = {"thin_cases": len(rows), "thin_trees_failed": len(failed)}
    for key in ("parts", "shares", "parts_over_memory", "parts_lost"):
        figures[f"thin_{key}"] = sum(row[key] for row in done)
    for key in ("parts", "parts_lost"):
        figures[f"thin_{key}"] += sum(len(_counted_parts(model)) for model in failed)
    costs = np.array([row["cost"] for row in done if row["cost"]])
    if len(costs):
        figures["thin_cost"] = float(costs.mean())
        figures["thin_cost_median"], figures["thin_cost_most"] = float(np.median(costs)), float(costs.max())
    return figures


def _line(row: dict[str, Any]) -> str:
    """Return the row of a tree as a line."""
    if row["status"] != "done":
        return f"tree {row['number']}: {row['error']}"
    words = [f"tree {row['number']}: {row['parts_lost']} lost of {row['parts']} parts"]
    words += [f"cost {row['cost']:.2f}, {row['processor']:.1f} s, {row['triangles']} triangles"]
    return ", ".join([*words, *(str(row[key]) for key in ("faults", "warnings") if row[key])])


def tree_row(number: int, count: int) -> dict[str, float | str]:
    """Measure one random tree."""
    _load_kernels()
    model = random_tree(number)
    before, _ = _scattered(model.tree, RESOLUTION, count)
    messages = Messages()
    with messages.received():
        seconds, positions = _scattered(model.tree, None, count)
    over, counted = _named_parts(model, messages.texts), _counted_parts(model)
    bare, shares = _bare_parts(model, positions, counted - over)
    mesh = polygonize(model.tree)
    unmeshed = _parts_without_mesh(model, mesh)
    faults = [f"{name} has no mesh" for name in _names(model, unmeshed - over)]
    faults += [
        f"{name} has {found:g} decals in place of {expected:.1f}"
        for name, (found, expected) in zip(_names(model, set(bare)), bare.values(), strict=True)
    ]
    return {
        "parts": len(counted),
        "shares": shares,
        "parts_over_memory": len(over & counted),
        "parts_lost": len((unmeshed - over) | set(bare)),
        "cost": seconds / before if before > 0.0 else 0.0,
        "processor": seconds,
        "triangles": len(mesh.faces),
        "faults": "; ".join(faults),
        "warnings": "; ".join(messages.texts),
    }


@cache
def _load_kernels() -> None:
    """Load the kernels of all trees, so that no tree is slow for that."""
    for tree in (_bumpy_tree(1, sub, 0.9), _bumpy_tree(1, add, np.inf).twist(10.0)):
        hair = Segment((0, 0, 0), (0, 0, 2), radius=0.01)
        _scattered(tree | hair, None, 20)


def _names(model: ThinTree, numbers: set[int]) -> list[str]:
    """Return parts by kind and path."""
    return [f"part {number} ({model.parts[number].kind})" for number in sorted(numbers)]


def _scattered(tree: Node, resolution: int | None, count: int, seed: int = 1) -> tuple[float, Float64Array]:
    """Return the processor time of mesh and scattering, 0 where there is no mesh, and the decals' centres."""
    start = time.process_time()
    try:
        layout = scatter(ImplicitSurface(tree, resolution=resolution), count=count, seed=seed)
    except InvalidMesh:
        return 0.0, np.empty((0, 3))
    return time.process_time() - start, layout.positions.astype(np.float64)


def _counted_parts(model: ThinTree) -> set[int]:
    """Return the parts that are thick enough to count, and have surface of their own."""
    size = float((model.tree.support[1] - model.tree.support[0]).max())
    return {
        number
        for number, part in enumerate(model.parts)
        if part.radius >= LEAST_RADIUS * size and part.area > 0.0
    }


def _parts_without_mesh(model: ThinTree, mesh: Mesh) -> set[int]:
    """Return the counted parts without mesh; all of them if the mesh is not closed."""
    counted = _counted_parts(model)
    if not is_closed(mesh.faces):
        return counted
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    return {
        number
        for number in counted
        if model.parts[number].area_in(corners) < LEAST_AREA * model.parts[number].area
    }


def _bare_parts(
    model: ThinTree, positions: Float64Array, among: set[int]
) -> tuple[dict[int, tuple[int, float]], int]:
    """Return the parts without their share of the decals, each with its decals and its share.

    Parts that need no mesh, and have none or a part of it, leave their decals to others, so shares are those
    among the parts that have one. Return also how many were checked.
    """
    found, expected = decals_of_parts(model, positions)
    numbers = sorted(among)
    expected *= found[numbers].sum() / max(expected[numbers].sum(), 1e-300)
    right = has_share(found, expected)
    checked = [number for number in numbers if expected[number] >= LEAST_DECALS]
    bare = {number: (int(found[number]), float(expected[number])) for number in checked if not right[number]}
    return bare, len(checked)


def _named_parts(model: ThinTree, messages: list[str]) -> set[int]:
    """Return the parts that warnings name by their paths."""
    alone = len(model.parts) == 1
    return {
        number
        for number in range(len(model.parts))
        if any(alone or f"at path ({number}," in text for text in messages)
    }


def _plain_cost(trees: Sequence[Node], count: int, seeds: int) -> float:
    """Return the mean cost of trees, each in the mean of seeds: how soon decals lie apart is luck."""
    ratios = []
    for tree in trees:
        _scattered(tree, None, count)  # kernels compile
        times = np.array(
            [[_scattered(tree, wish, count, seed)[0] for wish in (None, RESOLUTION)] for seed in range(seeds)]
        )
        new, old = times.sum(axis=0)
        ratios.append(new / old)
    return float(np.mean(ratios))


def _bumpy_tree(bumps: int, combine: Callable[[Node, Node], Node], share: float) -> Node:
    """Return a body with a ring of balls that are joined, or that cut.

    `share` bounds their radius by a part of half their distance. Between many cuts, ridges are left that are
    thinner than cells of one size.
    """
    tree: Node = Point((0, 0, 0), radius=1.0) + Segment((0, 0, 0), (2, 0.5, 0), radius=0.4)
    for number in range(bumps):
        angle = 2.0 * np.pi * number / bumps
        radius = min(0.3, share * float(np.pi) / bumps)
        tree = combine(tree, Point((float(np.cos(angle)), float(np.sin(angle)), 0.3), radius=radius))
    return tree


def _dented_ball(dents: int) -> Node:
    """Return a ball with dents all over it, with more than two cells of one size between them."""
    tree: Node = Point((0, 0, 0), radius=1.0)
    heights = 1.0 - (2.0 * np.arange(dents) + 1.0) / dents
    angles = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(dents)
    rings = np.sqrt(1.0 - heights**2)
    radius = 0.5 * (3.0 / np.sqrt(dents) - 0.16)
    for x, y, z in np.stack([rings * np.cos(angles), rings * np.sin(angles), heights], axis=1).tolist():
        tree = tree - Point((x, y, z), radius=radius)
    return tree


def main() -> int:
    """Measure the trees that the command line asks for; the exit code is 1 if a part is lost."""
    parser = bench_parser("trust_thin", __doc__)
    parser.add_argument("--trees", type=int, default=TREES)
    parser.add_argument("--first", type=int, default=0, help="number of the first tree")
    parser.add_argument("--numbers", type=int, nargs="+", help="numbers of the trees")
    parser.add_argument("--count", type=int, default=COUNT, help="decals of each tree")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds after which a tree is ended")
    parser.add_argument("--out", type=Path, help="folder of the rows")
    options = parser.parse_args()
    figures = campaign(
        options.numbers or range(options.first, options.first + options.trees),
        options.count,
        workers=options.workers,
        limit=options.limit,
        folder=options.out,
        report=lambda line: print(line, file=sys.stderr, flush=True),
    )
    show(figures)
    write(options.json, figures)
    return int(figures["thin_parts_lost"] > 0)


if __name__ == "__main__":
    sys.exit(main())
