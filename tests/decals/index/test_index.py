"""The index never misses a decal, whatever the sizes and wherever the scene; its memory is linear."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from decals import Decals, Interaction
from decals.errors import InvalidDecals
from decals.index import DecalEditor, DecalIndex
from decals.index.index import has_nested, index_on
from decals.record import NEIGHBOR_REACH


def near(rng: np.random.Generator, positions: NDArray[Any], influence: NDArray[Any], count: int) -> Any:
    """Points in, on and around the balls: most at up to 1.2 of their radius, many exactly on the sphere."""
    which = rng.integers(0, len(positions), count)
    v = rng.normal(size=(count, 3)) * rng.choice([0, 1], (count, 3), p=[0.3, 0.7])
    v /= np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-30)
    distance = np.where(rng.random(count) < 0.5, NEIGHBOR_REACH, NEIGHBOR_REACH * rng.uniform(0, 1.2, count))
    return (positions[which].astype(float) + v * (distance * influence[which])[:, None]).astype(np.float32)


def acting(point: Any, positions: NDArray[Any], influence: NDArray[Any]) -> Any:
    """Who acts at a point, by float32 arithmetic as on the device and by float64: either is enough."""
    w = point - positions
    narrow = (w * w).sum(axis=1) <= np.float32(NEIGHBOR_REACH**2) * influence * influence
    wide = ((point.astype(float) - positions) ** 2).sum(axis=1) <= (
        NEIGHBOR_REACH * influence.astype(float)
    ) ** 2
    return np.flatnonzero(narrow | wide)


def check(positions: NDArray[Any], influence: NDArray[Any], points: NDArray[Any]) -> Any:
    positions, influence = np.array(positions, np.float32).reshape(-1, 3), np.array(influence, np.float32)
    index = DecalIndex.build(positions, influence)
    offsets, ids = index.candidates(points)
    found = 0
    for i, point in enumerate(np.array(points, np.float32).reshape(-1, 3)):
        here = ids[offsets[i] : offsets[i + 1]]
        assert len(np.unique(here)) == len(here)
        wanted = acting(point, positions, influence)
        assert np.isin(wanted, here).all()
        found += len(wanted)
    return index, found


def two_sizes(rng: np.random.Generator) -> Any:
    return rng.random((2000, 3)), rng.choice([0.06, 0.11], 2000)


def uniform(rng: np.random.Generator) -> Any:
    return rng.random((2000, 3)), np.full(2000, 0.1)


def tiling(rng: np.random.Generator) -> Any:
    return rng.random((2000, 3)) * [1, 1, 0], rng.uniform(0.03, 0.05, 2000)


def six_decades(rng: np.random.Generator) -> Any:
    return rng.normal(size=(500, 3)) * 100, 10.0 ** rng.uniform(-3, 3, 500)


def nested(rng: np.random.Generator) -> Any:
    size = 10.0 ** rng.uniform(-3, 3, 500)
    return rng.normal(size=(500, 3)) * size[:, None], size


def coincident(rng: np.random.Generator) -> Any:
    return np.ones((500, 3)) * 0.3, rng.uniform(0.1, 0.2, 500)


def coincident_and_equal(rng: np.random.Generator) -> Any:
    return np.zeros((500, 3)), np.full(500, 1.0)


def far_away(rng: np.random.Generator) -> Any:
    return rng.random((500, 3)) + 1e6, rng.uniform(0.05, 1, 500)


def far_away_and_tiny(rng: np.random.Generator) -> Any:
    return rng.random((500, 3)) - 1e6, 10.0 ** rng.uniform(-5, -1, 500)


def two_clusters_far_apart(rng: np.random.Generator) -> Any:
    return rng.random((500, 3)) * 1e-3 + np.repeat([[0, 0, 0], [1e9, -1e9, 0]], 250, axis=0), np.full(
        500, 1e-4
    )


def on_cell_corners(rng: np.random.Generator) -> Any:
    return rng.integers(-3, 3, (500, 3)) * 0.5, 2.0 ** rng.integers(-3, 3, 500) / NEIGHBOR_REACH


def at_the_limits(rng: np.random.Generator) -> Any:
    return rng.choice([-(2.0**50), 0, 2.0**50], (50, 3)), 2.2 * 2.0 ** rng.integers(-50, 51, 50)


SETS = [uniform, tiling, six_decades, nested, coincident, coincident_and_equal, far_away, far_away_and_tiny]
SETS += [two_sizes, two_clusters_far_apart, on_cell_corners, at_the_limits]


@pytest.mark.parametrize("make", SETS)
def test_misses_nothing(make: Any) -> None:
    rng = np.random.default_rng(0)
    positions, influence = (np.array(values, np.float32) for values in make(rng))
    _, found = check(positions, influence, near(rng, positions, influence, 2000))
    assert found > 1000


coordinate = st.floats(-1e6, 1e6, width=32) | st.sampled_from(
    [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 0.575, 2.0**-120]
)
triple = st.tuples(coordinate, coordinate, coordinate)
size = st.floats(2.0**-20, 2.0**20, width=32)


@settings(max_examples=100)
@given(decals=st.lists(st.tuples(triple, size), max_size=8), seed=st.integers(0, 2**32 - 1))
def test_misses_nothing_of_any_few_decals(decals: Any, seed: int) -> None:
    positions = np.array([p for p, _ in decals], np.float32).reshape(-1, 3)
    influence = np.array([s for _, s in decals], np.float32)
    points = np.zeros((1, 3), np.float32)
    if decals:
        points = np.concatenate([positions, near(np.random.default_rng(seed), positions, influence, 20)])
    check(positions, influence, points)


def test_no_decals() -> None:
    index, _ = check(np.zeros((0, 3)), np.zeros(0), np.zeros((3, 3)))
    assert index.level_count == 0
    assert index.table.shape == (1, 4)


def test_one_decal_is_found_from_its_ball_and_nowhere_else() -> None:
    index = DecalIndex.build([[5, -3, 2]], [1.0])
    offsets, ids = index.candidates(
        np.array([[5, -3, 2], [5, -3, 2 + NEIGHBOR_REACH], [9, -3, 2], [np.nan, 0, 0], [np.inf, 0, 0]])
    )
    assert np.diff(offsets)[:3].tolist() == [1, 1, 0]
    assert ids[:2].tolist() == [0, 0]


def test_lists_ascend_within_each_level() -> None:
    rng = np.random.default_rng(3)
    index = DecalIndex.build(rng.random((3000, 3)), np.full(3000, 0.2))
    assert index.level_count == 1
    offsets, ids = index.candidates(rng.random((50, 3)))
    for i in range(50):
        assert (np.diff(ids[offsets[i] : offsets[i + 1]]) > 0).all()


def test_same_decals_make_the_same_index() -> None:
    rng = np.random.default_rng(4)
    positions, influence = six_decades(rng)
    first, second = (DecalIndex.build(positions, influence) for _ in range(2))
    for name in ("levels", "table", "ids"):
        assert np.array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.parametrize("make", SETS)
def test_memory_is_linear(make: Any) -> None:
    """At most 27 cells a decal: 54 numbers of its lists, and 4 slots of 16 bytes for each cell."""
    positions, influence = make(np.random.default_rng(5))
    index = DecalIndex.build(positions, influence)
    assert index.nbytes <= len(positions) * 27 * (2 * 4 + 4 * 16) + index.level_count * 16 + 64
    cells = (index.table[:, 0] >= 0).sum()
    assert 2 * cells < index.mask + 1


def test_probing_is_short() -> None:
    """Few slots are read per look-up: the hash spreads neighbouring cells."""
    rng = np.random.default_rng(6)
    index = DecalIndex.build(rng.random((20_000, 3)) * [1, 1, 0], np.full(20_000, 0.012))
    full = index.table[:, 0] >= 0
    ends = np.flatnonzero(~full)
    runs = np.diff(ends) - 1
    assert runs.max() < 60
    assert (runs * (runs + 1) / 2).sum() / full.sum() < 3.0


def test_the_layout_is_the_documented_one() -> None:
    """Walk the arrays by hand for one decal."""
    index = DecalIndex.build([[0.25, 0.25, 0.25]], [0.1 / NEIGHBOR_REACH])
    cells_per_unit, width = index.levels[0, :2]
    assert cells_per_unit * width == 1
    assert 0.1 < width <= 0.2001
    slots = index.table
    key = [int(np.floor(0.25 * cells_per_unit)) + (1 << 23)] * 3
    (row,) = np.flatnonzero((slots[:, :3] == key).all(axis=1))
    head = slots[row, 3]
    assert index.ids[head : head + 2].tolist() == [1, 0]


def test_lists_are_in_drawing_order() -> None:
    """Ascending by rank, then by number, within each level; levels know their lowest and highest rank."""
    rng = np.random.default_rng(5)
    positions, influence = rng.random((3000, 3)), rng.choice([0.05, 0.3], 3000)
    ranks = rng.integers(0, 5, 3000)
    index = DecalIndex.build(positions, influence, ranks)
    head, lists = 0, 0
    while head < len(index.ids):
        here = index.ids[head + 1 : head + 1 + index.ids[head]]
        assert here.tolist() == sorted(here, key=lambda i: (ranks[i], i))
        head, lists = head + 1 + len(here), lists + 1
    assert lists == (index.table[:, 0] >= 0).sum()
    assert index.levels[:, 2:].tolist() == [[0, 4]] * 2


def test_longest_lists_are_what_points_find() -> None:
    """As many as any point has candidates, level by level, and together no fewer."""
    rng = np.random.default_rng(8)
    positions = np.float32(rng.random((3000, 3)))
    influence = np.float32(10.0 ** rng.uniform(-2, -0.5, 3000))
    index = DecalIndex.build(positions, influence)
    assert len(index.longest_lists) == index.level_count > 3
    offsets, _ = index.candidates(np.float32(rng.random((20_000, 3))))
    most = np.diff(offsets).max()
    assert index.longest_lists.max() <= most <= index.longest_lists.sum()
    assert DecalIndex.build(np.zeros((0, 3)), np.zeros(0)).longest_lists.sum() == 0
    assert DecalIndex.build(np.zeros((70, 3)), np.ones(70)).longest_lists.tolist() == [70]


def test_hundreds_of_thousands_in_one_point() -> None:
    index = DecalIndex.build(np.zeros((200_000, 3)), np.full(200_000, 0.7))
    ids = index.candidates([[0.1, 0.1, 0.1]])[1]
    assert np.array_equal(ids, np.arange(200_000))


@pytest.mark.parametrize(
    ("counts", "joined"),
    [
        ((300, 300), 1),
        ((30, 0, 30), 2),
        ((30, 30, 30), 2),
        ((30, 30, 30, 30), 2),
        ((1, 1000), 1),
        ((100, 1000), 2),
        ((1, 0, 300, 300), 1),
        ((2, 1, 0, 0, 2000), 1),
        ((1000, 0, 0, 1), 2),
        ((300,), 1),
    ],
)
def test_sizes_join_while_cells_and_candidates_are_few(counts: Any, joined: Any) -> None:
    """Neighbouring sizes share a level, unless most decals would take too many cells for it.

    So do a few small decals, unless they lie close together.
    """
    rng = np.random.default_rng(2)
    exponents = np.repeat(np.arange(len(counts)) - 5, counts)
    positions = rng.random((len(exponents), 3)).astype(np.float32)
    influence = (0.65 * 2.0**exponents / NEIGHBOR_REACH).astype(np.float32)
    index, found = check(positions, influence, near(rng, positions, influence, 500))
    assert found > 100
    assert index.level_count == joined
    assert len(index.ids) - (index.table[:, 0] >= 0).sum() <= 24 * len(positions)


@pytest.mark.gpu
def test_the_same_on_a_cuda_device() -> None:
    rng = np.random.default_rng(6)
    positions = rng.random((5000, 3)).astype(np.float32)
    influence = (10.0 ** rng.uniform(-3, -0.5, 5000)).astype(np.float32)
    decals = Decals(positions, positions + 1, rng.normal(size=(5000, 3)), influence * 0.45)
    there = index_on(decals, "cuda:0")
    fetched = DecalIndex(there.levels.numpy(), there.table.numpy(), there.ids.numpy(), len(decals))
    here = DecalIndex.of(decals)
    points = near(rng, positions, influence, 2000)
    (starts, numbers), (same_starts, same_numbers) = fetched.candidates(points), here.candidates(points)
    np.testing.assert_array_equal(starts, same_starts)
    np.testing.assert_array_equal(numbers, same_numbers)


@pytest.mark.parametrize(
    ("positions", "influence", "ranks", "says"),
    [
        ([[0, 0, 0]] * 3, [1.0], 0, r"influence: expected shape \[3\], got \[1\]"),
        ([[0, 0, 0]] * 2, [1.0, 1.0], [0], r"ranks: expected shape \[2\], got \[1\]"),
        ([0, 0, 0], [1.0], 0, "positions: expected shape"),
        ([[0, np.nan, 0]], [1.0], 0, "positions: expected finite numbers"),
        ([[0, 0, 0]], [np.inf], 0, "influence: expected finite numbers"),
        ([[0, 0, 0]], [-1.0], 0, "influence: expected values from 0"),
        ([[0, 0, 0]], [1.0], -1, "ranks: expected numbers from 0"),
    ],
)
def test_refuses_arrays_that_are_no_decals(positions: Any, influence: Any, ranks: Any, says: str) -> None:
    with pytest.raises(InvalidDecals, match=says):
        DecalIndex.build(positions, influence, ranks)


def excess(decals: Decals) -> float:
    """Greatest of ka + √(k²a² + b² − a²) − D, in b, over contact decals of a rank with radii a ≤ b."""
    radii, k = decals.radii.astype(float), 0.21
    a, b = np.minimum.outer(radii, radii), np.maximum.outer(radii, radii)
    away = np.linalg.norm(decals.positions[:, None].astype(float) - decals.positions, axis=2)
    pairs = (
        ~np.eye(len(decals), dtype=bool)
        & (decals.ranks[:, None] == decals.ranks)
        & (decals.interactions == Interaction.PUSH)
    )
    nested = k * a + np.sqrt((k * a) ** 2 + b * b - a * a) - away
    return float((nested / b)[pairs].max(initial=-9.0))


@pytest.mark.slow
def test_nested_decals_are_found() -> None:
    """At once, by an editor, and by its edits of one decal and of many."""
    rng, found = np.random.default_rng(3), []
    for case in range(150):
        count = int(rng.integers(2, 30))
        places = rng.random((count, 3)).round(1) * [1, 1, 0.1] * rng.choice([1, 1, 100])
        radii = 10.0 ** rng.choice([-0.5, -1, rng.uniform(-3, 0), -0.99], count)
        layers, kinds = rng.integers(0, 3, (2, count)) if case % 2 else np.tile([[0], [1]], (1, count))
        frame = np.tile([[0, 0, 1.0]], (count, 1)), np.tile([[1.0, 0, 0]], (count, 1))
        decals = Decals(places, *frame, radii, layers=layers, interactions=kinds)
        expected = excess(decals)
        if abs(expected) < 1e-4:
            continue
        found.append(expected > 0)
        assert has_nested(index_on(decals, "cpu"), count) == found[-1]
        apart = -1000.0 * np.arange(1, count + 1)[:, None] * [1, 1, 1]
        editor = DecalEditor(decals.replace(positions=apart))
        assert editor.version
        assert not editor.nested
        if case % 3:
            editor.assign(np.arange(count), decals)
        else:
            for number in rng.permutation(count):
                editor.assign([number], decals[[number]])
        assert editor.version
        assert editor.nested == found[-1]
    assert 30 < sum(found) < len(found) - 30
