"""`polygonize_batch` and `raycast_batch` against loops of single calls, bit for bit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import warp as wp

import blobtree
from blobtree import (
    Mesh,
    Node,
    Point,
    Repeat,
    Sum,
    from_sdf,
    polygonize,
    polygonize_batch,
    raycast_batch,
)
from blobtree.cells import joint_cells, sparse_cells
from blobtree.cells.joint_cells import build_joint_cells, joint_tape
from blobtree.cells.sparse_cells import first_blocks
from blobtree.errors import InvalidDevice, InvalidNode, InvalidPoints, InvalidResolution
from blobtree.meshing import batch as mesh_batch
from blobtree.tape.evaluate_kernels import evaluate_values
from blobtree.tracing import Hits
from blobtree.tracing import batch as ray_batch
from blobtree.tracing.tables import device_tables, numpy_tables
from blobtree.tracing.tree_cells import block_counts, cells_grid
from tests.blobtree.trees import BLENDED, CONTACTS, DEFORMED, FIELDS, MoreKinds, points_around, random_trees

CELLS = 12
NOWHERE = Point((0, 0, 0), radius=1.0) & Point((9, 0, 0), radius=1.0)
NAMES = "distances", "positions", "normals", "colors"


def rays_around(seed: int, count: int = 40) -> tuple[Any, Any]:
    """Rays that begin outside and inside of trees near the origin."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(count, 3)) * rng.choice([0.2, 5.0], (count, 1))
    return origins, rng.normal(size=(count, 3)) * 0.3 - origins / 5.0


def assert_same_meshes(found: Sequence[Mesh], trees: Sequence[Node], **options: Any) -> None:
    expected = [polygonize(tree, **options) for tree in trees]
    assert len(found) == len(expected)
    for mesh, alone in zip(found, expected, strict=True):
        for name in ("vertices", "faces", "normals", "colors"):
            assert getattr(mesh, name).dtype == getattr(alone, name).dtype
            assert getattr(mesh, name).tobytes() == getattr(alone, name).tobytes()


def assert_same_hits(found: Sequence[Hits], trees: Sequence[Node], rays: Sequence[tuple[Any, Any]]) -> None:
    assert len(found) == len(trees)
    for number, (tree, pair) in enumerate(zip(trees, rays, strict=True)):
        alone = tree.raycast(*pair)
        for name in NAMES:
            assert getattr(found[number], name).tobytes() == getattr(alone, name).tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_batches_are_loops(seed: int) -> None:
    trees = [*random_trees(seed, 6, depth=3), NOWHERE]
    assert_same_meshes(polygonize_batch(trees, resolution=CELLS), trees, resolution=CELLS)
    assert_same_meshes(polygonize_batch(trees, cell_size=0.3), trees, cell_size=0.3)
    rays = [rays_around(7 * seed + number, 10 * number) for number in range(len(trees))]
    batch = raycast_batch(trees, [pair[0] for pair in rays], [pair[1] for pair in rays])
    assert_same_hits(batch, trees, rays)
    assert batch.offsets.tolist() == [5 * number * (number - 1) for number in range(8)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "more", [BLENDED, CONTACTS, DEFORMED, FIELDS], ids=("blends", "contacts", "deformed", "fields")
)
def test_batches_of_library_kinds_are_loops(more: MoreKinds) -> None:
    trees = random_trees(5, 6, depth=2, more=more)
    assert_same_meshes(polygonize_batch(trees, resolution=CELLS), trees, resolution=CELLS)
    rays = rays_around(1)
    assert_same_hits(raycast_batch(trees, *rays), trees, [rays] * len(trees))


def test_default_cells_show_thin_parts_too() -> None:
    thin = Point((0, 0, 0), radius=1.0) | Point((4, 0, 0), radius=0.02)
    pair = Point((0, 0, 0), radius=1.0) | Point((2.001, 0, 0.3), radius=1.0)
    near = Point((0, 0, 0), radius=1.0) | Point((1.4146, 1.4146, 0.03), radius=1.0)
    trees = [Point((0, 0, 0), radius=1.0), thin, Point((0, 0, 0), radius=2.0), pair, near]
    assert_same_meshes(polygonize_batch(trees), trees)


def volumes(count: int) -> list[Node]:
    """Trees with data regions that differ: samples of distances, and radii of blends."""
    axis = np.linspace(-1.5, 1.5, 7)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    trees: list[Node] = []
    for number in range(count):
        radius = 0.6 + 0.1 * number
        ball = from_sdf(np.sqrt(x**2 + y**2 + z**2) - radius, spacing=0.5, lower=(-1.5,) * 3, width=0.5)
        trees.append(ball + Point((radius, 0, 0), radius=0.5))
    return trees


def test_data_regions_are_found() -> None:
    """The joint tape gives the values of each tree, also where its instructions name texels of a region."""
    kinds = (BLENDED, CONTACTS, FIELDS)
    trees = [*volumes(3), *(tree for more in kinds for tree in random_trees(2, 8, depth=3, more=more))]
    groups: dict[int, list[Node]] = {}
    for tree in trees:
        groups.setdefault(id(tree.tape.instruction_set), []).append(tree)
    moved = 0
    for group in groups.values():
        tape, spans = joint_tape(group)
        moved += tape.start > group[0].tape.start
        texels: Any = wp.array(tape.data, dtype=wp.vec4, device="cpu")
        kernel = tape.instruction_set.kernel_for(evaluate_values)
        for tree, span in zip(group, spans.tolist(), strict=True):
            points = points_around(np.random.default_rng(0), tree, 50)
            found: Any = wp.zeros(50, dtype=wp.float32, device="cpu")
            inputs = [wp.array(points, dtype=wp.vec3, device="cpu"), texels, wp.vec2i(*span)]
            wp.launch(kernel, 50, inputs=inputs, outputs=[found], device="cpu")
            assert found.numpy().tobytes() == tree(points).tobytes()
    assert moved


@pytest.mark.slow
def test_batches_of_volumes_are_loops() -> None:
    trees = volumes(4)
    assert_same_meshes(polygonize_batch(trees, resolution=CELLS), trees, resolution=CELLS)
    rays = rays_around(3)
    assert_same_hits(raycast_batch(trees, *rays), trees, [rays] * 4)


def test_flat_trees_of_many_primitives_are_traced_as_alone() -> None:
    """Their blocks are finer than those of other trees."""
    row = Repeat(Point((-2, 0, 0), radius=0.3), (1, 0, 0), 100)
    trees = [Point((0, 0, 0), radius=1.0), row, Repeat(row, (0, 1, 0), 2), Point((0, 0, 0), radius=1.5)]
    rays = rays_around(2)
    assert_same_hits(raycast_batch(trees, *rays), trees, [rays] * 4)


def test_an_enormous_tree_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    enormous = Sum(tuple(Point(place, radius=0.3) for place in rng.uniform(-2, 2, (3000, 3))))
    trees = [Point((0, 0, 0), radius=1.0), enormous, Point((0, 0, 0), radius=1.5)]
    joint: list[int] = []

    def counting(models: Sequence[Node], *more: Any) -> Any:
        joint.append(len(models))
        return build_joint_cells(models, *more)

    for module in (mesh_batch, ray_batch):
        monkeypatch.setattr(module, "build_joint_cells", counting)
    assert_same_meshes(polygonize_batch(trees, resolution=CELLS), trees, resolution=CELLS)
    rays = rays_around(0)
    assert_same_hits(raycast_batch(trees, *rays), trees, [rays] * 3)
    assert joint == [2, 2]


@pytest.mark.parametrize(("module", "limit"), [(joint_cells, 40), (sparse_cells, 3300)])
def test_what_does_not_fit_is_divided(monkeypatch: pytest.MonkeyPatch, module: Any, limit: int) -> None:
    trees = random_trees(4, 8, depth=2)
    rays = rays_around(2)
    expected = polygonize_batch(trees, resolution=CELLS), raycast_batch(trees, *rays)
    monkeypatch.setattr(module, "MAX_TEXELS" if module is joint_cells else "MAX_BLOCKS", limit)
    assert polygonize_batch(trees, resolution=CELLS) == expected[0]
    if module is joint_cells:
        assert raycast_batch(trees, *rays).distances.tobytes() == expected[1].distances.tobytes()


def test_parts_of_a_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    trees = random_trees(4, 7, depth=2)
    rays = rays_around(2)
    expected = polygonize_batch(trees, resolution=CELLS), raycast_batch(trees, *rays)
    monkeypatch.setattr(mesh_batch, "MAX_JOINT_BLOCKS", 200)
    monkeypatch.setattr(ray_batch, "MAX_JOINT_RAYS", 90)
    assert polygonize_batch(trees, resolution=CELLS) == expected[0]
    assert raycast_batch(trees, *rays).positions.tobytes() == expected[1].positions.tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_tables_of_kernels_are_those_of_numpy(seed: int) -> None:
    trees = [*random_trees(seed, 3, depth=2), NOWHERE, Point((0, 0, 0), radius=1.0).scale((1, 3, 9))]
    trees = [tree for tree in trees if tree.tape.instruction_set is trees[0].tape.instruction_set]
    grids = [cells_grid(*tree.support) for tree in trees]
    cells = build_joint_cells(trees, grids, "cpu")
    counts = np.array(
        [block_counts(*tree.support, 4.0 * grid.cell_size) for tree, grid in zip(trees, grids, strict=True)]
    )
    (found, starts), (expected, same) = (make(cells, counts, 100) for make in (device_tables, numpy_tables))
    np.testing.assert_array_equal(found.numpy(), expected.numpy())
    np.testing.assert_array_equal(starts, same)


def test_first_blocks_are_in_the_order_of_keys() -> None:
    places = first_blocks(5000, 0)
    digits = [(places // 4**digit % 4) @ (16, 4, 1) * 64**digit for digit in range(4)]
    assert np.sum(digits, axis=0).tolist() == list(range(5000))
    np.testing.assert_array_equal(first_blocks(5000, 3), 64 * places)


def test_no_tree() -> None:
    assert polygonize_batch([]) == []
    batch = raycast_batch([], [0, 0, 5], [0, 0, -1])
    assert len(batch) == 0
    assert batch.offsets.tolist() == [0]
    assert batch.positions.shape == (0, 3)
    assert batch[:] == []


def test_forms_of_rays() -> None:
    trees = [Point((0, 0, 0), radius=radius) for radius in (1.0, 2.0)]
    shared = raycast_batch(trees, [0, 0, 5], [0, 0, -1])
    np.testing.assert_allclose(shared.distances, [4, 3], atol=1e-4)
    eyes = [[[0, 0, 5], [0, 0, 6]], [[0, 0, 7], [0, 0, 8]]]
    mixed = raycast_batch(trees, eyes, [[0, 0, -1], [0, 0, -1]])
    np.testing.assert_allclose(mixed.distances.reshape(2, 2), [[4, 5], [5, 6]], atol=1e-4)
    assert (
        raycast_batch(trees, np.array(eyes), [[0, 0, -1]] * 2).distances.tolist() == mixed.distances.tolist()
    )
    starts: Any = [[], [[0, 0, 5]]]
    ways: Any = [np.zeros((0, 3)), [[0, 0, -1]]]
    none = raycast_batch(trees, starts, ways)
    assert none.offsets.tolist() == [0, 0, 1]
    assert [len(part) for part in mixed[-2:]] == [2, 2]
    with pytest.raises(IndexError):
        mixed[2]


@pytest.mark.parametrize(
    ("wrong", "error", "says"),
    [
        ({"trees": Point((0, 0, 0), radius=1.0)}, InvalidNode, "trees: expected several BlobTree nodes"),
        ({"trees": 5}, InvalidNode, "trees: expected several BlobTree nodes, got 5"),
        (
            {"trees": [Point((0, 0, 0), radius=1.0), "ball"]},
            InvalidNode,
            r"trees\[1\]: tree: expected a Blob",
        ),
        ({"origins": [[[0, 0, 5]]] * 3}, InvalidPoints, "origins: expected one array for each of 2 trees"),
        (
            {"origins": [[[0, 0, 5]], [[0, 0, np.nan]]]},
            InvalidPoints,
            r"rays of trees\[1\]: points: expected",
        ),
        ({"directions": [[0, 0, 0]]}, InvalidPoints, "directions: expected vectors with a length"),
        ({"directions": [[0, 0, 1]] * 2}, InvalidPoints, "directions: expected one per origin"),
        ({"directions": "down"}, InvalidPoints, "points: expected an array"),
        ({"device": "abacus"}, InvalidDevice, "device: expected a Warp device"),
    ],
)
def test_refuses_rays(wrong: dict[str, Any], error: type[Exception], says: str) -> None:
    trees = [Point((0, 0, 0), radius=1.0), Point((0, 0, 0), radius=2.0)]
    arguments: dict[str, Any] = {"trees": trees, "origins": [[0, 0, 5]], "directions": [[0, 0, -1]]}
    with pytest.raises(error, match=says):
        raycast_batch(**(arguments | wrong))


@pytest.mark.parametrize(
    ("wrong", "error", "says"),
    [
        ({"trees": 5}, InvalidNode, "trees: expected several"),
        ({"resolution": 0}, InvalidResolution, r"trees\[0\]: resolution: expected a whole number"),
        ({"resolution": 9, "cell_size": 0.1}, InvalidResolution, "expected either resolution or cell_size"),
        ({"cell_size": 1e-9}, InvalidResolution, r"trees\[0\]: cell_size: expected at most"),
        ({"device": 5.5}, InvalidDevice, "device: expected a Warp device"),
    ],
)
def test_refuses_meshes(wrong: dict[str, Any], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        polygonize_batch(**({"trees": [Point((0, 0, 0), radius=1.0)] * 2} | wrong))


def test_a_batch_is_cancelled() -> None:
    with pytest.raises(blobtree.errors.Cancelled):
        polygonize_batch([Point((0, 0, 0), radius=1.0)] * 3, resolution=CELLS, cancel=lambda: True)


@pytest.mark.gpu
def test_batches_are_loops_on_a_card() -> None:
    trees = [*random_trees(1, 40, depth=3), NOWHERE]
    found = polygonize_batch(trees, resolution=CELLS, device="cuda")
    assert_same_meshes(found, trees, resolution=CELLS, device="cuda")
    rays = rays_around(1, 500)
    batch = raycast_batch(trees, *rays, device="cuda")
    for tree, hits in zip(trees, batch, strict=True):
        alone = tree.raycast(*rays, device="cuda")
        assert all(getattr(hits, name).tobytes() == getattr(alone, name).tobytes() for name in NAMES)
