"""Bounds of nodes over boxes, and the outline of a tree."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from blobtree import Point, Ricci, Segment
from blobtree.errors import InvalidPoints
from tests.blobtree.tree_sets import FIRST_BATCHES, Batch

BALL = Point((0, 0, 0), radius=1.0)


@FIRST_BATCHES
def test_no_value_in_a_box_lies_outside_its_interval(batch: Batch) -> None:
    rng = np.random.default_rng(0)
    for tree in batch.trees:
        lower, upper = (corner.astype(np.float64) for corner in tree.support)
        for _ in range(8):
            a, b = np.sort(rng.uniform(lower, upper, (2, 3)), axis=0)
            b = a + (b - a) * rng.uniform(0.02, 1.0)
            smallest, largest = tree.interval(a, b)
            values = tree(rng.uniform(a, b, (200, 3)))
            assert smallest - 1e-6 <= values.min()
            assert values.max() <= largest + 1e-6


def test_intervals_of_one_point_are_close_and_exact_far_away() -> None:
    assert BALL.interval((5, 5, 5), (6, 6, 6)) == (0.0, 0.0)
    assert BALL.interval((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1))[1] == pytest.approx(1.0, abs=1e-4)
    here = BALL((0.5, 0.0, 0.0) * np.ones((1, 3)))[0]
    assert BALL.interval((0.5, 0, 0), (0.5, 0, 0)) == pytest.approx((here, here), abs=1e-4)


@pytest.mark.parametrize("box", [((1, 0, 0), (0, 1, 1)), ((0, 0), (1, 1)), ((0, 0, np.nan), (1, 1, 1))])
def test_invalid_boxes_are_refused(box: tuple[ArrayLike, ArrayLike]) -> None:
    with pytest.raises(InvalidPoints):
        BALL.interval(*box)


def test_an_outline_has_a_line_per_node() -> None:
    tree = Ricci((BALL, Segment((0, 0, 0), (1, 0, 0), radius=0.5)), exponent=2.0) - BALL.translate((1, 2, 3))
    lines = str(tree).splitlines()
    assert [line.split("(")[0] for line in lines] == [
        "Difference", "  Ricci", "    Point", "    Segment", "  Transform", "    Point",
    ]  # fmt: skip
    assert lines[1] == "  Ricci(exponent=2.0)"
    assert lines[2] == f"    {BALL!r}"
