import numpy as np
import pytest

from blobtree._typing import Float32Array, FloatArray
from decals import Relaxation, scatter
from decals.errors import InvalidScattering
from decals.scattering import Creases
from decals.surfaces import MeshSurface
from tests.decals.meshes import box, plane, sphere


def distances_to_box_edges(points: Float32Array, half: float = 0.5) -> FloatArray:
    """Distance of points on a cube's faces to its edges."""
    gaps = half - np.abs(points)
    return np.asarray(np.sort(gaps, axis=1)[:, 1])


def test_creases_of_a_box_are_its_edges() -> None:
    creases = Creases(box())
    assert len(creases.segments) == 12
    assert creases.length == pytest.approx(12.0)
    points, _ = box().sample(2000, seed=0)
    assert creases.distance(points) == pytest.approx(distances_to_box_edges(points), abs=1e-6)


def test_creases_of_ball_and_square() -> None:
    ball = Creases(sphere(level=4))
    assert len(ball.segments) == 0
    assert np.isinf(ball.distance(np.zeros((3, 3), np.float32))).all()
    assert ball.points(0.1).shape == (0, 3)
    assert Creases(plane()).length == pytest.approx(4.0)
    assert Creases(plane(), boundary=False).length == 0.0


def test_unwelded_vertices_make_no_boundary() -> None:
    square = box()
    apart = MeshSurface(square.vertices[square.faces.reshape(-1)], np.arange(36).reshape(-1, 3))
    assert Creases(apart).length == pytest.approx(12.0)


def test_crease_angle() -> None:
    roof = MeshSurface([[0.0, 0, 0], [1.0, 0, 0], [0.0, 1, 0], [0.0, -1, 0.5773503]], [[0, 1, 2], [1, 0, 3]])
    for angle, count in ((29.0, 1), (31.0, 0)):  # the roof turns by 30 degrees
        assert len(Creases(roof, angle=angle, boundary=False).segments) == count


def test_crease_mask_keeps_its_distance() -> None:
    cube = box()
    apart = 0.06
    relaxation = Relaxation([cube], count=300, mask=Creases(cube).mask(apart=apart))
    assert relaxation.domain.area == pytest.approx(6 * (1 - 2 * apart) ** 2, rel=0.02)
    relaxation.run()
    assert distances_to_box_edges(relaxation.positions).min() >= apart - 1e-6


def test_points_along_creases_are_even_and_include_corners() -> None:
    points = Creases(box()).points(0.13)
    assert len(points) == 8 + 12 * 7  # eight steps of 0.125 along each edge
    assert distances_to_box_edges(points).max() < 1e-6
    corners = (np.abs(np.abs(points) - 0.5) < 1e-6).all(axis=1)
    assert corners.sum() == 8
    nearest = np.sort(np.linalg.norm(points[:, None] - points, axis=2), axis=1)[:, 1]
    assert nearest == pytest.approx(0.125, abs=1e-6)


def test_points_along_a_loop_without_corners() -> None:
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    disc = MeshSurface(
        np.vstack([[0, 0, 0], np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)]),
        [[0, 1 + i, 1 + (i + 1) % 48] for i in range(48)],
    )
    points = Creases(disc).points(0.5)
    assert len(points) == 13
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    assert np.diff(angles) == pytest.approx(2 * np.pi / 13, rel=0.02)


def test_decals_line_up_along_creases() -> None:
    cube = box()
    spacing = 0.15
    points = Creases(cube).points(spacing)
    decals = scatter(cube, spacing=spacing, fixed=points)
    gaps = np.linalg.norm(decals.positions[:, None] - points, axis=2).min(axis=0)
    assert gaps.max() < 1e-5
    inner = distances_to_box_edges(decals.positions)
    assert inner[inner > 1e-5].min() > 0.5 * spacing


def test_invalid_arguments_raise() -> None:
    for angle in (0.0, 180.0, np.nan):
        with pytest.raises(InvalidScattering, match="angle: expected"):
            Creases(box(), angle=angle)
    with pytest.raises(InvalidScattering, match="spacing: expected"):
        Creases(box()).points(0.0)
    with pytest.raises(InvalidScattering, match="makes more than 100,000,000 points"):
        Creases(box()).points(1e-9)
    for apart in (np.nan, -1.0, np.inf):
        with pytest.raises(InvalidScattering, match="apart: expected"):
            Creases(box()).mask(apart=apart)
