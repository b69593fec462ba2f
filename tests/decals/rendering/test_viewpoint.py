"""Viewpoints known by a matrix: rays go where the matrix says, in perspective and in parallel."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals import Camera
from decals.errors import InvalidScene
from decals.rendering import Projection, Viewpoint

SIZE = (160, 120)
BOX = ((-2.0, -1.0, -1.0), (1.0, 2.0, 1.0))
numbers = st.floats(-3, 3)


def parallel(camera: Camera, *, height: float = 3.0, near: float = 0.5, far: float = 9.0) -> Projection:
    """The camera's view without perspective; near and far are distances along it."""
    scale = np.diag([2 / height * SIZE[1] / SIZE[0], 2 / height, -2 / (far - near), 1.0])
    scale[2, 3] = (far + near) / (near - far)
    return Projection(scale @ camera.view())


def place(viewpoint: Viewpoint, points: np.ndarray) -> np.ndarray:
    """Pixels and window depth of points, by the matrix."""
    clip = np.c_[points, np.ones(len(points))] @ viewpoint.clip_matrix(SIZE, BOX).T
    ndc = clip[:, :3] / clip[:, 3:]
    return np.column_stack([(ndc[:, :2] + 1) / 2 * SIZE, ndc[:, 2]])


@given(st.tuples(numbers, numbers, st.floats(4, 9)), st.tuples(numbers, numbers), st.booleans())
def test_points_along_a_rays_pixel_stay_in_it(
    eye: tuple[float, float, float], target: tuple[float, float], is_parallel: bool
) -> None:
    camera = Camera(eye, (*target, 0.0), fov=35)
    view = parallel(camera) if is_parallel else Projection(camera.clip_matrix(SIZE, BOX))
    rays = view.rays(*SIZE)
    assert rays.parallel == view.parallel == is_parallel
    x, y = np.meshgrid([0.0, 40.5, 160.0], [0.0, 99.5, 120.0])
    for distance in (0.7, 5.0):
        points = rays.origins(x, y) + distance * rays.directions(x, y)
        seen = place(view, points.reshape(-1, 3))
        np.testing.assert_allclose(seen[:, :2], np.column_stack([x.ravel(), y.ravel()]), atol=1e-7)


def test_a_cameras_own_matrix_gives_its_own_rays() -> None:
    camera = Camera((1, 2, 6), (0.3, 0, 0), up=(0.2, 1, 0), fov=35)
    expected, found = camera.rays(*SIZE), Projection(camera.clip_matrix(SIZE, BOX)).rays(*SIZE)
    for name in ("origin", "corner", "right", "up"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-9)


def test_parallel_rays_begin_on_the_near_plane() -> None:
    camera = Camera((1, 2, 6), (0.3, 0, 0), fov=35)
    view = parallel(camera, near=0.5, far=9.0)
    rays = view.rays(*SIZE)
    begin = rays.origins(np.array([3.0]), np.array([7.0]))
    np.testing.assert_allclose(place(view, begin)[0], [3, 7, -1], atol=1e-9)
    np.testing.assert_allclose(place(view, begin + 8.5 * rays.directions(3.0, 7.0))[0], [3, 7, 1], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(rays.corner), 1)


@pytest.mark.parametrize(
    "matrix",
    [np.eye(3), np.full((4, 4), np.nan), np.diag([1.0, 1, 0, 1]), np.zeros((4, 4)), np.ones((4, 4))],
)
def test_what_is_no_projection_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(InvalidScene, match="a projection must"):
        Projection(matrix)
