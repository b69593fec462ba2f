"""The rectangle of what lies within balls holds all of it, and little more."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blobtree._typing import Float64Array
from decals import Camera, Scene
from decals.rendering import Projection, RenderOptions
from decals.rendering.dirty_regions import MAX_RECTANGLES, TargetState, ball_extents, joined, regions_of
from decals.rendering.pixel_pass import GROUP
from decals.rendering.viewpoint import TILE_MARGIN, PictureView, Rectangle, tiles

SIZE = (300, 200)

numbers = st.floats(-3.0, 3.0)
points = st.tuples(numbers, numbers, numbers)


def perspective(eye: Float64Array, target: Float64Array, fov: float) -> Float64Array:
    camera = Camera(tuple(eye.tolist()), tuple(target.tolist()), (0.1, 0.2, 1.0), fov)
    return camera.clip_matrix(SIZE, ([-3, -3, -3], [3, 3, 3]))


def parallel(scale: float, shear: float) -> Float64Array:
    return np.array([[scale, shear, 0, 0.1], [0, scale, shear, -0.2], [0.1, 0, -0.1, 0], [0, 0, 0, 1.0]])


def on_ball(center: Float64Array, radius: float) -> Float64Array:
    """Points all over a ball, ``float64[n, 3]``."""
    count = 1000
    z = 1.0 - 2.0 * (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    flat = np.sqrt(1.0 - z**2)
    return center + radius * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])


def projected(matrix: Float64Array, places: Float64Array) -> Float64Array:
    clip = np.column_stack([places, np.ones(len(places))]) @ matrix.T
    return clip[:, :2] / clip[:, 3:]


@given(points, points, st.floats(1e-3, 2.0), st.floats(5.0, 120.0))
def test_in_perspective_boxes_hold_balls_tightly(
    eye: tuple[float, ...], center: tuple[float, ...], radius: float, fov: float
) -> None:
    place, ball = np.array(eye) + 5.0, np.array(center)
    matrix = perspective(place, np.zeros(3), fov)
    check(matrix, ball, radius, behind=matrix[3] @ [*ball, 1.0] <= radius * np.linalg.norm(matrix[3, :3]))


@given(points, st.floats(1e-3, 2.0), st.floats(0.05, 3.0), st.floats(-1.0, 1.0))
def test_in_parallel_projections_too_sheared_ones_as_well(
    center: tuple[float, ...], radius: float, scale: float, shear: float
) -> None:
    check(parallel(scale, shear), np.array(center), radius, behind=False)


def check(matrix: Float64Array, center: Float64Array, radius: float, *, behind: bool) -> None:
    found = ball_extents(matrix, [[*center, radius]])
    if behind or found is None:
        assert behind
        assert found is None
        return
    (low,), (high,) = found
    seen = projected(matrix, on_ball(center, radius))
    slack = 1e-9 * (1.0 + np.abs(seen).max())
    assert (seen >= low - slack).all()
    assert (seen <= high + slack).all()
    wide = high - low
    assert (seen.min(axis=0) - low < 0.1 * wide + slack).all()
    assert (high - seen.max(axis=0) < 0.1 * wide + slack).all()


@pytest.mark.parametrize("inner", [Rectangle(0, 0, *SIZE), Rectangle(40, 30, 101, 77)])
def test_regions_of_a_tile_hold_the_samples_of_all_balls_and_whole_groups(inner: Rectangle) -> None:
    rng = np.random.default_rng(0)
    matrix = perspective(np.array([4.0, 5.0, 6.0]), np.zeros(3), 40.0)
    picture = PictureView.of(Projection(matrix), SIZE, ([-1, -1, -1], [1, 1, 1]))
    tile = picture.part(inner)
    shares, numbers = [], []
    for count in np.resize([1, 3, 3, 20, 100], 40).tolist():
        balls = np.column_stack([rng.uniform(-2, 2, (count, 3)), rng.uniform(0.01, 0.3, count)])
        found = regions_of(tile, balls, 3.0)
        places = np.concatenate([on_ball(ball[:3], ball[3]) for ball in balls])
        samples = np.floor((0.5 * projected(matrix, places) + 0.5) * SIZE - (inner.x, inner.y)).astype(int)
        inside = (samples >= 0).all(axis=1) & (samples < (tile.width, tile.height)).all(axis=1)
        x, y = samples[inside].T
        covered = np.zeros((tile.height, tile.width), bool)
        for part in found:
            right, top = part.x + part.width, part.y + part.height
            assert covered[part.y : top, part.x : right].shape == (part.height, part.width)
            covered[part.y : top, part.x : right] = True
            assert part.area > 0
            assert part.x % GROUP == part.y % GROUP == 0
            assert right % GROUP == 0 or right == tile.width
            assert top % GROUP == 0 or top == tile.height
        assert covered[y, x].all()
        assert len(found) <= min(count, MAX_RECTANGLES)
        shares.append(covered.mean())
        numbers.append(len(found))
    assert np.median(shares) < 0.8
    assert max(numbers) > 1


corners = st.builds(Rectangle, st.integers(0, 20), st.integers(0, 20), st.integers(1, 12), st.integers(1, 12))


@given(st.lists(corners, max_size=12))
def test_joined_rectangles_hold_the_same_and_are_not_more_to_draw(rectangles: list[Rectangle]) -> None:
    found = joined(rectangles)
    assert sum(part.area for part in found) <= sum(part.area for part in rectangles)
    for one in rectangles:
        assert any(part.around(one) == part for part in found)
    assert joined([Rectangle(0, 0, 8, 8)] * 3) == (Rectangle(0, 0, 8, 8),)
    assert joined([Rectangle(0, 0, 8, 8), Rectangle(8, 0, 8, 8)]) == (Rectangle(0, 0, 16, 8),)


def test_no_balls_are_nowhere_and_those_behind_the_eye_anywhere() -> None:
    matrix = perspective(np.array([0.0, 0.0, 5.0]), np.zeros(3), 40.0)
    tile = PictureView.of(Projection(matrix), SIZE, ([-1, -1, -1], [1, 1, 1])).whole()
    assert regions_of(tile, np.zeros((0, 4)), 1.0) == ()
    assert regions_of(tile, np.array([[0.0, 0.0, 4.5, 0.6]]), 1.0) == (Rectangle(0, 0, *SIZE),)
    assert regions_of(tile, np.array([[0.0, 0.0, 9.0, 0.1]]), 1.0) == (Rectangle(0, 0, *SIZE),)
    assert regions_of(tile, np.array([[50.0, 0.0, 0.0, 0.1]]), 1.0) == ()


def test_paint_and_light_leave_out_the_margin_of_a_tile() -> None:
    scene = Scene(objects=(), camera=Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 30.0))
    bounds = ([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])
    view = PictureView.of(scene.camera, (1000, 700), bounds)
    options = RenderOptions(size=(1000, 700), samples=1)
    covered = np.zeros((700, 1000), int)
    for tile in tiles(view, 1, limit=300):
        dirty = TargetState.of(scene, bounds, tile, options, depth=False).dirty(None, tile)
        assert dirty.surface == (Rectangle(0, 0, tile.width, tile.height),)
        assert dirty.light == dirty.paint
        (part,) = dirty.paint
        assert part.x % GROUP == part.y % GROUP == 0
        assert part.width <= 300 + 2 * GROUP < 300 + TILE_MARGIN
        inner = tile.inner
        x, y = tile.x + part.x, tile.y + part.y
        assert x <= inner.x <= inner.x + inner.width <= x + part.width
        assert y <= inner.y <= inner.y + inner.height <= y + part.height
        covered[inner.y : inner.y + inner.height, inner.x : inner.x + inner.width] += 1
    assert (covered == 1).all()
