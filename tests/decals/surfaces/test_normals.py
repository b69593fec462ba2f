"""Normals for drawing: split at creases, smooth elsewhere."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import decals
from decals.errors import InvalidScene
from decals.surfaces.normals import split_at_creases, vertex_normals
from tests.decals.meshes import box, icosphere
from tests.decals.shapes import torus


def corner_normals(vertices: Any, faces: Any, angle: float) -> np.ndarray:
    """Normal of every corner, by a search over the faces around each vertex: float64[m, 3, 3]."""
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    crosses = np.cross(b - a, c - a)
    units = crosses / np.linalg.norm(crosses, axis=1, keepdims=True)
    result = np.zeros((len(faces), 3, 3))
    for vertex in range(len(vertices)):
        around = [face for face in range(len(faces)) if vertex in faces[face]]
        group = {face: face for face in around}
        crease = False
        for one, other in combinations(around, 2):
            shared = set(faces[one]) & set(faces[other])
            close = np.degrees(np.arccos(np.clip(units[one] @ units[other], -1, 1))) <= angle
            crease |= len(shared) == 2 and not close
            if len(shared) == 2 and close:
                group = {
                    face: group[one] if number == group[other] else number for face, number in group.items()
                }
        for face in around:
            total = sum(crosses[other] for other in around if group[other] == group[face] or not crease)
            result[face, list(faces[face]).index(vertex)] = total / np.linalg.norm(total)
    return result


def test_a_cube_has_the_normals_of_its_faces() -> None:
    cube = box()
    split = split_at_creases(cube.vertices, cube.faces)
    assert len(split.rows) == 24
    np.testing.assert_array_equal(cube.vertices[split.rows][split.faces], cube.vertices[cube.faces])
    flat = np.repeat(cube.normal(cube.vertices[cube.faces].mean(axis=1)), 3, axis=0).reshape(-1, 3, 3)
    np.testing.assert_allclose(split.normals[split.faces], flat, atol=1e-7)


@pytest.mark.parametrize("angle", [35.0, 180.0])
def test_smooth_meshes_stay_bit_for_bit(angle: float) -> None:
    shape = torus()
    split = split_at_creases(shape.vertices, shape.faces, angle)
    np.testing.assert_array_equal(split.rows, np.arange(len(shape.vertices)))
    np.testing.assert_array_equal(split.faces, shape.faces)
    np.testing.assert_array_equal(split.normals, vertex_normals(shape.vertices, shape.faces))


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), angle=st.floats(0.0, 180.0), keep=st.floats(0.3, 1.0))
def test_groups_are_those_of_a_search(seed: int, angle: float, keep: float) -> None:
    rng = np.random.default_rng(seed)
    unit, faces = icosphere(1)
    vertices = (unit * rng.uniform(0.5, 1.5, (len(unit), 1))).astype(np.float32)
    faces = faces[rng.random(len(faces)) < keep].astype(np.int32)
    split = split_at_creases(vertices, faces, angle)
    np.testing.assert_array_equal(split.rows[: len(vertices)], np.arange(len(vertices)))
    np.testing.assert_array_equal(split.rows[split.faces], faces)
    drawn = split.normals[split.faces].reshape(-1, 3)
    np.testing.assert_allclose(drawn, corner_normals(vertices, faces, angle).reshape(-1, 3), atol=1e-5)


@pytest.mark.parametrize("angle", [-1.0, 181.0, float("nan"), "sharp", None])
def test_other_angles_are_refused(angle: Any) -> None:
    with pytest.raises(InvalidScene, match="crease_angle: expected degrees from 0 to 180"):
        decals.MeshObject("box", box().vertices, box().faces, crease_angle=angle)
    with pytest.raises(InvalidScene, match="crease_angle"):
        decals.cover((box().vertices, box().faces), count=1, crease_angle=angle)


def book(pages: int, *, turned: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Pages around one edge, as rectangles of two triangles; every other one may wind the other way round."""
    vertices, faces = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], []
    for page, turn in enumerate(np.arange(pages) * 2.0 * np.pi / pages):
        x, y, i = np.cos(turn), np.sin(turn), len(vertices)
        vertices += [[x, y, 0.0], [x, y, 1.0]]
        step = -1 if turned and page % 2 else 1
        faces += [[0, i, i + 1][::step], [0, i + 1, 1][::step]]
    return np.array(vertices, np.float32), np.array(faces, np.int32)


@pytest.mark.parametrize("pages", [3, 6, 12, 20, 24])
def test_each_page_at_an_edge_of_many_faces_keeps_its_normal(pages: int) -> None:
    vertices, faces = book(pages)
    split = split_at_creases(vertices, faces)
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(split.normals[split.faces], np.repeat(flat[:, None], 3, axis=1), atol=1e-6)


def test_copies_of_faces_change_no_normal() -> None:
    cube = box()
    split = split_at_creases(cube.vertices, cube.faces)
    doubled = split_at_creases(cube.vertices, np.vstack([cube.faces, cube.faces]))
    twice = np.vstack([split.normals[split.faces]] * 2)
    np.testing.assert_allclose(doubled.normals[doubled.faces], twice, atol=1e-6)
    assert len(doubled.rows) == len(split.rows)


@pytest.mark.parametrize("turned", [False, True])
def test_pages_of_a_book_are_covered_without_gaps(turned: bool) -> None:
    scene = decals.cover(book(12, turned=turned), count=100)
    assert decals.measure(scene).coverage > 0.9999
