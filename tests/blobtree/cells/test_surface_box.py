"""The box of a surface: it holds the surface, and is small where the field is much larger."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blobtree import Node, Point, Polygonizer, Sum, polygonize, polygonize_batch, raycast_batch
from blobtree.cells.surface_box import MAX_SHARE, longest_side, surface_box
from blobtree.errors import InvalidNode
from blobtree.nodes.kinds import NODE_KINDS
from blobtree.nodes.primitives import Falling
from blobtree.tracing.tree_cells import tracing_cells
from tests.blobtree.trees import random_leaf
from tests.conformance import sample

WIDE = sorted(
    tag
    for tag, kind in NODE_KINDS.items()
    if issubclass(kind, Falling) and "width" in kind.__dataclass_fields__ and tag != "gyroid"
)
"""Kinds of primitives with a width; it changes where a `Gyroid` ends."""

BALLS = Point((0, 0, 0), radius=1.0, width=1.0) | Point((2.5, 0, 0), radius=1.0)


def pair(width: float) -> Node:
    return Point((0, 0, 0), radius=1.0, width=width) | Point((2.5, 0, 0), radius=1.0)


@pytest.mark.parametrize("width", [20.0, 100.0, 1e3, 1e4])
def test_a_wide_field_leaves_the_mesh_as_fine(width: float) -> None:
    lower, upper = pair(width).bounds
    assert np.abs(lower - (-1.0, -1.0, -1.0)).max() < 0.01
    assert np.abs(upper - (3.5, 1.0, 1.0)).max() < 0.01
    usual = len(polygonize(BALLS).vertices)
    assert len(polygonize(pair(width)).vertices) > 0.7 * usual
    close = polygonize(pair(width), chord_error=0.02)
    assert np.abs(close.vertices).max() == pytest.approx(3.5, abs=0.02)


@pytest.mark.parametrize("width", [20.0, 1e3])
def test_rays_are_as_exact_at_a_wide_field(width: float) -> None:
    tree, sides = pair(width), np.random.default_rng(0).uniform(-0.7, 0.7, (200, 2))
    origins = np.column_stack([sides, np.full(200, 5.0)])
    exact = 5.0 - np.sqrt(1.0 - (sides**2).sum(axis=1))
    away = np.tile((0.0, 0.0, -1.0), (200, 1))
    error = 1e-4 + 1e-6 * width  # float32 tells values of so flat a field no better apart
    assert np.abs(tree.raycast(origins, away).distances - exact).max() < error
    together = raycast_batch([tree, BALLS, tree], origins, away).distances.reshape(3, -1)
    assert np.abs(together - exact).max() < error
    assert tracing_cells(tree).lower.min() > -2.0


def test_meshes_of_many_trees_and_edits_are_those_of_one() -> None:
    trees = [pair(width) for width in (1.0, 50.0, 500.0)]
    for resolution in (None, 24):
        alone = [polygonize(tree, resolution=resolution) for tree in trees]
        assert polygonize_batch(trees, resolution=resolution) == alone
    polygonizer = Polygonizer(trees[0], cell_size=0.1)
    for tree in trees:
        assert polygonizer.update(tree) == polygonize(tree, cell_size=0.1)


@pytest.mark.parametrize("tag", WIDE)
def test_the_width_of_a_primitive_alone_does_not_change_its_box(tag: str) -> None:
    node: Any = sample(NODE_KINDS[tag], np.random.default_rng(3))
    lower, upper = node.bounds
    size = float((upper - lower).max())
    wide = replace(node, width=200.0 * size)
    assert longest_side(surface_box(wide)) < 3.0 * size
    assert np.abs(np.subtract(wide.bounds, (lower, upper))).max() < 0.08 * size


@pytest.mark.parametrize("seed", range(20))
def test_nothing_solid_lies_outside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    leaves: list[Any] = [random_leaf(rng) for _ in range(4)]
    widths = 10.0 ** rng.uniform(-0.5, 3.0, 4)
    leaves = [replace(leaf, width=float(width)) for leaf, width in zip(leaves, widths, strict=True)]
    tree = [Sum(*leaves), (leaves[0] | leaves[1]) - leaves[2] + leaves[3], leaves[0] & leaves[1]][seed % 3]
    lower, upper = surface_box(tree)
    assert surface_box(tree) is tree.support or longest_side((lower, upper)) <= MAX_SHARE * longest_side(
        tree.support
    )
    points = rng.normal(size=(40_000, 3)) * 10.0 ** rng.uniform(-1.0, 2.0, (40_000, 1))
    outside = ((points < lower) | (points > upper)).any(axis=1)
    assert (tree(points[outside]) < 0.5).all()


def test_ordinary_trees_have_the_box_of_their_field() -> None:
    for falloff in ("wyvill", "soft_object", "blanc_schlick", "metaball", "gaussian", "cauchy"):
        tree = Point((0.3, 0.2, 0.1), radius=1.0, falloff=falloff)
        assert surface_box(tree) is tree.support
    nothing = Point((0, 0, 0), radius=1.0, width=100.0) & Point((0, 0, 0), radius=1.0, weight=0.1)
    assert surface_box(nothing) is nothing.support
    with pytest.raises(InvalidNode, match="surface"):
        nothing.bounds  # noqa: B018
