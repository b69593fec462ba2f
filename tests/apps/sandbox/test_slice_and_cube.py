"""The slice plane and the orientation cube, by their geometry alone."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decals import Camera, MeshObject
from decals.apps.sandbox.cube import cube_cells
from decals.editing.gizmo import Ray, nearest_on_sphere
from decals.editing.slicing import CHOICES, MOVE, TILT, SliceDrag, SlicePlane, slice_box
from decals.errors import InvalidEdit
from decals.scenes.camera import PRESETS, UPRIGHT

BOX = np.full(3, -10.0), np.full(3, 10.0)
numbers = st.floats(-1.0, 1.0)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))
eyes = directions.map(lambda v: 5.0 * v)


def toward(eye: np.ndarray, point: np.ndarray) -> Ray:
    return eye, point - eye


@given(vectors, directions, eyes, eyes, st.floats(-3.0, 3.0))
def test_a_moved_plane_follows_the_pointer_along_its_normal(
    point: np.ndarray, normal: np.ndarray, eye: np.ndarray, other: np.ndarray, way: float
) -> None:
    plane = SlicePlane.across(point, normal)
    drag = SliceDrag(MOVE, plane, toward(eye, point), 1.0)
    end = point + way * normal
    if (
        np.linalg.norm(np.cross(end - other, normal)) < 0.1
        or np.linalg.norm(np.cross(point - eye, normal)) < 0.1
    ):
        return
    moved = drag.dragged(toward(other, end), BOX, snap=False)
    np.testing.assert_allclose(moved.point, end, atol=1e-6)
    assert moved.normal == plane.normal
    low, high = moved.reach(np.zeros(3), np.ones(3))
    corners = [np.dot(corner, normal) for corner in product((0.0, 1.0), repeat=3)]
    np.testing.assert_allclose((low, high), (min(corners), max(corners)), atol=1e-12)
    inside = drag.dragged(toward(other, end), (np.zeros(3), np.ones(3)), snap=False)
    assert low - 1e-9 <= inside.position <= high + 1e-9


@given(vectors, directions, directions, eyes)
def test_a_tilted_plane_turns_its_normal_to_the_pointer(
    point: np.ndarray, normal: np.ndarray, target: np.ndarray, eye: np.ndarray
) -> None:
    plane, end = SlicePlane.across(point, normal), point + 0.5 * target
    ray = toward(eye, end)
    hit = nearest_on_sphere(point, 0.5, end, ray)
    np.testing.assert_allclose(hit, target, atol=1e-4)
    tilted = SliceDrag(TILT, plane, ray, 0.5).dragged(ray, BOX, snap=False)
    assert tilted.point == plane.point
    along = np.asarray(ray[1]) / np.linalg.norm(ray[1])
    on_ray = point + 0.5 * np.array(tilted.normal) - eye
    assert np.linalg.norm(on_ray - (on_ray @ along) * along) < 1e-4
    assert np.dot(tilted.normal, normal) >= np.dot(target, normal) - 1e-4  # the nearer of the two
    snapped = np.array(SliceDrag(TILT, plane, ray, 0.5).dragged(ray, BOX, snap=True).normal)
    np.testing.assert_allclose(snapped / np.abs(snapped).max(), np.round(snapped / np.abs(snapped).max()))


@given(vectors, directions, eyes)
def test_a_camera_faces_a_plane_with_right_on_its_right(
    point: np.ndarray, normal: np.ndarray, eye: np.ndarray
) -> None:
    plane = SlicePlane.across(point, normal)
    nearest = np.array(plane.nearest(eye))
    assert nearest @ normal == pytest.approx(plane.position, abs=1e-9)
    assert np.linalg.norm(np.cross(eye - nearest, normal)) < 1e-9
    camera = Camera((0.0, 0.0, 8.0), target=tuple(eye.tolist()))
    for above in (True, False):
        right, up, back = plane.facing(camera, above=above).axes
        assert abs(back @ normal) == pytest.approx(1.0, abs=1e-5)
        assert right @ camera.axes[0] >= -1e-6
        if abs(camera.axes[2 if above else 1] @ normal) < 0.89:
            assert up @ camera.axes[2 if above else 1] > 0.4


def test_a_slice_of_a_flat_object_moves_off_it() -> None:
    plate = MeshObject("plate", [[0, 0, 1], [4, 0, 1], [0, 2, 1]], [[0, 1, 2]])
    low, high = SlicePlane.across((1, 1, 1), (0, 0, 1)).reach(*slice_box([plate]))
    assert (low, high) == (-1.0, 3.0)
    assert SlicePlane.across((1, 1, 1), (1, 0, 0)).reach(*slice_box([plate])) == (0.0, 4.0)


def test_planes_know_their_choice_and_refuse_what_is_no_direction() -> None:
    choices = [SlicePlane.across((1, 2, 3), axis).choice for axis in (*np.eye(3), (1, 1, 0), (-1, 0, 0))]
    assert choices == ["x", "y", "z", "tilted", "tilted"]
    assert set(choices) < set(CHOICES)
    plane = SlicePlane.across((1, 2, 3), (0, 2, 0))
    assert plane.position == 2.0
    assert plane.at(-1.5).point == (1.0, -1.5, 3.0)
    for normal in ((0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0), (1, 2)):
        with pytest.raises(InvalidEdit, match="slice normal: expected"):
            SlicePlane.across((0, 0, 0), normal)


@pytest.mark.parametrize("standing", UPRIGHT)
def test_a_click_on_the_middle_of_the_cube_keeps_the_view(standing: str) -> None:
    axes, names = UPRIGHT[standing], set()
    for words in product(("bottom", "", "top"), ("back", "", "front"), ("left", "", "right")):
        name = " ".join(filter(None, words))
        if not name:
            continue
        parts = np.sum([PRESETS[word] for word in name.split()], axis=0)
        up = axes.up if parts[[0, 2]].any() else -parts[1] * np.array(axes.front)
        cells = cube_cells(axes, tuple(parts @ axes.matrix), tuple(up))
        assert {cell["name"] for cell in cells if middle(cell["points"])} == {name}
        assert max(abs(float(x)) for cell in cells for x in cell["points"].replace(",", " ").split()) < 1.8
        names |= {cell["name"] for cell in cells}
    assert len(names) == 26


def middle(points: str) -> bool:
    """Return True if the origin lies in a convex polygon, or on its border."""
    corners = np.array([[float(number) for number in pair.split(",")] for pair in points.split()])
    edges = np.roll(corners, -1, axis=0) - corners
    turns = edges[:, 0] * -corners[:, 1] + edges[:, 1] * corners[:, 0]
    area = np.abs(turns).sum()
    return bool(area > 1e-6 and ((turns >= -0.02).all() or (turns <= 0.02).all()))
