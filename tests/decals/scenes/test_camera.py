"""Cameras: matrices against plain NumPy, rays against the matrices, framing against the frustum."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from decals import Camera
from decals.errors import InvalidScene
from decals.rendering.viewpoint import Bounds
from decals.scenes.camera import MIN_NEAR_OVER_FAR, Vector

coordinate = st.floats(-100, 100)
vector = st.tuples(coordinate, coordinate, coordinate)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    position, target, up = (np.array(draw(vector)) for _ in range(3))
    assume(np.linalg.norm(position - target) > 1e-2)
    assume(np.linalg.norm(np.cross(up, position - target)) > 1e-2)
    return Camera(tuple(position), tuple(target), tuple(up), draw(st.floats(1, 150)))


def project(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    divided: np.ndarray = clip[:, :3] / clip[:, 3:]
    return divided


def test_a_plain_view_by_hand() -> None:
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 2, 0), 90)
    np.testing.assert_allclose(camera.view() @ [1, 2, 0, 1], [1, 2, -5, 1])
    matrix = camera.projection(2.0, 1.0, 9.0) @ camera.view()
    corners = np.array([[10, 5, 0], [-10, -5, 0], [0, 0, 4], [0, 0, -4]])
    expected = [[1, 1], [-1, -1], [0, 0], [0, 0]]
    np.testing.assert_allclose(project(matrix, corners)[:, :2], expected, atol=1e-12)
    np.testing.assert_allclose(project(matrix, corners)[2:, 2], [-1, 1], atol=1e-12)


@given(cameras())
def test_the_view_is_a_rigid_motion_that_looks_at_the_target(camera: Camera) -> None:
    view = camera.view()
    np.testing.assert_allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(view) == pytest.approx(1)
    np.testing.assert_allclose(view @ [*camera.target, 1], [0, 0, -camera.distance, 1], atol=1e-8)
    assert (view[:3, :3] @ camera.up)[1] > 0


@given(cameras(), st.floats(0, 160), st.floats(0, 120), st.floats(0.1, 50))
def test_a_pixels_ray_projects_to_that_pixel(camera: Camera, x: float, y: float, t: float) -> None:
    rays = camera.rays(160, 120)
    point = rays.origin + t * rays.directions(x, y)
    matrix = camera.projection(160 / 120, 0.05, 100.0) @ camera.view()
    pixel = (project(matrix, point[None])[0, :2] + 1) / 2 * [160, 120]
    np.testing.assert_allclose(pixel, [x, y], atol=1e-6)


def all_seen(camera: Camera, points: np.ndarray, aspect: float) -> np.ndarray:
    """Normalised device coordinates of points, all of them in the picture."""
    near, far = camera.clip_range((points.min(axis=0), points.max(axis=0)))
    seen = project(camera.projection(aspect, near, far) @ camera.view(), points)
    assert np.abs(seen).max() <= 1 + 1e-6
    return seen


@given(vector, vector, vector, st.floats(5, 120), st.floats(0.3, 3))
def test_framing_sees_the_whole_box_and_little_more(
    a: Vector, b: Vector, direction: Vector, fov: float, aspect: float
) -> None:
    lower, upper = np.minimum(a, b), np.maximum(a, b)
    assume(np.linalg.norm(upper - lower) > 1e-2)
    assume(np.linalg.norm(direction) > 1e-3)
    camera = Camera.framing((lower, upper), direction=direction, fov=fov, aspect=aspect, margin=1.0)
    box = np.stack(np.meshgrid(*zip(lower, upper, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    all_seen(camera, box, aspect)
    toward = np.subtract(camera.position, camera.target)
    cosine = toward @ direction / np.linalg.norm(toward) / np.linalg.norm(direction)
    assert cosine == pytest.approx(1, abs=1e-9)


@given(st.integers(0, 10**6), st.floats(5, 120), st.floats(0.3, 3))
def test_fitting_touches_opposite_edges(seed: int, fov: float, aspect: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * rng.uniform(0.1, 5, 3) + rng.uniform(-10, 10, 3)
    camera = Camera.fitting(points, direction=rng.normal(size=3).tolist(), fov=fov, aspect=aspect, margin=1.0)
    seen = all_seen(camera, points, aspect)[:, :2]
    touched = np.isclose(seen.max(axis=0), 1, atol=1e-6) & np.isclose(seen.min(axis=0), -1, atol=1e-6)
    depth = (np.array(camera.position) - points) @ camera.axes[2]
    assert touched.any() or depth.min() < 0.06 * np.linalg.norm(np.ptp(points, axis=0))


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.zeros(3), [[0, 0, np.nan]]])
def test_bad_points_are_refused(points: ArrayLike) -> None:
    with pytest.raises(InvalidScene, match="points must be finite"):
        Camera.fitting(points)


def test_framing_fills_the_picture() -> None:
    camera = Camera.framing(([-1, -1, -1], [1, 1, 1]), direction=(0, 0, 1), fov=40, aspect=1, margin=1)
    assert camera.position[:2] == pytest.approx((0, 0))
    seen = project(camera.projection(1, 0.1, 100) @ camera.view(), np.array([[1.0, 1, 1]]))
    np.testing.assert_allclose(seen[0, :2], [1, 1], atol=1e-9)


def test_framing_from_above_and_of_a_point() -> None:
    camera = Camera.framing(([0, 0, 0], [1, 1, 1]), direction=(0, 1, 0))
    assert camera.position[1] > 1
    assert Camera.framing(([5, 5, 5], [5, 5, 5])).distance > 0


def test_clip_range_follows_the_scene() -> None:
    camera = Camera((0, 0, 10))
    near, far = camera.clip_range(([-1, -1, -1], [1, 1, 1]))
    assert 8 < near < 9 < 11 < far < 12
    near, far = camera.clip_range(([-1, -1, -1], [1, 1, 20]))
    assert near == pytest.approx(far * MIN_NEAR_OVER_FAR)
    near, far = camera.clip_range(([-1, -1, 20], [1, 1, 30]))
    assert 0 < near < far


@pytest.mark.parametrize(
    "arguments",
    [
        {"position": (0, 0, 0)},
        {"position": (0, 0, np.nan)},
        {"position": (0, 0)},
        {"position": "abc"},
        {"position": (0, 0, 1), "up": (0, 0, 0)},
        {"position": (0, 0, 1), "up": (0, 0, -3)},
        {"position": (0, 0, 1), "fov": 0},
        {"position": (0, 0, 1), "fov": 180},
        {"position": (0, 0, 1), "fov": np.nan},
        {"position": (0, 0, 1), "fit": True},
    ],
)
def test_bad_cameras_are_refused(arguments: dict[str, Any]) -> None:
    with pytest.raises(InvalidScene, match="camera's"):
        Camera(**arguments)


@pytest.mark.parametrize(
    "bounds", [([1, 0, 0], [0, 1, 1]), ([0, 0], [1, 1]), ([0, 0, np.inf], [1, 1, np.inf])]
)
def test_bad_bounds_are_refused(bounds: Bounds) -> None:
    with pytest.raises(InvalidScene, match="bounds"):
        Camera.framing(bounds)


def test_arrays_become_tuples() -> None:
    place: Any = np.array([0, 0, 1], np.float32)
    camera = Camera(place, fov=np.float32(30))  # type: ignore[arg-type]  # at run time it is a number
    assert camera.position == (0.0, 0.0, 1.0)
    assert isinstance(camera.position[0], float)
    assert isinstance(camera.fov, float)
    assert camera == Camera((0, 0, 1), fov=30)
