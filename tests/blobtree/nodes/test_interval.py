"""Bounds of nodes over boxes, and the outline of a tree."""

import numpy as np
import pytest
from numpy.typing import ArrayLike

from blobtree import Point, Ricci, Segment
from blobtree.errors import InvalidPoints

BALL = Point((0, 0, 0), radius=1.0)


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
