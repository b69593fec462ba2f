"""Edges of polygons that meet, against all pairs of edges."""

import time

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Prism
from blobtree.errors import InvalidNode
from blobtree.nodes.crossings import TOUCH, meeting_edges

Floats = NDArray[np.float64]


def cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def meeting_pairs(points: Floats) -> set[tuple[int, int]]:
    """All pairs of edges that meet where they should not."""
    count, pairs = len(points), set()
    ends = np.roll(points, -1, axis=0)
    for first in range(count):
        rest = np.arange(first + 1, count)
        a, b, c, d = points[first], ends[first], points[rest], ends[rest]
        sides = [cross(b - a, c - a), cross(b - a, d - a), cross(d - c, a - c), cross(d - c, b - c)]
        c_ab, d_ab, a_cd, b_cd = (np.where(np.abs(side) <= TOUCH, 0.0, side) for side in sides)
        overlap = (np.minimum(a, b) <= np.maximum(c, d)) & (np.minimum(c, d) <= np.maximum(a, b))
        meet = (c_ab * d_ab <= 0.0) & (a_cd * b_cd <= 0.0) & overlap.all(axis=1)
        neighbours = (rest == first + 1) | ((first == 0) & (rest == count - 1))
        folded = (c_ab == 0.0) & (d_ab == 0.0) & (((b - a) * (d - c)).sum(axis=1) < 0.0)
        short = (c == d).all(axis=1) | bool((a == b).all())
        pairs |= {(first, int(other)) for other in rest[np.where(neighbours, folded | short, meet)]}
    return pairs


def star(rng: np.random.Generator, count: int) -> Floats:
    """Corners at random radii around the origin, whose edges do not cross."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
    return np.asarray(rng.uniform(0.2, 1.0, (count, 1)) * np.column_stack([np.cos(angles), np.sin(angles)]))


def comb(count: int, angle: float) -> Floats:
    """Narrow teeth side by side, turned by an angle."""
    x = np.repeat(np.arange(count // 2), 2)
    y = np.tile([0.0, 1.0, 1.0, 0.0], count)[: len(x)] * 0.99 + 0.01
    corners = np.vstack([np.column_stack([x / x[-1], y]), [[1.0, 0.0], [0.0, 0.0]]])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.asarray(corners @ turn)


def on_grid(rng: np.random.Generator, count: int) -> Floats:
    """Corners on a coarse grid, where many touch edges and each other."""
    return np.asarray(rng.integers(0, 5, (count, 2)) / 4.0)


@pytest.mark.parametrize("seed", range(300))
def test_edges_meet_as_all_pairs_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 12))
    moved = star(rng, 3 * count)
    moved[rng.integers(len(moved))] *= -1.0
    touching = star(rng, count + 2)
    touching[0] = 0.5 * (touching[count // 2] + touching[count // 2 + 1])
    for points in (
        on_grid(rng, count),
        star(rng, 4 * count),
        moved,
        touching,
        rng.uniform(-1, 1, (count, 2)),
    ):
        expected, found = meeting_pairs(points), meeting_edges(points)
        assert (found is None) == (not expected), points
        assert found is None or found in expected


@pytest.mark.parametrize("angle", [0.0, 0.5 * np.pi, 0.7])
def test_combs_and_their_damage(angle: float) -> None:
    teeth = comb(400, angle)
    assert meeting_edges(teeth) is None
    teeth[[100, 300]] = teeth[[300, 100]]
    assert meeting_edges(teeth) in meeting_pairs(teeth)


def test_time_grows_hardly_faster_than_the_corners() -> None:
    seconds = []
    for count in (1000, 16_000):
        polygons = star(np.random.default_rng(0), count), comb(count, 0.7)
        start = time.process_time()
        assert [meeting_edges(polygon) for polygon in polygons] == [None, None]
        seconds.append(time.process_time() - start)
    assert seconds[1] < 64 * seconds[0]  # 16 and a half for n log n, 256 for all pairs


def test_large_prisms_are_made_or_refused() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 5000, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    assert Prism(tuple(map(tuple, circle.tolist())), 1.0).height == 1.0
    circle[[1000, 3000]] = circle[[3000, 1000]]
    with pytest.raises(InvalidNode, match="points: expected a simple polygon"):
        Prism(tuple(map(tuple, circle.tolist())), 1.0)
