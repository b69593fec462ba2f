"""Flat faces: closed meshes with faces on edges, which stay closed without them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

import decals
from blobtree import Box, Cylinder, Point
from decals.baking.flat_faces import without_flat_faces
from decals.surfaces import check_mesh, read_mesh


def ball_with_flat_faces(seed: int, count: int, near: float) -> tuple[Any, Any]:
    """Return a ball, on some edges of which lie flat faces; `near` is where their corner divides the edge."""
    rng = np.random.default_rng(seed)
    ball = pv.Icosphere(nsub=3)
    vertices, faces = [*np.asarray(ball.points, np.float64)], [tuple(face) for face in ball.regular_faces]
    for _ in range(count):
        row = int(rng.integers(len(faces)))
        a, c, d = np.roll(faces[row], rng.integers(3)).tolist()
        b = len(vertices)
        vertices.append(vertices[a] + near * (vertices[c] - vertices[a]))
        faces[row] = a, b, d
        faces += [(b, c, d), (a, c, b)]
    return np.array(vertices, np.float32), np.array(faces, np.int32)


@given(st.integers(0, 10**6), st.integers(1, 60), st.sampled_from([0.5, 0.1, 1e-2, 1e-6, 0.0]))
@settings(max_examples=60)
def test_a_closed_mesh_stays_closed_without_its_flat_faces(seed: int, count: int, near: float) -> None:
    vertices, faces = ball_with_flat_faces(seed, count, near)
    before = check_mesh(vertices, faces)
    assert before.closed
    kept = without_flat_faces(vertices, faces)
    after = check_mesh(vertices, kept)
    assert (after.closed, after.degenerate) == (True, 0)
    assert before.copies or not after.faults  # folds that were there stay
    np.testing.assert_allclose((after.area, after.volume), (before.area, before.volume), rtol=1e-5)


def test_a_mesh_without_flat_faces_keeps_them_all() -> None:
    ball = pv.Icosphere(nsub=2)
    faces = np.asarray(ball.regular_faces, np.int32)
    np.testing.assert_array_equal(without_flat_faces(np.asarray(ball.points, np.float32), faces), faces)
    fold = np.vstack([faces, [[0, 1, 2], [0, 2, 1]]]).astype(np.int32)
    np.testing.assert_array_equal(without_flat_faces(np.asarray(ball.points, np.float32), fold), fold)
    tent = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0]], np.float32)
    assert len(without_flat_faces(tent, np.array([[0, 1, 2], [0, 2, 1]], np.int32))) == 0  # a fold


def test_flat_faces_that_enclose_nothing_go_together() -> None:
    ball = pv.Icosphere(nsub=1)
    line = np.array([[2, 0, 0], [3, 0, 0], [4, 0, 0], [5, 0, 0]])
    shell = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]) + len(ball.points)
    faces = np.vstack([ball.regular_faces, shell]).astype(np.int32)
    kept = without_flat_faces(np.vstack([ball.points, line]).astype(np.float32), faces)
    np.testing.assert_array_equal(kept, ball.regular_faces)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["stl", "3mf", "glb"])
def test_a_file_of_a_thin_sheet_with_a_hole_is_closed(tmp_path: Path, suffix: str) -> None:
    hole = Cylinder((0, -1, 0), (0, 1, 0), 0.9, radius=0.001)
    sheet = Box((0, 0, 0), (4, 0.004, 3), radius=0.001) - hole
    path = tmp_path / f"sheet.{suffix}"
    decals.export(decals.cover(sheet | Point((0, 3, 0), radius=0.2), count=3), path, colors=None)
    found = check_mesh(*read_mesh(path))
    assert (found.closed, found.degenerate, found.parts) == (True, 0, 2)
