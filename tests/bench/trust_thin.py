"""Thin parts of trees: parts without mesh or without their share of decals, and what they cost.

Costs are means of the processor times of mesh and scattering together, over those with cells of one size, in
which thin parts are lost. Parts whose cells do not fit into memory are counted apart: the log names them.
"""

import logging
import time
from collections.abc import Callable, Sequence
from operator import add, sub

import numpy as np

from blobtree import Node, Point, Segment, polygonize
from blobtree._typing import Float64Array
from decals import scatter
from decals.errors import InvalidMesh
from decals.surfaces import ImplicitSurface
from tests.thin_trees import ThinTree, is_closed, mesh_areas, random_tree

TARGETS = {
    "thin_parts_lost": "0",
    "thin_cost": "≤ 3",
    "ridge_cost": "≤ 3",
    "plain_cost": "≤ 1.05",
    "plain_cut_cost": "≤ 1.05",
}

LEAST_RADIUS = 5e-5
"""Radius of the thinnest part that counts, over the longest side of the tree's box: half a ten-thousandth."""

LEAST_AREA = 0.85
"""Area of a part's triangles over that of its surface, below which the part counts as lost."""

SHARE_ERROR, LEAST_DECALS = 0.05, 20.0
"""Allowed error of a part's number of decals, beside one decal, and the number from which on it counts."""

RESOLUTION = 64
"""Cells of one size, with which costs are compared."""


class _Messages(logging.Handler):
    """The warnings about thin parts."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the text."""
        self.texts.append(record.getMessage())


def measure(*, quick: bool) -> dict[str, float]:
    """Measure random trees with thin parts, and trees without."""
    trees, count, repeats = (5, 400, 2) if quick else (200, 800, 5)
    keys = ("thin_parts_lost", "thin_parts", "thin_cases", "thin_parts_over_memory", "thin_shares")
    figures = dict.fromkeys(keys, 0.0)
    ratios: list[float] = []
    for model in map(random_tree, range(trees)):
        before, _ = _scattered(model.tree, RESOLUTION, count)
        messages = _Messages()
        logger = logging.getLogger("blobtree.meshing.parts")
        logger.addHandler(messages)
        seconds, positions = _scattered(model.tree, None, count)
        logger.removeHandler(messages)
        bare, shares = _bare_parts(model, positions)
        over = _named_parts(model, messages.texts)
        lost = _parts_without_mesh(model) - over
        if not over:  # else its area, and so all shares, are not those of the surface
            lost |= bare
        figures["thin_cases"] += 1
        figures["thin_parts"] += len(_counted_parts(model))
        figures["thin_shares"] += shares
        figures["thin_parts_over_memory"] += len(over & _counted_parts(model))
        figures["thin_parts_lost"] += len(lost)
        if before > 0.0:
            ratios.append(seconds / before)
    figures["thin_cost"] = float(np.mean(ratios))
    figures["ridge_cost"] = _plain_cost([_bumpy_tree(32, sub, 0.9)], count, repeats)
    figures["plain_cost"] = _plain_cost(
        [_bumpy_tree(bumps, add, np.inf) for bumps in (1, 8, 32)], count, repeats
    )
    cut = [_bumpy_tree(bumps, sub, 0.9) for bumps in (1, 8)] + [_dented_ball(dents) for dents in (16, 32)]
    figures["plain_cut_cost"] = _plain_cost(cut, count, repeats)
    return figures


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


def _parts_without_mesh(model: ThinTree) -> set[int]:
    """Return the counted parts without mesh; all of them if the mesh is not closed."""
    mesh = polygonize(model.tree)
    counted = _counted_parts(model)
    if not is_closed(mesh.faces):
        return counted
    centers, areas = mesh_areas(mesh)
    return {
        number
        for number in counted
        if areas[model.parts[number].owns(centers)].sum() < LEAST_AREA * model.parts[number].area
    }


def _bare_parts(model: ThinTree, positions: Float64Array) -> tuple[set[int], int]:
    """Return the counted parts without their share of the decals, and how many were checked."""
    areas = np.array([part.area for part in model.parts])
    found = np.array([part.owns(positions).sum() for part in model.parts])
    expected = found.sum() * areas / areas.sum()
    wrong = np.abs(found - expected) > SHARE_ERROR * expected + 1.0
    checked = {number for number in _counted_parts(model) if expected[number] >= LEAST_DECALS}
    return {number for number in checked if wrong[number]}, len(checked)


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
