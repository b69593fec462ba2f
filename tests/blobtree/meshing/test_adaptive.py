"""Adaptive cells: closed meshes within a chord error, of few triangles where the surface bends unevenly."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blobtree import Difference, Mesh, Node, Point, Segment, Sum, Union, polygonize
from blobtree._typing import BoolArray, Int32Array
from blobtree.meshing import leaf_changes
from blobtree.meshing.adaptive_cells import SIMPLE, Leaves
from blobtree.meshing.adaptive_mesh import _is_closed, _torn_vertices
from blobtree.meshing.crumbs import _pieces, without_crumbs
from blobtree.meshing.patches import PATCH_COUNT
from tests.blobtree.meshing.test_chord import BALL, CUT, points_on
from tests.blobtree.meshing.test_polygonize import assert_closed, assert_valid, euler, volume
from tests.blobtree.trees import random_trees

MIXED = BALL + Point((1.1, 0, 0), radius=0.1) + Point((0, 1.05, 0), radius=0.06)
"""A large ball with small bumps."""


def assert_two_manifold(mesh: Mesh) -> None:
    """Closed, and around each vertex one fan of triangles: counted by hand, vertex by vertex."""
    assert_closed(mesh)
    following: dict[int, dict[int, int]] = {}
    for face in mesh.faces.tolist():
        for a, b, c in (face, face[1:] + face[:1], face[2:] + face[:2]):
            following.setdefault(a, {})[b] = c
    for fan in following.values():
        start = at = next(iter(fan))
        steps = 0
        while at != start or steps == 0:
            at, steps = fan[at], steps + 1
        assert steps == len(fan)


def largest_distance(tree: Node, mesh: Mesh) -> float:
    """Distance of points of the triangles to the surface, along the gradient."""
    points = points_on(mesh, each=6)
    steepness = np.maximum(np.linalg.norm(tree.gradient(points), axis=1), 1e-6)
    return float((np.abs(tree(points) - 0.5) / steepness).max())


@pytest.mark.parametrize(
    ("tree", "error", "creases"),
    [(MIXED, 0.004, False), (CUT, 0.02, False), (CUT, 0.01, True)],
    ids=["bumps", "cut", "creases"],
)
def test_a_mesh_is_a_manifold_within_its_error_on_the_surface(
    tree: Node, error: float, creases: bool
) -> None:
    mesh = polygonize(tree, chord_error=error, creases=creases)
    assert_valid(mesh)
    assert_two_manifold(mesh)
    assert euler(mesh) == 2
    assert volume(mesh) > 0.0
    assert largest_distance(tree, mesh) <= 1.05 * error
    assert np.abs(tree(mesh.vertices) - 0.5).max() <= 1e-5


def test_uneven_curvature_takes_few_triangles() -> None:
    adaptive, uniform = (polygonize(MIXED, chord_error=0.004, adaptive=a) for a in (True, False))
    assert 3 * len(adaptive.faces) < len(uniform.faces)
    assert euler(adaptive) == euler(uniform) == 2


def test_even_curvature_takes_as_many_triangles_as_equal_cells() -> None:
    adaptive, uniform = (polygonize(BALL, chord_error=0.002, adaptive=a) for a in (True, False))
    assert len(adaptive.faces) < 1.3 * len(uniform.faces)


def test_parts_between_the_first_cells_are_found() -> None:
    """A ball as wide as a cell of the first pass, far from another one."""
    tree = Union((BALL, Point((3.0, 0.02, 0.03), radius=0.08)))
    mesh = polygonize(tree, chord_error=0.01)
    assert euler(mesh) == 4


def test_a_handle_keeps_its_hole() -> None:
    tree = Difference(BALL, Segment((0, 0, -3), (0, 0, 3), radius=0.15))
    mesh = polygonize(tree, chord_error=0.02, creases=True)
    assert_two_manifold(mesh)
    assert euler(mesh) == 0
    assert (np.asarray(mesh.sheet_counts) == 2).sum() > 20


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("creases", [False, True])
def test_random_trees(seed: int, creases: bool) -> None:
    surfaces = 0
    for tree in random_trees(seed=60 + seed, count=6, depth=3):
        error = float((tree.support[1] - tree.support[0]).max()) / 200
        mesh = polygonize(tree, chord_error=error, creases=creases)
        assert_valid(mesh)
        if len(mesh.faces) == 0:
            continue
        surfaces += 1
        assert_two_manifold(mesh)
        assert volume(mesh) > 0.0
        assert largest_distance(tree, mesh) <= 1.1 * error
    assert surfaces >= 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_topology_of_smooth_trees_is_that_of_fine_equal_cells(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [
        Point(tuple(rng.uniform(-1, 1, 3)), radius=float(10.0 ** rng.uniform(-1.2, -0.3))) for _ in range(12)
    ]
    tree = Sum(tuple(parts))
    mesh, fine = polygonize(tree, chord_error=0.004), polygonize(tree, resolution=160)
    assert_two_manifold(mesh)
    assert euler(mesh) == euler(fine)
    assert volume(mesh) == pytest.approx(volume(fine), rel=0.02)


def _meshes_both_ways(tree: Node, error: float, creases: bool, monkeypatch: pytest.MonkeyPatch) -> list[Mesh]:
    """Return the meshes whose polygons are counted anew beside changes alone, and everywhere."""
    meshes = []
    for limit in (leaf_changes.MAX_CHANGES, -1):
        monkeypatch.setattr(leaf_changes, "MAX_CHANGES", limit)
        meshes.append(polygonize(tree, chord_error=error, creases=creases))
    return meshes


def _blobs(seed: int, count: int) -> Node:
    rng = np.random.default_rng(seed)
    return Sum(
        tuple(Point(tuple(rng.uniform(-1, 1, 3)), radius=float(rng.uniform(0.03, 0.2))) for _ in range(count))
    )


def test_a_local_rebuild_gives_the_mesh_of_a_full_one(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = 0
    of_leaves = leaf_changes.LeafChanges.of_leaves

    def counted(changes: leaf_changes.LeafChanges, leaves: Leaves) -> NDArray[np.uint8]:
        nonlocal kept
        nearness = of_leaves(changes, leaves)
        kept += int((nearness == leaf_changes.FAR).sum())
        return nearness

    monkeypatch.setattr(leaf_changes.LeafChanges, "of_leaves", counted)
    local, full = _meshes_both_ways(_blobs(1, 40), 4e-3, False, monkeypatch)
    assert kept > len(local.vertices)
    np.testing.assert_array_equal(local.vertices, full.vertices)
    np.testing.assert_array_equal(local.faces, full.faces)


@pytest.mark.slow
@pytest.mark.parametrize("creases", [False, True])
def test_a_local_rebuild_of_random_trees(creases: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    trees = [*random_trees(seed=7, count=4, depth=3), _blobs(2, 100)]
    for tree in trees:
        error = float((tree.support[1] - tree.support[0]).max()) / 500
        local, full = _meshes_both_ways(tree, error, creases, monkeypatch)
        np.testing.assert_array_equal(local.vertices, full.vertices)
        np.testing.assert_array_equal(local.faces, full.faces)


# -- the choice of leaves, and the test for manifolds --------------------------------------------------


def test_simple_codes_have_one_patch() -> None:
    """The whole inside and the whole outside are simple too, without a patch."""
    assert SIMPLE[0]
    assert SIMPLE[255]
    assert (PATCH_COUNT[:256][SIMPLE] == (np.arange(256)[SIMPLE] % 255 > 0)).all()
    assert not SIMPLE[0b10000001]
    assert not SIMPLE[0b00001001]
    assert SIMPLE[0b00001111]


TETRAHEDRON = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)


def _flags(faces: Int32Array, count: int) -> BoolArray:
    flags = np.zeros(count, bool)
    flags[_torn_vertices(faces, np.ones(count, bool))] = True
    assert _is_closed(faces, count) >= (not flags.any())
    for vertex in range(count):
        assert (len(_torn_vertices(faces, np.arange(count) == vertex)) > 0) >= flags[vertex]
    return flags


def test_torn_vertices_are_found() -> None:
    assert not _flags(TETRAHEDRON, 4).any()
    two = np.concatenate([TETRAHEDRON, TETRAHEDRON + 4])
    assert not _flags(two, 8).any()
    pinched = np.where(two == 4, 0, two)
    assert np.flatnonzero(_flags(pinched, 8)).tolist() == [0, 4]  # 4 is no longer used
    assert _flags(TETRAHEDRON[:3], 4)[1:].all()  # open
    assert not _is_closed(TETRAHEDRON[:3], 4)
    assert _flags(np.concatenate([TETRAHEDRON, TETRAHEDRON[:, ::-1]]), 4).all()  # edges of four triangles


def test_no_crumbs_float_off_a_sharp_rim() -> None:
    """The rim of a lens is thinner than any cell; samples in it may lie alone."""
    lens = (Point((0, 0, 0), radius=1.0) & Point((1.9, 0, 0), radius=1.0)).rotate((1, 2, 3), 33)
    mesh = polygonize(lens, chord_error=0.01)
    assert_closed(mesh)
    assert_valid(mesh)
    assert len(np.unique(_pieces(mesh.faces, len(mesh.vertices)))) == 1


def test_small_pieces_go_where_they_lie_beside_a_larger_one() -> None:
    ball = polygonize(Point((0, 0, 0), radius=1.0), resolution=16)
    count = len(ball.vertices)
    offsets = [np.zeros(3), 1.012 * ball.vertices[0], 1.2 * ball.vertices[0]]
    places = [ball.vertices * (0.005 if number else 1.0) + offset for number, offset in enumerate(offsets)]
    together = replace(
        ball,
        vertices=np.concatenate(places).astype(np.float32),
        faces=np.concatenate([ball.faces + number * count for number in range(3)]),
        normals=np.tile(ball.normals, (3, 1)),
        colors=np.tile(ball.colors, (3, 1)),
        sheet_counts=np.repeat(np.arange(3, dtype=np.uint8), count),
    )
    kept = without_crumbs(together, 0.01)
    assert kept.sheet_counts is not None
    np.testing.assert_array_equal(kept.sheet_counts, np.repeat([0, 2], count))
    np.testing.assert_array_equal(kept.vertices[count:], together.vertices[2 * count :])
    np.testing.assert_array_equal(kept.faces[len(ball.faces) :] - count, ball.faces)
    assert without_crumbs(together, 0.001) is together
    small = replace(ball, vertices=1e-3 * ball.vertices)
    assert without_crumbs(small, 0.01) is small
