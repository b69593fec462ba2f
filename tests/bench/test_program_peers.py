"""The programs of `python -m tests.bench.program_peers`, and its measures."""

import json
from pathlib import Path

import numpy as np
import pytest

from blobtree import Expression, Point
from tests.bench.modeller_peers import Meshed, field, read_stl, welded
from tests.bench.program_peers import (
    Blobtree,
    balls_scene,
    boxed,
    distances,
    errors,
    lipschitz_scene,
    nearest_changes,
    program_scene,
    row,
    surface_points,
)
from tests.oracles import blobtree as oracle
from tests.oracles.foreign import lipschitz


def unit_points(count: int = 500) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (count, 3))


def sphere(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.linalg.norm(points, axis=1) - 0.5)


def test_the_sum_of_balls_is_that_of_the_tree() -> None:
    scene = balls_scene(20)
    points = 0.9 * unit_points()
    np.testing.assert_allclose(field(scene.lines)(points), 0.5 - oracle.value(scene.node, points), atol=1e-5)


def test_programs_end_at_a_box(tmp_path: Path) -> None:
    path = tmp_path / "half.vm"
    path.write_text("x var-x\nk const 0.25\nd sub x k\n")
    scene = program_scene(path)
    inside = field(scene.lines)(unit_points()) < 0.0
    x, y, z = np.abs(unit_points()).T
    np.testing.assert_array_equal(inside, (unit_points()[:, 0] < 0.25) & (x < 0.99) & (y < 0.99) & (z < 0.1))
    np.testing.assert_array_equal(inside, oracle.value(scene.node, unit_points()) > 0.5)
    assert isinstance(scene.node, Expression)
    assert boxed(scene.node) == scene.lines


def ball(place: list[float], radius: float) -> dict[str, object]:
    matrix = np.column_stack([np.eye(3), -np.array(place)]).ravel().tolist()
    return {"nodeType": "primitive", "primitiveType": "sphere", "matrix": matrix, "radius": radius}


def union(left: object, right: object, blend: float) -> dict[str, object]:
    turned = [0.0, -1.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    sides = {"leftChild": left, "rightChild": right, "blendRadius": blend}
    return {"nodeType": "binaryOperator", "blendMode": "union", "matrix": turned, **sides}


def test_scenes_of_lipschitz_pruning_have_their_own_blends(tmp_path: Path) -> None:
    color = {"color": [1, 1, 1], "round_x": 0, "round_y": 0}
    parts = [ball([0.3 * i - 0.3, 0.2 * i, 0.1], 0.4) | color for i in range(3)]
    content = union(union(parts[0], parts[1], 0.2), parts[2], 0.0)
    content |= {"aabb_min": [-2, -2, -2], "aabb_max": [2, 2, 2]}
    path = tmp_path / "balls.json"
    path.write_text(json.dumps(content))
    scene = lipschitz_scene(path)
    points, scale = 0.9 * unit_points(), 0.45
    np.testing.assert_allclose(
        field(scene.lines)(points), scale * lipschitz(content, points / scale), atol=1e-12
    )
    arcs, parabolas = 0.5 - oracle.value(scene.node, points), field(scene.lines)(points)
    assert (np.sign(arcs) == np.sign(parabolas)).mean() > 0.99
    path.write_text(json.dumps(content | {"blendMode": "sub"}))
    with pytest.raises(ValueError, match=r"expected unions in .*, got sub"):
        lipschitz_scene(path)


def test_vertices_off_the_surface_and_missing_parts_are_measured() -> None:
    np.testing.assert_allclose(
        distances(sphere, np.array([[0.6, 0, 0], [0, 0, 0.45]])), [0.1, 0.05], rtol=1e-6
    )
    step = nearest_changes(lambda points: np.sign(sphere(points)), np.array([[0.6, 0, 0], [0.9, 0, 0]]), 0.2)
    np.testing.assert_allclose(step, [0.10, np.inf], atol=0.2 / 32)
    on_surface = surface_points(sphere)
    np.testing.assert_allclose(np.linalg.norm(on_surface, axis=1), 0.5, atol=1e-9)
    whole = Blobtree(Point((0, 0, 0), radius=0.5)).mesh((), 64)
    found = errors(sphere, on_surface, whole, 2.0 / 64)
    assert found["worst"] < 1e-3
    assert found["missed"] == 0.0
    upper = whole.faces[whole.vertices[whole.faces][:, :, 2].min(axis=1) > 0.0]
    half = errors(sphere, on_surface, Meshed(whole.vertices, upper, 0.0), 2.0 / 64)
    assert 0.35 < half["missed"] < 0.6


def test_meshes_of_other_programs_are_read(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
    triangle = np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("attribute", "<u2")])
    rows = np.zeros(2, triangle)
    rows["corners"] = corners.reshape(2, 9)
    path = tmp_path / "two.stl"
    path.write_bytes(bytes(80) + np.uint32(2).tobytes() + rows.tobytes())
    mesh = welded(read_stl(path), 1.5)
    assert len(mesh.vertices) == 4
    np.testing.assert_array_equal(mesh.vertices[mesh.faces].reshape(-1, 3), corners)


def test_rays_hit_where_the_solid_is() -> None:
    hit, seconds = Blobtree(Point((0, 0, 0), radius=0.5)).rays((), 32)
    assert hit.mean() == pytest.approx(np.pi * 0.25 / 4.0, rel=0.05)
    assert seconds > 0.0


def test_rows_have_a_form_for_each_figure() -> None:
    figures = {"s": 1.234, "triangles": 12345.0, "mean": 1e-6, "worst": 2e-3, "missed": 0.5}
    assert row("a", "b", figures) == "| a | b | 1.23 | 12,345 | 1.0e-06 | 2.0e-03 | 50.00% |"
