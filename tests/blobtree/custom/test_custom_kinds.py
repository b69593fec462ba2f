"""Trees with custom skeletons and operators: what `tree_sets` does not cover."""

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from warp._src.context import user_modules

from blobtree import ISO, RIM, Node, Point, Polygonizer, polygonize
from blobtree.tape.instruction_set import core
from blobtree.tape.program import postorder
from blobtree.tracing.trace import trace
from tests.blobtree.custom_kinds import CUSTOM, CUSTOM_TREES, EVERYTHING, KINDS, Brick, Mean, Path, Ring, Soft
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid
from tests.blobtree.trees import BLENDED, SHAPES, SOLIDS, MoreKinds, points_around, random_trees
from tests.oracles import blobtree as oracle

POINTS = 120
ORIGIN = [[0.0, 0.0, 0.0]]
UNIT_RING = Ring((0, 0, 0), (0, 0, 1), 1.0, radius=0.2)


def test_the_random_trees_hold_every_custom_kind_and_maps_among_them() -> None:
    kinds = {type(node) for tree in CUSTOM_TREES for node in postorder(tree)}
    assert set(KINDS) <= kinds
    used = {tree.tape.instruction_set for tree in CUSTOM_TREES}
    assert EVERYTHING.tape.instruction_set in used
    assert sum(tree.tape.stretched for tree in CUSTOM_TREES) > 30


@pytest.mark.slow_cases("0-custom", "0-shapes", "0-blends")
@pytest.mark.parametrize(
    "kinds", [CUSTOM, SOLIDS, SHAPES, BLENDED], ids=["custom", "solids", "shapes", "blends"]
)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_no_ray_passes_through_unseen(seed: int, kinds: MoreKinds) -> None:
    """Against dense marching: never later than the first sample inside, and on the surface."""
    rng = np.random.default_rng(seed)
    hits = on_surface = 0
    for tree in random_trees(60 + seed, 8, depth=3, more=kinds):
        lower, upper = tree.support
        size = float(np.linalg.norm(upper - lower))
        origins = rng.normal(size=(60, 3))
        origins *= 2.0 * size / np.linalg.norm(origins, axis=1, keepdims=True)
        directions = rng.uniform(lower, upper, (60, 3)) - origins
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        seen = trace(tree, origins, directions)
        steps = np.linspace(0.0, 4.0 * size, 2001)
        places = origins[:, None] + steps[None, :, None] * directions[:, None]
        inside = tree(places.reshape(-1, 3)).reshape(60, -1) > ISO + 1e-4
        first = np.where(inside.any(axis=1), steps[inside.argmax(axis=1)], np.inf)
        assert (seen <= first + 2e-4 * size).all()
        hit = np.isfinite(seen)
        reached = tree(origins[hit] + seen[hit, None] * directions[hit])
        hits += int(hit.sum())
        on_surface += int((np.abs(reached - ISO) < 0.01).sum())
    assert hits > 40
    assert on_surface > 0.95 * hits


def test_a_ring_is_a_torus() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    around = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    np.testing.assert_allclose(UNIT_RING(around), 1.0, atol=1e-6)
    np.testing.assert_allclose(UNIT_RING(1.2 * around), ISO, atol=1e-6)
    np.testing.assert_allclose(UNIT_RING(around + np.array([0.0, 0.0, 0.2])), ISO, atol=1e-6)
    mesh = polygonize(UNIT_RING, resolution=60)
    assert len(mesh.vertices) == len(mesh.faces) // 2  # V − E + F = 0, one handle
    assert_on_torus(mesh.vertices)


def assert_on_torus(vertices: NDArray[np.float32]) -> None:
    x, y, z = vertices.astype(np.float64).T
    assert len(z) > 500
    np.testing.assert_allclose(np.hypot(np.hypot(x, y) - 1.0, z), 0.2, atol=2e-6)


@pytest.mark.slow
def test_every_way_to_a_mesh_knows_custom_kinds() -> None:
    half = 0.02
    mesh = polygonize(UNIT_RING, chord_error=half * 0.2)
    assert_closed(mesh)
    middles = mesh.vertices[mesh.faces].astype(np.float64).mean(axis=1)
    tube = np.hypot(np.hypot(*middles[:, :2].T) - 1.0, middles[:, 2])
    assert np.abs(tube - 0.2).max() <= half * 0.2
    cut = UNIT_RING - Brick((1, 0, 0), (0.2, 3, 3), radius=0.1)
    creased = polygonize(cut, resolution=40, creases=True)
    assert_closed(creased)
    faces = creased.vertices[(np.abs(creased.vertices[:, 0] - 0.8) < 1e-5)]
    assert len(faces) > 10  # the flat walls of the cut, up to their rims
    hits = UNIT_RING.raycast([[5, 0, 0]], [[-1, 0, 0]])
    np.testing.assert_allclose(hits.normals, [[1, 0, 0]], atol=1e-5)


@pytest.mark.gpu
@pytest.mark.parametrize("number", range(6))
def test_a_graphics_card_gives_the_same_surface(number: int) -> None:
    tree = [tree for tree in CUSTOM_TREES if tree.tape.instruction_set is not core()][number]
    with wp.ScopedDevice("cuda:0"):
        there = polygonize(tree, resolution=24, device="cuda:0")
        points = points_around(np.random.default_rng(1), tree, POINTS)
        np.testing.assert_allclose(tree(points), oracle.value(tree, points), atol=5e-5)
    assert_valid(there)
    assert_closed(there)


def test_an_edit_from_built_in_kinds_to_custom_ones_and_back_is_a_fresh_start() -> None:
    ball = Point((1, 0, 0), radius=0.4)
    solver = Polygonizer(ball | Point((-1, 0, 0), radius=0.4), cell_size=0.06)
    for tree in (ball | UNIT_RING, ball.translate((0, 0.3, 0)) | UNIT_RING, ball | ball.translate((0, 1, 0))):
        mesh, fresh = solver.update(tree), Polygonizer(tree, cell_size=0.06).mesh
        np.testing.assert_array_equal(mesh.vertices, fresh.vertices)
        np.testing.assert_array_equal(mesh.faces, fresh.faces)


@pytest.mark.parametrize("away", [0.0, 100.0])
def test_bounds_are_tight_around_a_custom_skeleton(away: float) -> None:
    reach = 0.2 / RIM
    place = np.array([away, 0.0, -away])
    ring = Ring(tuple(place), (0, 0, 1), 1.0, radius=0.2)
    half = np.array([1.0 + reach, 1.0 + reach, reach])
    for seen, exact in zip(ring.support, (place - half, place + half), strict=True):
        np.testing.assert_allclose(seen, exact, atol=0.012 + 1e-4 * away)
    point = Path((5, 5, 5), (5, 5, 5), (5, 5, 5), radius=0.2)
    np.testing.assert_allclose(point.support, [[5.0 - reach] * 3, [5.0 + reach] * 3], atol=2e-3)


def test_a_small_and_a_large_model() -> None:
    for scale in (1e-5, 1e5):
        ring = Ring((0, 0, 0), (0, 0, 1), scale, radius=0.2 * scale)
        mesh = polygonize(ring, resolution=40)
        assert_closed(mesh)
        assert_on_torus(mesh.vertices / scale)


def test_one_kind_many_primitives_is_one_run() -> None:
    rng = np.random.default_rng(8)
    rings = [Ring(tuple(p), (0, 0, 1), 0.1, radius=0.05) for p in rng.uniform(-1, 1, (500, 3)).tolist()]
    tree: Node = rings[0]
    for ring in rings[1:]:
        tree = tree + ring
    assert len(tree.tape.data) == 1 + 500 * 3  # two texels of parameters, one of colour
    points = rng.uniform(-1, 1, (200, 3))
    np.testing.assert_allclose(tree(points), oracle.value(tree, points), atol=2e-5)


def test_trees_of_built_in_kinds_have_the_built_in_instruction_set() -> None:
    assert (Point((0, 0, 0), radius=1.0) + Point((1, 0, 0), radius=1.0)).tape.instruction_set is core()
    assert UNIT_RING.tape.instruction_set is not core()
    assert UNIT_RING.skeleton in EVERYTHING.tape.instruction_set.skeletons


def test_edits_of_parameters_and_of_structure_load_no_kernel() -> None:
    ball = Point((1, 0, 0), radius=0.4)
    for first in (Soft((UNIT_RING, ball), 1.0), Brick((1, 0, 0), (1, 1, 1), radius=0.1)):
        look_at(first)  # the first use of a skeleton measures it
    before = loaded_kernels()
    look_at(Soft((Ring((0.2, 0, 0), (0, 1, 1), 0.6, radius=0.3), ball), 2.0))
    look_at(Mean((Brick((0, 0, 0), (1, 1, 1), radius=0.1), ball - UNIT_RING.scale((1, 2, 3)))))
    assert loaded_kernels() == before


def look_at(tree: Node) -> None:
    polygonize(tree, resolution=16)
    tree(ORIGIN), tree.gradient(ORIGIN), tree.colors(ORIGIN), tree.interval((0, 0, 0), (1, 1, 1))
    trace(tree, [[5, 0, 0]], [[-1, 0, 0]])


def loaded_kernels() -> dict[str, int]:
    """How often each of Warp's modules was loaded onto a device."""
    return {name: len(module.execs) for name, module in user_modules.items()}
