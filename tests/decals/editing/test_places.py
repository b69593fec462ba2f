"""Places on surfaces against plain geometry, and frames that are carried without spin."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree import Point
from decals import MeshObject, TreeObject
from decals.editing import first_hit, nearest_points
from decals.editing.queries import SurfacePoints, move_decals, shortest_rotations
from decals.errors import InvalidPoints
from tests.decals.editing.scenes import box, one

BALL = TreeObject("ball", Point((0, 0, 0), radius=1.0))
BOX = MeshObject("box", *box((2, -1, -1), (4, 1, 1)))

ANGLES = st.floats(0, 2 * np.pi)


def unit(azimuth: Any, height: Any) -> Any:
    return np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])


def test_the_nearest_place_is_on_the_nearest_object() -> None:
    points = np.array([[0, 0, 3], [2.9, 0, 5], [1.2, 0, 0], [1.8, 0, 0]])
    found = nearest_points([BALL, BOX], points)
    assert found.objects.tolist() == [0, 1, 0, 1]
    expected = [[0.0, 0, 1], [2.9, 0, 1], [1.0, 0, 0], [2.0, 0, 0]]
    np.testing.assert_allclose(found.positions, expected, atol=1e-5)
    np.testing.assert_allclose(found.normals, [[0, 0, 1], [0, 0, 1], [1, 0, 0], [-1, 0, 0]], atol=1e-5)


def test_rays_hit_what_is_in_front() -> None:
    hit = first_hit([BOX, BALL], (-5, 0.1, 0), (2, 0, 0))
    assert hit.objects.tolist() == [1]
    np.testing.assert_allclose(hit.positions[0], [-np.sqrt(0.99), 0.1, 0], atol=1e-5)
    behind = first_hit([BOX, BALL], (9, 0, 0), (-1, 0, 0))
    assert behind.objects.tolist() == [0]
    assert len(first_hit([BOX, BALL], (0, 5, 0), (0, 1, 0)).objects) == 0
    assert len(first_hit([], (0, 5, 0), (0, 1, 0)).objects) == 0


def test_points_that_are_none() -> None:
    with pytest.raises(InvalidPoints):
        nearest_points([BALL], [[np.nan, 0, 0]])
    assert len(nearest_points([BALL], np.zeros((0, 3))).objects) == 0
    assert nearest_points([], [[0, 0, 1]]).objects.tolist() == [-1]


@given(ANGLES, ANGLES, ANGLES, ANGLES)
def test_turns_are_the_shortest_rotations(a: Any, b: Any, c: Any, d: Any) -> None:
    before, after = unit(a, b), unit(c, d)
    turn = shortest_rotations([before], [after])[0]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-7)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    np.testing.assert_allclose(turn @ before, after, atol=2e-3 if before @ after < -0.999 else 1e-7)
    angle = np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))
    assert angle == pytest.approx(np.arccos(np.clip(before @ after, -1, 1)), abs=2e-3)


@given(ANGLES)
def test_opposite_vectors_are_turned_too(angle: Any) -> None:
    vector = unit(angle, angle)
    turn = shortest_rotations([vector], [-vector])[0]
    np.testing.assert_allclose(turn @ vector, -vector, atol=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-6)


@given(ANGLES, st.floats(-1.5, 1.5))
def test_along_a_great_circle_frames_keep_their_angle_to_it(start: Any, way: Any) -> None:
    """Parallel transport on a sphere: along a geodesic the angle to it stays, in any number of steps."""
    path = [np.array([np.cos(t), 0, np.sin(t)]) for t in np.linspace(start, start + way, 7)]
    tangent = 0.6 * np.array([-np.sin(start), 0, np.cos(start)]) + 0.8 * np.array([0, 1, 0])
    decal = one().replace(positions=[path[0]], normals=[path[0]], tangents=[tangent])
    for point in path[1:]:
        decal = move_decals(decal, SurfacePoints(point[None], point[None], np.zeros(1, np.int32)))
    end = start + way
    expected = 0.6 * np.array([-np.sin(end), 0, np.cos(end)]) + 0.8 * np.array([0, 1, 0])
    np.testing.assert_allclose(decal.tangents[0], expected, atol=1e-5)
