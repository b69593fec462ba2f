"""The data region of tapes: layout, and the same texels in cells, meshes and rays."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from blobtree import Node, Point, Polygonizer, Union, polygonize
from blobtree.cells import sparse_cells
from blobtree.cells.grid import aligned_grid
from blobtree.cells.sparse_cells import build_cells, split_tape
from blobtree.tape.data_region import DataRegion
from blobtree.tracing.trace import trace
from tests.blobtree.custom_kinds import Pair, Stew

PAIRS: Node = Pair((-1, 0, 0), radius=0.5, other=(1, 0, 0)) | Pair((0, -1, 0), radius=0.5, other=(0, 1, 0))


def balls(tree: Node) -> Node:
    """The same tree of points."""
    first, second = tree.children
    assert isinstance(first, Pair)
    assert isinstance(second, Pair)
    centers = (first.center, first.other, second.center, second.other)
    return Union(tuple(Point(center, radius=0.5) for center in centers))


def test_equal_blocks_are_stored_once() -> None:
    region = DataRegion()
    large = np.arange(4_000_000, dtype=np.float32)
    starts = [region.add(block) for block in ([0.0], [-0.0], large, [0.0], large.copy(), [0.0, 0.0])]
    assert starts == [0, 1, 2, 0, 2, 0]
    assert region.texels.shape == (1_000_002, 4)


def test_the_region_lies_in_front_of_the_instructions() -> None:
    tape = PAIRS.tape
    assert tape.start == 4
    np.testing.assert_array_equal(tape.data[:4, 0], [-1, 1, 0, 0])
    np.testing.assert_array_equal(tape.data[[5, 7], 0], [0, 2])
    assert tape.headers.tolist() == [4]
    span: Any = tape.on("cpu").span
    assert (span[0], span[1]) == (4, len(tape.data))
    assert (PAIRS | PAIRS.translate((0, 0, 1))).tape.start == 4, "the map is not in the data"
    assert Point((0, 0, 0), radius=1.0).tape.start == 0


def test_several_parameters_lie_in_the_region() -> None:
    first, second = Point((0, 0, 0), radius=1.0), Point((1, 0, 0), radius=1.0)
    one, other = (
        Stew((first, second), 0.1, 0.2, 0.3, 0.4, 0.5),
        Stew((first, second), 0.1, 0.2, 0.3, 0.4, 0.6),
    )
    tape = (one | one | other).tape
    assert tape.start == 4
    numbers = [0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(
        tape.data[:4].reshape(2, 8), [numbers, [*numbers[:4], 0.6, 0, 0, 0]], rtol=1e-6
    )


@pytest.mark.parametrize(
    "tree", [PAIRS, PAIRS.scale((1, 2, 1)), PAIRS.twist(40.0)], ids=["as_is", "scale", "twist"]
)
def test_fields_meshes_and_rays_read_the_region(tree: Node) -> None:
    other = {
        "Union": balls(PAIRS),
        "Transform": balls(PAIRS).scale((1, 2, 1)),
        "Twist": balls(PAIRS).twist(40.0),
    }
    same = other[type(tree).__name__]
    rng = np.random.default_rng(0)
    lower, upper = tree.support
    points = rng.uniform(lower, upper, (500, 3))
    np.testing.assert_allclose(tree(points), same(points), atol=1e-6)
    mesh, expected = polygonize(tree, resolution=24), polygonize(same, resolution=24)
    np.testing.assert_array_equal(mesh.faces, expected.faces)
    np.testing.assert_allclose(mesh.vertices, expected.vertices, atol=1e-5)
    origins = rng.normal(size=(300, 3)) * 4.0
    directions = rng.uniform(-1.0, 1.0, (300, 3)) - origins
    seen, expected_hits = trace(tree, origins, directions), trace(same, origins, directions)
    np.testing.assert_allclose(seen, expected_hits, atol=2e-2)  # rays that graze stop a little apart


def test_a_ray_that_starts_deep_inside_has_the_color_and_normal_there() -> None:
    tree = Pair((0, 0, 0), radius=1.0, other=(0.2, 0, 0), color=(1, 0, 0))
    inside = tree.raycast([(0.1, 0.2, 0.0)], [(1, 0, 0)])
    assert inside.distances.tolist() == [0.0]
    np.testing.assert_allclose(inside.colors, [(1, 0, 0)])
    np.testing.assert_allclose(np.linalg.norm(inside.normals, axis=1), 1.0, rtol=1e-5)


def test_an_edit_of_the_region_alone_changes_the_mesh() -> None:
    polygonizer = Polygonizer(PAIRS, cell_size=0.1)
    before = polygonizer.mesh
    first, second = PAIRS.children
    assert isinstance(first, Pair)
    tree = replace(first, other=(1.0, 0.0, 0.1)) | second
    np.testing.assert_array_equal(tree.tape.data[4:], PAIRS.tape.data[4:])
    after, expected = polygonizer.update(tree), polygonize(tree, cell_size=0.1)
    assert not np.array_equal(before.vertices, after.vertices)
    np.testing.assert_array_equal(after.faces, expected.faces)
    np.testing.assert_array_equal(after.vertices, expected.vertices)


def test_culled_tapes_have_the_region_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse_cells, "pieces_to_cull", lambda tape, _device: split_tape(tape))
    lower, upper = PAIRS.support
    cells = build_cells(PAIRS.tape, aligned_grid(lower, upper, 0.05))
    for level in cells.levels:
        np.testing.assert_array_equal(level.tape.numpy()[:4], PAIRS.tape.data[:4])
        assert int(level.spans.numpy().min()) >= 4
