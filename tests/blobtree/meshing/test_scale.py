"""Large, small, distant and deep models give the right mesh or a clear error."""

import numpy as np
import pytest

from blobtree import Node, Point, Polygonizer, Segment, Sum, Union, polygonize
from blobtree import device as memory
from blobtree.errors import InvalidResolution
from tests.blobtree.meshing.test_polygonize import BALL, assert_closed, assert_valid, euler, volume
from tests.blobtree.meshing.test_reuse import assert_same_bits


@pytest.mark.slow
def test_a_million_primitives() -> None:
    places = np.random.default_rng(0).uniform(0.0, 1.0, (1_000_000, 3)).tolist()
    tree = Sum(tuple(Point((x, y, z), radius=0.01) for x, y, z in places))
    polygonizer = Polygonizer(tree, resolution=64)
    assert_closed(polygonizer.mesh)
    assert euler(polygonizer.mesh) == 2
    assert 1.0 < volume(polygonizer.mesh) < 1.15
    x, y, z = places[0]
    moved = Sum((Point((x, y, z + 0.02), radius=0.01), *tree.operands[1:]))
    assert_same_bits(polygonizer.update(moved), polygonize(moved, cell_size=polygonizer.cell_size))


def test_distant_cells_that_float32_resolves_are_meshed() -> None:
    center = np.array([1e6, -1e6, 1e6])
    mesh = polygonize(Point(tuple(center.tolist()), radius=1000.0), resolution=40)
    assert_valid(mesh)
    assert_closed(mesh)
    radii = np.linalg.norm(mesh.vertices.astype(np.float64) - center, axis=1)
    assert np.abs(radii - 1000.0).max() <= 0.25  # four steps of float32 there


@pytest.mark.parametrize("resolution", [8, 64, 512])
def test_distant_cells_that_float32_does_not_resolve_are_refused(resolution: int) -> None:
    with pytest.raises(
        InvalidResolution, match=r"too far from the origin, 1e\+06: .*; move it to the origin"
    ):
        polygonize(BALL.translate((1e6, 0, 0)), resolution=resolution)


@pytest.mark.parametrize("scale", [1e-14, 1e-6, 1e6, 1e14])
def test_sizes_that_float32_can_square(scale: float) -> None:
    tree = (BALL - Segment((0, 0, -3), (0, 0, 3), radius=0.4)).scale(scale)
    mesh = polygonize(tree, resolution=40)
    assert_closed(mesh)
    assert euler(mesh) == 0
    assert volume(mesh) / scale**3 == pytest.approx(volume(polygonize(tree.scale(1.0 / scale))), rel=0.02)


@pytest.mark.parametrize("scale", [1e-30, 1e-20, 1e16])
def test_sizes_that_float32_cannot_square_are_refused(scale: float) -> None:
    with pytest.raises(InvalidResolution, match="float32 can square its distances: scale it"):
        polygonize(BALL.scale(scale))


def test_a_mesh_that_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    polygonizer = Polygonizer(BALL, resolution=40)
    mesh = polygonizer.mesh
    monkeypatch.setattr(memory, "available_memory", lambda _device: 3e4)
    with pytest.raises(InvalidResolution, match=r"would take .* GB, 3e-05 GB are free on cpu; take larger"):
        polygonizer.update(BALL.translate((0.3, 0.0, 0.0)))
    assert polygonizer.mesh is mesh
    with pytest.raises(InvalidResolution, match="the tapes of"):
        polygonize(BALL, resolution=1000)


def test_available_memory_is_plausible() -> None:
    there = memory.available_memory("cpu")
    assert there is None or 1e6 < there < 1e15


def deep(tip: Node, depth: int) -> Node:
    """A spine of unions, differences, maps and offsets that cannot be flattened."""
    rng = np.random.default_rng(depth)
    tree = tip
    for step, (x, y, z) in enumerate(rng.uniform(-2.0, 2.0, (depth // 4, 3)).tolist()):
        leaf = Point((x, y, z), radius=0.15)
        tree = (Union((tree, leaf)) if step % 2 else tree - leaf).translate((1e-4, 0, 0)).offset(1e-7)
        tree = tree + Point((x, -y, z), radius=0.1)
    return tree


@pytest.mark.slow
def test_a_tree_ten_thousand_levels_deep() -> None:
    tree = deep(BALL, 10_000)
    polygonizer = Polygonizer(tree, resolution=24)
    assert_closed(polygonizer.mesh)
    assert len(polygonizer.mesh.faces) > 1000
    again = deep(Point((0.1, 0.0, 0.0), radius=1.0), 10_000)
    assert_same_bits(polygonizer.update(again), polygonize(again, cell_size=polygonizer.cell_size))
