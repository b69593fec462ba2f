"""The mesh of any tree is closed, faces outward, lies on the surface and has the right topology."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from blobtree import ISO, Mesh, Node, Point, Polygonizer, Segment, Shell, Sum, Union, polygonize
from blobtree._typing import Float64Array
from blobtree.errors import InvalidResolution
from blobtree.kernels import COMPILING
from tests.blobtree.trees import random_trees

BALL = Point((0, 0, 0), radius=1.0, color=(1, 0, 0))


def assert_closed(mesh: Mesh) -> None:
    """Every edge is used once in each direction, and no triangle names a vertex twice."""
    faces = mesh.faces.astype(np.int64)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    assert (start != end).all(), "a triangle names a vertex twice"
    count = len(mesh.vertices)
    there = np.unique(start * count + end)
    assert len(there) == len(start), "an edge is used twice in one direction"
    assert np.array_equal(there, np.unique(end * count + start)), "an edge lacks its opposite"


def assert_valid(mesh: Mesh) -> None:
    assert mesh.vertices.dtype == mesh.normals.dtype == mesh.colors.dtype == np.float32
    assert mesh.faces.dtype == np.int32
    assert mesh.vertices.shape == mesh.normals.shape == mesh.colors.shape
    assert np.isfinite(mesh.vertices).all()
    if len(mesh.faces):
        assert (mesh.faces.min(), mesh.faces.max()) == (0, len(mesh.vertices) - 1)
        assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    assert ((mesh.colors >= 0.0) & (mesh.colors <= 1.0 + 1e-6)).all()


def crosses(mesh: Mesh) -> Float64Array:
    """Twice the area of every triangle (m, 3), along its normal."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(np.cross(b - a, c - a))


def area(mesh: Mesh) -> float:
    return float(0.5 * np.linalg.norm(crosses(mesh), axis=1).sum())


def volume(mesh: Mesh) -> float:
    """Signed, positive where triangles face outward."""
    return float((mesh.vertices[mesh.faces[:, 0]].astype(np.float64) * crosses(mesh)).sum() / 6.0)


def euler(mesh: Mesh) -> int:
    return len(mesh.vertices) - len(mesh.faces) // 2  # V − E + F, a closed mesh having 3F/2 edges


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_ball(scale: float) -> None:
    mesh = polygonize(BALL.scale(scale), resolution=40)
    assert_valid(mesh)
    assert_closed(mesh)
    assert euler(mesh) == 2
    radii = np.linalg.norm(mesh.vertices.astype(np.float64), axis=1) / scale
    np.testing.assert_allclose(radii, 1.0, atol=5e-6)
    np.testing.assert_allclose(mesh.normals, mesh.vertices / scale, atol=1e-4)
    assert volume(mesh) / scale**3 == pytest.approx(4.0 / 3.0 * np.pi, rel=0.01)
    assert area(mesh) / scale**2 == pytest.approx(4.0 * np.pi, rel=0.01)
    np.testing.assert_allclose(mesh.colors, np.tile([1.0, 0.0, 0.0], (len(mesh.colors), 1)))


def test_finer_grids_reduce_the_error() -> None:
    errors = [4.0 / 3.0 * np.pi - volume(polygonize(BALL, resolution=n)) for n in (16, 32, 64)]
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_a_capsule() -> None:
    mesh = polygonize(Segment((-1, 0.3, 0), (1, -0.2, 0.4), radius=0.4), resolution=64)
    assert_closed(mesh)
    length = float(np.linalg.norm([2.0, -0.5, 0.4]))
    assert volume(mesh) == pytest.approx(np.pi * 0.16 * length + 4.0 / 3.0 * np.pi * 0.064, rel=0.01)


def ring(count: int = 16) -> Node:
    angles = np.linspace(0.0, 2.0 * np.pi, count + 1)
    corners = [(float(np.cos(a)), float(np.sin(a)), 0.0) for a in angles]
    bones = [Segment(a, b, radius=0.15) for a, b in pairwise(corners)]
    tree: Node = bones[0]
    for bone in bones[1:]:
        tree = tree | bone
    return tree


def test_a_ring_has_one_handle() -> None:
    mesh = polygonize(ring(), resolution=48)
    assert_closed(mesh)
    assert euler(mesh) == 0


def test_parts_and_holes_have_the_right_euler_number() -> None:
    apart = polygonize(BALL | BALL.translate((4, 0, 0)), resolution=60)
    assert euler(apart) == 4
    hollow = polygonize(BALL - Point((0, 0, 0), radius=0.6), resolution=48)
    assert_closed(hollow)
    assert euler(hollow) == 4
    assert volume(hollow) == pytest.approx(4.0 / 3.0 * np.pi * (1.0 - 0.216), rel=0.02)
    drilled = polygonize(BALL - Segment((0, 0, -3), (0, 0, 3), radius=0.4), resolution=48)
    assert_closed(drilled)
    assert euler(drilled) == 0


@pytest.mark.parametrize("seed", range(4))
def test_random_trees(seed: int) -> None:
    surfaces = 0
    for tree in random_trees(seed=40 + seed, count=8, depth=3):
        mesh = polygonize(tree, resolution=24)
        assert_valid(mesh)
        assert_closed(mesh)
        if len(mesh.faces) == 0:
            continue
        surfaces += 1
        assert volume(mesh) > 0.0
        cell = float((tree.support[1] - tree.support[0]).max()) / 24
        gap = np.abs(tree(mesh.vertices) - ISO) / np.maximum(
            np.linalg.norm(tree.gradient(mesh.vertices), axis=1), 0.1
        )
        assert (gap < 0.02 * cell).mean() > 0.8  # the others sit at creases, where Newton finds no way
        assert np.median(gap) < 1e-4 * cell
    assert surfaces >= 3


def test_triangles_face_along_their_normals() -> None:
    mesh = polygonize(BALL + Segment((0, 0, 0), (2, 0, 0), radius=0.5), resolution=48)
    facing = (crosses(mesh) * mesh.normals[mesh.faces].mean(axis=1)).sum(axis=1)
    assert (facing > 0.0).mean() > 0.999


@pytest.mark.parametrize(
    "nothing",
    [
        Point((0, 0, 0), radius=0.5) & Point((9, 0, 0), radius=0.5),
        BALL - Point((0, 0, 0), radius=2.0),
        Point((0, 0, 0), radius=0.5) & Point((1.5, 0, 0), radius=0.5),
    ],
    ids=["apart", "cut away", "fields that overlap below the surface"],
)
def test_a_tree_without_surface_is_an_empty_mesh(nothing: Node) -> None:
    mesh = polygonize(nothing, resolution=16)
    assert mesh.vertices.shape == mesh.normals.shape == mesh.colors.shape == (0, 3)
    assert mesh.faces.shape == (0, 3)


def test_a_cell_size_in_units_of_the_model() -> None:
    longest = float((BALL.support[1] - BALL.support[0]).max())
    by_count, by_size = polygonize(BALL, resolution=32), polygonize(BALL, cell_size=longest / 32)
    assert len(by_count.vertices) == pytest.approx(len(by_size.vertices), rel=0.05)
    assert len(polygonize(BALL, cell_size=100.0).faces) in (0, 12)
    assert len(polygonize(BALL).vertices) == len(polygonize(BALL, resolution=64).vertices)


def test_the_same_call_gives_the_same_mesh() -> None:
    tree = Sum((BALL, Segment((0, 0, 0), (2, 0, 0), radius=0.5)))
    first, second = polygonize(tree, resolution=40), polygonize(tree, resolution=40)
    for name in ("vertices", "faces", "normals", "colors"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resolution": 10, "cell_size": 0.1}, "expected either resolution or cell_size, got both; drop one"),
        ({"resolution": 0}, "resolution: expected a whole number of cells from 1 to 1,048,576, got 0"),
        ({"resolution": -4}, "resolution: expected a whole number of cells from 1 to 1,048,576, got -4"),
        ({"resolution": 2.5}, "resolution: expected a whole number of cells from 1 to 1,048,576, got 2.5"),
        (
            {"resolution": "fine"},
            "resolution: expected a whole number of cells from 1 to 1,048,576, got 'fine'",
        ),
        ({"cell_size": 0.0}, "cell_size: expected a finite size above 0, got 0.0"),
        ({"cell_size": -1.0}, "cell_size: expected a finite size above 0, got -1.0"),
        ({"cell_size": float("nan")}, "cell_size: expected a finite size above 0, got nan"),
        ({"cell_size": float("inf")}, "cell_size: expected a finite size above 0, got inf"),
        ({"cell_size": "fine"}, "cell_size: expected a finite size above 0, got 'fine'"),
        ({"chord_error": "fine"}, "chord_error: expected a finite length above 0, got 'fine'"),
        ({"cell_size": 1e-12}, "take larger cells"),
        ({"resolution": 10**9}, "resolution: expected .* from 1 to 1,048,576, got 1000000000"),
        pytest.param({"resolution": 20_000}, "take larger cells", marks=pytest.mark.slow),
    ],
)
def test_invalid_sizes_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidResolution, match=message):
        polygonize(BALL, **options)  # type: ignore[arg-type]


def test_progress_never_decreases() -> None:
    told: list[tuple[str, float]] = []
    polygonize(BALL, resolution=64, progress=lambda stage, fraction: told.append((stage, fraction)))
    told = [(stage, fraction) for stage, fraction in told if not stage.startswith(COMPILING)]
    stages = list(dict.fromkeys(stage for stage, _ in told))
    assert len(stages) >= 2
    assert [stage for stage, _ in told] == sorted((stage for stage, _ in told), key=stages.index)
    for stage in stages:
        fractions = [fraction for name, fraction in told if name == stage]
        assert fractions == sorted(fractions)
        assert min(fractions) >= 0.0
        assert max(fractions) == 1.0


# -- cells far wider than the parts --------------------------------------------------------------------


OFF = 1e-3
"""Field error of a vertex that does not lie on the surface."""


def crumbs(seed: int) -> Node:
    """Small parts all over a box."""
    rng = np.random.default_rng(seed)
    radius = float(rng.uniform(0.02, 0.15))
    parts: list[Node] = []
    for place in rng.uniform(-1, 1, (int(rng.integers(5, 80)), 3)):
        end = place + rng.normal(0, 0.3, 3)
        parts.append(
            Point(place, radius=radius) if rng.random() < 0.6 else Segment(place, end, radius=radius / 2)
        )
    if seed % 3 == 0:
        return Sum(tuple(parts))
    return Union(tuple(parts)) if seed % 3 == 1 else Sum(tuple(parts)) - Point((0, 0, 0), radius=0.5)


def test_vertices_in_wide_cells_lie_on_the_surface() -> None:
    gaps, normals = [], []
    for seed in range(24):
        tree = crumbs(seed)
        for resolution in (5, 8, 12):
            mesh = polygonize(tree, resolution=resolution)
            gaps.append(np.abs(tree(mesh.vertices) - ISO))
            normals.append(np.linalg.norm(mesh.normals, axis=1))
    every = np.concatenate(gaps)
    assert len(every) > 3000
    assert (every > OFF).mean() < 1e-3
    assert every.max() < 0.1
    assert np.concatenate(normals) == pytest.approx(1.0, abs=1e-4)


def test_meshes_of_wide_cells_are_closed_with_vertices_near_their_cells() -> None:
    for seed in range(4, 10):
        polygonizer = Polygonizer(crumbs(seed), resolution=12)
        mesh = polygonizer.mesh
        edges = Counter(
            (int(a), int(b)) for face in mesh.faces for a, b in zip(face, np.roll(face, -1), strict=True)
        )
        assert all(edges[b, a] == count for (a, b), count in edges.items())
        corners = mesh.vertices[mesh.faces]
        assert len(mesh.faces)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        # neighbours lie in cells that share a face or an edge, and no farther than one cell from there
        assert sides.max() < (2 * np.sqrt(3) + 2) * polygonizer.cell_size


def test_an_edit_in_wide_cells_matches_a_new_mesh() -> None:
    before, after = crumbs(3), crumbs(3) + Point((0.4, 0.4, 0.4), radius=0.05)
    polygonizer = Polygonizer(before, resolution=6)
    again = polygonizer.update(after)
    fresh = Polygonizer(after, cell_size=polygonizer.cell_size).mesh
    assert np.array_equal(again.vertices, fresh.vertices)
    assert np.array_equal(again.faces, fresh.faces)
    assert np.array_equal(again.normals, fresh.normals)


def test_a_surface_that_cells_lose_is_named(caplog: pytest.LogCaptureFixture) -> None:
    thin = Shell(BALL, 1e-3)
    assert len(polygonize(thin, resolution=32).faces) == 0
    assert "the mesh is empty: cells of 0.13" in caplog.text
    caplog.clear()
    assert len(polygonize(BALL, resolution=32).faces) > 0
    assert not caplog.records
