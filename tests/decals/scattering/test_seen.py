from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from blobtree import Box, Point
from decals import scatter
from decals.errors import InvalidPoints, InvalidScattering
from decals.scattering import seen_from_outside
from decals.scattering.seen import spread_directions
from decals.surfaces import MeshSurface
from tests.decals.meshes import plane, sphere
from tests.vectors import random_units

UNITS = random_units(np.random.default_rng(0), 400).astype(np.float32)


def opened(radius: float, angle: float) -> MeshSurface:
    """A ball without the faces within an angle of the z axis, in degrees."""
    ball = sphere(radius)
    middles = ball.vertices[ball.faces].mean(axis=1)
    heights = middles[:, 2] / np.linalg.norm(middles, axis=1)
    return MeshSurface(ball.vertices, ball.faces[heights < np.cos(np.radians(angle))])


@pytest.mark.parametrize("inner", [sphere(1.0), Point((0, 0, 0), radius=1.0)], ids=["mesh", "tree"])
def test_a_ball_around_another_hides_it(inner: Any) -> None:
    seen = seen_from_outside([inner, sphere(2.0)])
    assert not seen(UNITS).any()
    assert seen(2.0 * UNITS).all()
    assert seen_from_outside(inner)(UNITS).all()


@settings(max_examples=15, deadline=None)
@given(angle=st.floats(25.0, 80.0))
def test_all_of_an_open_ball_is_seen_and_of_a_ball_within_what_faces_the_opening(angle: float) -> None:
    hull = opened(2.0, angle)
    seen = seen_from_outside([hull, sphere(0.2)])
    assert seen(1.999 * UNITS).all()
    found, heights = seen(0.2 * UNITS), UNITS[:, 2]
    # The opening's point that lies highest over a point's tangent plane, which is 0.2 from the middle:
    highest = 2.0 * np.cos(np.maximum(0.0, np.arccos(heights) - np.radians(angle)))
    assert found[highest > 0.6].all()
    assert not found[highest < 0.05].any()


def test_a_floor_under_a_table_is_seen_from_the_side() -> None:
    table, floor = plane(2.0), plane(2.0)
    high = MeshSurface(table.vertices + np.array([0.0, 0.0, 0.5]), table.faces)
    points = np.array([[0.0, 0.0, 0.0], [0.9, 0.9, 0.0]], np.float32)
    assert seen_from_outside([high, floor])(points).all()
    walls = Box((0, 0, 0), (2.4, 2.4, 1.4), radius=0)
    assert not seen_from_outside([high, floor, walls])(points).any()


def test_what_an_open_hull_hides_gets_no_decals() -> None:
    """The hull lacks one face of 5,120, so its inside counts as outside."""
    ball = sphere(2.0)
    hull = MeshSurface(ball.vertices, ball.faces[1:])
    models = [hull, sphere(0.5)]
    everywhere = scatter(models, count=80)
    inner = np.linalg.norm(everywhere.positions, axis=1) < 1.0
    assert inner.sum() == 5  # its share of the area, 1/17
    shown = scatter(models, count=80, mask=seen_from_outside(models, directions=64))
    assert (np.linalg.norm(shown.positions, axis=1) > 1.9).all()


@pytest.mark.parametrize("count", [1, 2, 7, 256, 5000])
def test_directions_are_spread(count: int) -> None:
    ways = spread_directions(count)
    assert ways.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1.0, atol=1e-6)
    if count > 100:
        nearest = np.sort(ways.astype(np.float64) @ ways.T.astype(np.float64), axis=1)[:, -2]
        angles = np.arccos(nearest) / np.sqrt(4.0 * np.pi / count)
        assert angles.min() > 0.6
        gaps = np.arccos((UNITS @ ways.T).max(axis=1)) / np.sqrt(4.0 * np.pi / count)
        assert gaps.max() < 1.0


def test_bad_input_is_refused() -> None:
    with pytest.raises(InvalidScattering, match="expected one or more"):
        seen_from_outside([])
    for wrong in (0, -3, 1.5, 10**9, "many"):
        any_wrong: Any = wrong
        with pytest.raises(InvalidScattering, match="directions"):
            seen_from_outside(sphere(), directions=any_wrong)
    with pytest.raises(InvalidPoints):
        seen_from_outside(sphere())(np.full((1, 3), np.nan, np.float32))
    assert seen_from_outside(sphere())(np.zeros((0, 3), np.float32)).shape == (0,)
