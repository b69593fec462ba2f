"""Sets of random trees over which whatever holds of every tree is tested, in batches of twenty."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pytest

from blobtree import Node
from blobtree._typing import Float32Array
from tests.blobtree.custom_kinds import CUSTOM_TREES
from tests.blobtree.trees import (
    BLENDED,
    CONTACTS,
    DEFORMED,
    FIELDS,
    PROFILED,
    SHAPES,
    SIGNED,
    SOLIDS,
    RandomTrees,
    points_around,
)
from tests.oracles.blobtree import Field, evaluate

BATCH = 20
ORDINARY_TREES = 5
"""Number of trees in the first batch of a set, which ordinary runs take; slow runs take the others."""

POINTS = 150

BUILT_IN_TREES = RandomTrees(seed=1, count=160)
DEFORMED_TREES = RandomTrees(seed=51, count=60, depth=3, more=DEFORMED)
SOLID_TREES = RandomTrees(seed=21, count=60, more=SOLIDS)
FIELD_TREES = RandomTrees(seed=33, count=40, more=FIELDS)
SHAPE_TREES = RandomTrees(seed=41, count=60, more=SHAPES)
BLEND_TREES = RandomTrees(seed=51, count=60, depth=3, more=BLENDED)
CONTACT_TREES = RandomTrees(seed=31, count=40, depth=2, more=CONTACTS)
PROFILED_TREES = RandomTrees(seed=22, count=60, more=PROFILED)
SIGNED_TREES = RandomTrees(seed=23, count=60, more=SIGNED)
ANY_ORDER = 0.05
"""Superelliptic blends are not homogeneous, so their colours depend a little on the order of the operands."""

ANY_COLOR = 1.0
"""Colours of sums with fields below 0 depend on the order of their operands."""


@dataclass(frozen=True)
class Batch:
    """Some trees of a set, and how exact their fields are."""

    start: int
    count: int
    source: Sequence[Node]
    value_error: float
    color_error: float
    gradient_error: float = 1e-4

    @property
    def trees(self) -> Sequence[Node]:
        """The trees themselves, made at the first use."""
        return self.source[self.start : self.start + self.count]

    @cached_property
    def cases(self) -> list[tuple[Node, Float32Array]]:
        """The trees, each with points around it."""
        rng = np.random.default_rng(self.start)
        return [(tree, points_around(rng, tree, POINTS)) for tree in self.trees]

    @cached_property
    def fields(self) -> list[Field]:
        """The fields of `cases` in float64."""
        return [evaluate(tree, points) for tree, points in self.cases]


def _batches(trees: Sequence[Node], *errors: float, ordinary: int = ORDINARY_TREES) -> list[Batch]:
    starts = (0, ordinary, *range(BATCH, len(trees), BATCH))
    ends = (*starts[1:], len(trees))
    return [Batch(start, end - start, trees, *errors) for start, end in zip(starts, ends, strict=True)]


SETS = {
    "built_in": _batches(BUILT_IN_TREES, 1e-5, 2e-4),
    "solids": _batches(SOLID_TREES, 2e-5, 3e-4),
    "fields": _batches(FIELD_TREES, 2e-5, 3e-4, ordinary=10),  # of which one in three points has a colour
    "shapes": _batches(SHAPE_TREES, 2e-5, 3e-4, ordinary=3),
    "blends": _batches(BLEND_TREES, 2e-5, ANY_ORDER),
    "contacts": _batches(CONTACT_TREES, 2e-5, 3e-4),
    "deformed": _batches(DEFORMED_TREES, 2e-5, 3e-4),
    "profiled": _batches(PROFILED_TREES, 2e-5, 3e-4, ordinary=3),
    "signed": _batches(SIGNED_TREES, 2e-5, ANY_COLOR, 1e-3, ordinary=3),
    "custom": _batches(CUSTOM_TREES, 2e-5, 3e-4),
}
EVERY_BATCH = pytest.mark.parametrize(
    "batch",
    [
        pytest.param(batch, id=f"{name}-{batch.start}", marks=pytest.mark.slow if place else ())
        for name, batches in SETS.items()
        for place, batch in enumerate(batches)
    ],
)
FIRST_BATCHES = pytest.mark.parametrize("batch", [batches[0] for batches in SETS.values()], ids=SETS)
